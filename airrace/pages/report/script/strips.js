// Histories over time or over the way of the first flight, one strip per kind of quantity, with limits and gates drawn and
// the present instant marked in all.

import { uPlot } from "uplot";
import { extent, ghostColour, ghostName, indexBefore, signed, themed, written } from "./values.js";

const HEIGHT = 118; // pixels of a strip
const NEAR = 0.6; // of its own extent, within which a limit beyond the data is still shown
const LINES = ["line-1", "line-2", "line-3"];
const WHEEL = 0.0015; // of the stretch that is shown, per unit of a wheel

export class Strips {
  constructor(element, { strips, units }, flights, clock, stretch, differences) {
    Object.assign(this, { element, units, flights, clock, stretch, differences });
    this.times = commonTimes(flights);
    this.duration = this.times[this.times.length - 1];
    this.axis = this.axisOver("time");
    this.strips = differences.length ? [this.differenceStrip()] : [];
    this.strips.push(...strips.map((strip) => this.strip(strip)).filter((strip) => strip !== null));
    new ResizeObserver(() => this.resize()).observe(element);
    stretch.watch(() => this.redraw());
    clock.watch((time) => this.mark(time));
    this.mark(clock.time);
  }

  /**
   * What the histories are drawn over: the clock, or the way of the first flight.
   *
   * `times` are those of the first flight, `grid` their places on the axis, `at` and `time` lead from one to the other, and
   * `of(flight, time)` is when a flight was there; over its way that is when it was at the same place of the course.
   */
  axisOver(name) {
    if (name === "time") {
      const same = (value) => value;
      return { unit: "s", times: this.times, grid: this.times, at: same, time: same, of: (_, time) => time };
    }
    const [lead] = this.flights;
    const way = lead.history("way");
    const times = this.times.filter((time, i) => time <= lead.duration && (!i || time > this.times[i - 1]));
    const grid = times.map((time) => lead.value("way", time));
    const pairs = new Map(this.differences.map((pair) => [pair.flight, pair]));
    return {
      unit: this.units.length,
      times,
      grid,
      at: (time) => lead.value("way", Math.min(time, lead.duration)),
      time: (place) => {
        const i = indexBefore(way, place);
        const share = (place - way[i]) / (way[i + 1] - way[i] || 1);
        return lead.time[i] + Math.min(Math.max(share, 0), 1) * (lead.time[i + 1] - lead.time[i]);
      },
      of: (flight, time) => (flight.number ? (pairs.get(flight.number)?.there(time) ?? NaN) : time),
    };
  }

  /** Draw all histories over `time`, or over `distance`. */
  over(name) {
    this.axis = this.axisOver(name);
    for (const { plot, series } of this.strips) plot.setData([this.axis.grid, ...series.map((one) => one.sample())], false);
    this.redraw();
  }

  /** One strip, or null where no flight has any of its histories. */
  strip(quantity) {
    const series = [];
    for (const [place, line] of quantity.lines.entries())
      for (const flight of this.flights) {
        // Of the flights beside the first only the main line of each strip is shown.
        if (!flight.history(line.history) || (flight.number > 0 && place > 0)) continue;
        series.push({ ...line, flight, place, sample: () => this.sampled(flight, line.history, quantity.wraps) });
      }
    return series.length ? this.made(quantity, series) : null;
  }

  differenceStrip() {
    const quantity = { title: "Difference of time", unit: "s", digits: 3, limits: [{ value: 0, label: "" }], signed: true };
    const series = this.differences.map(({ flight, at }) => {
      const known = (time) => time <= this.flights[0].duration && Number.isFinite(at(time));
      const value = (time) => (known(time) ? at(time) : null);
      const sample = () => Array.from(this.axis.times, value);
      return { label: this.flights[flight].label, flight: this.flights[flight], place: 0, value, sample };
    });
    return this.made(quantity, series);
  }

