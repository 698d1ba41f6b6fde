// Histories over time, one strip per kind of quantity, with limits and gates drawn and the clock's time marked in all.

import { uPlot } from "uplot";
import { extent, ghostColour, ghostName, indexBefore, signed, themed, written } from "./values.js";

const HEIGHT = 118; // pixels of a strip
const NEAR = 0.6; // of its own extent, within which a limit beyond the data is still shown
const LINES = ["line-1", "line-2", "line-3"];
const AROUND = 0.4; // s before and after a leg that is shown alone

export class Strips {
  constructor(element, strips, flights, clock, differences) {
    this.element = element;
    this.flights = flights;
    this.clock = clock;
    this.whole = true;
    this.leg = -1;
    this.grid = commonTimes(flights);
    this.duration = this.grid[this.grid.length - 1];
    const values = (strip) => (line, flight) => sampled(flight, line.history, this.grid, strip.wraps);
    this.strips = differences.length ? [this.differenceStrip(differences)] : [];
    this.strips.push(...strips.map((strip) => this.strip(strip, values(strip))).filter((strip) => strip !== null));
    new ResizeObserver(() => this.resize()).observe(element);
    clock.watch((time) => this.mark(time));
    this.mark(clock.time);
  }

  /** One strip, or null where no flight has any of its histories. */
  strip(quantity, values) {
    const series = [];
    for (const [place, line] of quantity.lines.entries())
      for (const flight of this.flights) {
        // Of the flights beside the first only the main line of each strip is shown.
        if (!flight.history(line.history) || (flight.number > 0 && place > 0)) continue;
        series.push({ ...line, flight, place, data: values(line, flight) });
      }
    return series.length ? this.made(quantity, series) : null;
  }

  differenceStrip(differences) {
    const quantity = { title: "Difference of time", unit: "s", digits: 3, limits: [{ value: 0, label: "" }], signed: true };
    const series = differences.map(({ flight, at }) => {
      const known = (time) => time <= this.flights[0].duration && Number.isFinite(at(time));
      const data = Array.from(this.grid, (time) => (known(time) ? at(time) : null));
      return { label: this.flights[flight].label, flight: this.flights[flight], place: 0, data };
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
    const plot = new uPlot(this.options(quantity, series), [this.grid, ...series.map((one) => one.data)], figure);
    const now = document.createElement("div");
    now.className = "now";
    plot.over.append(now);
    this.scrub(plot);
    return { quantity, series, values, plot, now };
  }

  options(quantity, series) {
    const range = () => rangeOf(quantity, series.filter((one) => one.flight.visible));
    const axis = { stroke: () => themed("muted"), grid: { stroke: () => themed("rule"), width: 1 }, ticks: { show: false } };
    const font = `11px ${getComputedStyle(document.body).fontFamily}`;
    return {
      width: this.element.clientWidth || 600,
      height: HEIGHT,
      padding: [6, 10, 0, 0],
      cursor: { show: false },
      legend: { show: false },
      scales: { x: { time: false, range: () => this.shown() }, y: { range } },
      axes: [
        { ...axis, font, size: 22, gap: 2, values: (_, ticks) => ticks.map((tick) => `${tick} s`) },
        { ...axis, font, size: 46, gap: 4, space: 17, ...(quantity.wraps ? { splits: () => [-2, -1, 0, 1, 2].map((one) => (one * quantity.wraps) / 4) } : {}) },
      ],
      series: [{}, ...series.map(lineOf)],
      hooks: { drawClear: [(plot) => drawGates(plot, this.flights[0])], draw: [(plot) => drawLimits(plot, quantity.limits)] },
    };
  }

  /** The stretch of time that is shown: all of the race, or a leg. */
  shown() {
    const { passings } = this.flights[0];
    if (this.whole || this.leg < 0) return [0, this.duration];
    const from = passings[this.leg].time;
    const to = passings[Math.min(this.leg + 1, passings.length - 1)].time;
    return [Math.max(0, from - AROUND), Math.min(this.duration, Math.max(to, from) + AROUND)];
  }

  showWhole(whole) {
    this.whole = whole;
    this.leg = this.flights[0].leg(this.clock.time);
    this.redraw();
  }

  scrub(plot) {
    const to = (event) => {
      const box = plot.over.getBoundingClientRect();
      this.clock.set(plot.posToVal(event.clientX - box.left, "x"));
    };
    plot.over.addEventListener("pointerdown", (event) => {
      plot.over.setPointerCapture(event.pointerId);
      to(event);
    });
    plot.over.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) to(event);
    });
  }

  mark(time) {
    const leg = this.flights[0].leg(time);
    if (!this.whole && leg !== this.leg) {
      this.leg = leg;
      this.redraw();
    }
    for (const { quantity, series, values, plot, now } of this.strips) {
      now.style.transform = `translateX(${plot.valToPos(time, "x").toFixed(1)}px)`;
      series.forEach((one, i) => {
        const value = one.history ? one.flight.value(one.history, time, quantity.wraps ?? 0) : (one.data[indexBefore(this.grid, time)] ?? NaN);
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

function sampled(flight, history, grid, wraps) {
  let before = NaN;
  return grid.map((time) => {
    if (time > flight.duration + 1e-4) return null;
    const value = flight.value(history, time, wraps ?? 0);
    const jumps = wraps && Math.abs(value - before) > wraps / 2;
    before = value;
    return jumps || !Number.isFinite(value) ? null : value;
  });
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
function rangeOf(quantity, series) {
  if (quantity.wraps) return [-0.53 * quantity.wraps, 0.53 * quantity.wraps];
  const [least, largest] = extent(series.flatMap((one) => extent(one.data.filter((value) => value !== null)) ?? [])) ?? [0, 1];
  const reach = Math.max(largest - least, quantity.least ?? 1e-3);
  const isNear = (value) => value > least - NEAR * reach && value < largest + NEAR * reach;
  const near = quantity.limits.map(({ value }) => value).filter(isNear);
  const [low, high] = extent([least, largest, ...near]);
  const lacking = Math.max((quantity.least ?? 1e-3) - (high - low), 0);
  const margin = 0.5 * lacking + 0.08 * (high - low + lacking);
  return [low - margin, high + margin];
}

function drawGates(plot, { passings }) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = themed("gate-line");
  ctx.lineWidth = 1;
  ctx.beginPath();
  for (const { time } of passings) {
    const x = Math.round(plot.valToPos(time, "x", true)) + 0.5;
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