  made(quantity, series) {
    const figure = document.createElement("figure");
    figure.className = "strip";
    const head = document.createElement("figcaption");
    const title = document.createElement("b");
    title.textContent = quantity.title;
    const unit = document.createElement("i");
    unit.textContent = quantity.unit;
    head.append(title, unit);
    const values = series.map((one) => valueOf(head, one));
    figure.append(head);
    this.element.append(figure);
    const plot = new uPlot(this.options(quantity, series), [this.axis.grid, ...series.map((one) => one.sample())], figure);
    const now = document.createElement("div");
    now.className = "now";
    plot.over.append(now);
    this.scrub(plot);
    return { quantity, series, values, plot };
  }

  options(quantity, series) {
    // Of what is shown: a small change is seen once it is looked at closely.
    const range = (plot) => {
      const visible = series.flatMap((one, i) => (one.flight.visible ? [plot.data[i + 1]] : []));
      const [from, to] = this.shown();
      const inside = (_, i) => plot.data[0][i] >= from && plot.data[0][i] <= to;
      return rangeOf(quantity, visible.map((data) => data.filter(inside)));
    };
    const axis = { stroke: () => themed("muted"), grid: { stroke: () => themed("rule"), width: 1 }, ticks: { show: false } };
    const font = `11px ${getComputedStyle(document.body).fontFamily}`;
    return {
      width: this.element.clientWidth || 600,
      height: HEIGHT,
      padding: [6, 26, 0, 0],
      cursor: { show: false },
      legend: { show: false },
      scales: { x: { time: false, range: () => this.shown() }, y: { range } },
      axes: [
        { ...axis, font, size: 22, gap: 2, values: (_, ticks) => ticks.map((tick) => `${tick} ${this.axis.unit}`) },
        { ...axis, font, size: 46, gap: 4, space: 17, ...(quantity.wraps ? { splits: () => [-2, -1, 0, 1, 2].map((one) => (one * quantity.wraps) / 4) } : {}) },
      ],
      series: [{}, ...series.map(lineOf)],
      hooks: { drawClear: [(plot) => drawGates(plot, this.flights[0].passings.map(({ time }) => this.axis.at(time)))], draw: [(plot) => drawLimits(plot, quantity.limits), (plot) => this.point(plot)] },
    };
  }

  /** The ends of the axis that are shown. */
  shown() {
    return [this.stretch.from, this.stretch.to].map((time) => this.axis.at(time));
  }

  /** A drag moves the clock, Ctrl and the wheel zoom, a double click shows the whole race. */
  scrub(plot) {
    const timeOf = (event) => {
      const box = plot.over.getBoundingClientRect();
      return this.axis.time(plot.posToVal(event.clientX - box.left, "x"));
    };
    const to = (event) => this.clock.set(timeOf(event));
    plot.over.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey && !event.metaKey) return;
        event.preventDefault();
        this.stretch.zoom(Math.exp(WHEEL * (event.deltaMode === 1 ? 30 : 1) * event.deltaY), timeOf(event));
      },
      { passive: false },
    );
    plot.over.addEventListener("dblclick", () => this.stretch.show("race"));
    plot.over.addEventListener("pointerdown", (event) => {
      plot.over.setPointerCapture(event.pointerId);
      to(event);
    });
    plot.over.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) to(event);
    });
  }

  /** Move the mark of the present instant to its place, which is another one once a strip is drawn with another axis. */
  point(plot) {
    const now = plot.over.querySelector(".now");
    if (now) now.style.transform = `translateX(${plot.valToPos(this.axis.at(this.clock.time), "x").toFixed(1)}px)`;
  }

  mark(time) {
    for (const { quantity, series, values, plot } of this.strips) {
      this.point(plot);
      series.forEach((one, i) => {
        const then = this.axis.of(one.flight, time);
        const value = one.history ? one.flight.value(one.history, then, quantity.wraps ?? 0) : (one.value(time) ?? NaN);
        values[i].textContent = quantity.signed ? signed(value, quantity.digits) : written(value, quantity.digits);
      });
    }
  }

  redraw() {
    for (const { plot, series } of this.strips) {
      series.forEach((one, i) => plot.setSeries(i + 1, { show: one.flight.visible }));
      plot.setData(plot.data, true);
    }
    this.mark(this.clock.time);
  }

  /** A history of a flight along the axis; null where nothing is known, and where it jumps by half a turn. */
  sampled(flight, history, wraps) {
    let before = NaN;
    return this.axis.times.map((now) => {
      const time = this.axis.of(flight, now);
      if (!(time <= flight.duration + 1e-4)) return null;
      const value = flight.value(history, time, wraps ?? 0);
      const jumps = wraps && Math.abs(value - before) > wraps / 2;
      before = value;
      return jumps || !Number.isFinite(value) ? null : value;
    });
  }

  /** Fit the strips into a width, side by side as the style has it, or in so many columns. */
  resize(width = this.element.clientWidth, columns = columnsOf(this.element)) {
    if (!width) return;
    const each = Math.floor((width - 20 * (columns - 1)) / columns) - 14;
    for (const { plot } of this.strips) plot.setSize({ width: each, height: HEIGHT });
    this.mark(this.clock.time);
  }
}

function columnsOf(element) {
  return getComputedStyle(element).gridTemplateColumns.split(" ").length;
}

/** All times at which any flight is shown: those of the first, and beyond them those of the longest. */
function commonTimes(flights) {
  const [first] = flights;
  const longest = flights.reduce((a, b) => (b.duration > a.duration ? b : a));
  const beyond = Array.from(longest.time).filter((time) => time > first.duration);
  return [...first.time, ...beyond];
}

function valueOf(head, { label, flight, place }) {
  const entry = document.createElement("span");
  const key = document.createElement("s");
  key.className = flight.number > 0 ? `ghost ${ghostName(flight.number)}` : LINES[place % LINES.length];
  const name = document.createElement("em");
  name.textContent = flight.number > 0 ? flight.label : label;
  const value = document.createElement("output");
  entry.append(key, name, value);
  head.append(entry);
  return value;
}

function lineOf({ label, flight, place }) {
  const ghost = flight.number > 0;
  return {
    label,
    stroke: () => (ghost ? ghostColour(flight.number) : themed(LINES[place % LINES.length])),
    width: ghost ? 1.2 : 1.8,
    dash: ghost ? [5, 3] : [],
    points: { show: false },
  };
}

/** The extent of the data, and of the limits that are near it. */
function rangeOf(quantity, columns) {
  if (quantity.wraps) return [-0.53 * quantity.wraps, 0.53 * quantity.wraps];
  const [least, largest] = extent(columns.flatMap((data) => extent(data.filter((value) => value !== null)) ?? [])) ?? [0, 1];
  const reach = Math.max(largest - least, quantity.least ?? 1e-3);
  const isNear = (value) => value > least - NEAR * reach && value < largest + NEAR * reach;
  const near = quantity.limits.map(({ value }) => value).filter(isNear);
  const [low, high] = extent([least, largest, ...near]);
  const lacking = Math.max((quantity.least ?? 1e-3) - (high - low), 0);
  const margin = 0.5 * lacking + 0.08 * (high - low + lacking);
  return [low - margin, high + margin];
}

function drawGates(plot, places) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = themed("gate-line");
  ctx.lineWidth = 1;
  ctx.beginPath();
  for (const place of places) {
    const x = Math.round(plot.valToPos(place, "x", true)) + 0.5;
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
  }
  ctx.stroke();
  ctx.restore();
}

function drawLimits(plot, limits) {
  const { ctx, bbox } = plot;
  const { min, max } = plot.scales.y;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = themed("limit");
  ctx.lineWidth = 1.4 * devicePixelRatio;
  ctx.setLineDash([7 * devicePixelRatio, 4 * devicePixelRatio]);
  for (const { value } of limits) {
    if (value < min || value > max) continue;
    const y = plot.valToPos(value, "y", true);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
  }
  ctx.restore();
}
