// Graphics over the scene as television shows them: clock, order and gaps, splits, gauges, and the pilot's head-up display;
// and pictures with them for films and cards: the page is asked for one instant after the other.

import { Vector3 } from "three";
import { sized, writeLabels } from "./scene.js";
import { signed, written } from "./values.js";

const SHOWN = 2.6; // s, that a split stays
const FADE = 0.25; // s, in which it appears and goes
const PANEL = "rgba(9, 17, 26, 0.74)";
const [WHITE, PALE, FASTER, SLOWER] = ["#ffffff", "#b9c6d2", "#57e389", "#ff7b6b"];
const LIGHT = "#8dffb4"; // of the head-up display
const FULL = 1280 * 720; // pixels of a picture in which sizes are those below
const LADDER = [-60, -45, -30, -20, -10, 10, 20, 30, 45, 60]; // degrees
const LONGEST = 18; // letters of a flight's name
const SECTOR = { best: "#c77dff", own: FASTER, slower: "#ffd166" }; // of all, of the flight itself, and the others
const PRESENTED = { from: 0.3, to: 4.8 }; // s, in which it is told who flies
const DISQUALIFIED = "DSQ"; // the abbreviation of result lists in all languages
const CALLED = 4; // s, that a penalty stays

export class Graphics {
  /** `title` is the name of the course, `broadcast` has the texts, and `replay` is what is shown again, see `costliestOf`. */
  constructor(flights, title, units, broadcast, replay) {
    Object.assign(this, { flights, title, lead: flights[0], units, broadcast, replay });
  }

  /** A text in the language of the broadcast, with values in their places. */
  say(key, ...values) {
    return values.reduce((text, value) => text.replace("{}", value), this.broadcast.texts[key]);
  }

  /** A number as that language writes it. */
  number(value, digits, form = written) {
    return form(value, digits).replace(".", this.broadcast.decimal);
  }

  /**
   * Draw what belongs over a picture.
   *
   * @param context of a canvas, in pixels of the page.
   * @param view that is shown, placed.
   * @param whole whether nothing else tells title and gauges; else only what a page has nowhere else.
   * @param top pixels that are covered along the upper edge, and `bottom` along the lower one.
   */
  draw(context, width, height, time, view, { whole = false, top = 0, bottom = 0 } = {}) {
    this.context = context;
    this.unit = Math.max(Math.sqrt((width * height) / FULL), whole ? 0.4 : 0.78);
    context.lineJoin = "round";
    const edge = whole ? 26 * this.unit : 10;
    if (view.seat) this.headUp(width, height, time, view.camera);
    if (!view.follows && !whole) return;
    this.tower(edge, top + edge, time, whole);
    const gauged = whole && !view.seat;
    // Upright there is no room beside the gauges.
    const above = gauged && width < 1.2 * height ? 84 * this.unit : 0;
    this.split(0.5 * width, height - bottom - edge - above, time);
    if (gauged) this.gauges(width - edge, height - edge, time);
    if (!whole) return;
    if (view.name === "replay") this.repeated(width - edge, edge);
    else this.presentation(edge, height - edge - (above && above + 58 * this.unit), time);
  }

  /**
   * Flights in their order at the last passing that all have made which are still in the race: `[{flight, gap}]`, how much later
   * than the first one each made it, s; NaN, and last, for those that have not.
   */
  order(time) {
    const visible = this.flights.filter((flight) => flight.visible && flight.passings.length);
    const racing = visible.filter((flight) => time <= flight.duration || flight.raceTime !== null);
    const last = Math.min(...(racing.length ? racing : visible).map((flight) => flight.passings[flight.leg(time)].number));
    const times = new Map(visible.map((flight) => [flight, flight.passing(last)?.time ?? Infinity]));
    const first = Math.min(...times.values());
    const sorted = [...visible].sort((a, b) => (times.get(a) === times.get(b) ? 0 : times.get(a) - times.get(b)));
    return sorted.map((flight) => ({ flight, gap: times.get(flight) < Infinity ? times.get(flight) - first : NaN }));
  }

  /** The sectors of a flight so far, from passing to passing, in the colours of television; none where nothing compares. */
  sectors(flight, time) {
    const sectorsOf = (one) =>
      one.passings.slice(1).flatMap(({ name, number, time: end }, i) => {
        const before = one.passings[i];
        const ends = number === before.number + 1 && end <= time + 1e-4;
        return ends ? [{ stretch: `${before.name} ${name}`, took: end - before.time, flight: one, end }] : [];
      });
    const all = this.flights.filter(({ visible }) => visible).flatMap(sectorsOf);
    const least = (sectors) => Math.min(...sectors.map(({ took }) => took));
    return sectorsOf(flight).map(({ stretch, took, end }) => {
      const same = all.filter((sector) => sector.stretch === stretch);
      const own = same.filter((sector) => sector.flight === flight && sector.end < end);
      if (took <= least(same)) return "best";
      return own.length && took <= least(own) ? "own" : "slower";
    });
  }

  /** The laps of the race. */
  get laps() {
    return Math.max(1, ...this.lead.passings.map(({ lap }) => lap ?? 1));
  }

  /** What is written at the upper left: clock, lap and gate, the flights in their order, and whether the first one is done. */
  state(time) {
    const { passings, duration } = this.lead;
    const leg = this.lead.leg(time);
    const last = passings.length - 1;
    const { laps } = this;
    const done = time >= duration - 1e-6;
    const gate = done ? this.say("finish") : this.say("gate", Math.min(leg + 1, last), last);
    return {
      clock: this.number(Math.min(time, duration), 2),
      place: laps > 1 ? `${this.say("lap", passings[Math.min(leg + 1, last)].lap, laps)}, ${gate}` : gate,
      order: this.order(done ? Infinity : time),
      done,
    };
  }

  tower(left, top, time, whole) {
    const u = this.unit;
    const { clock, place, order, done } = this.state(time);
    const now = done ? Infinity : time; // the result, though others finish later
    const compares = order.length > 1 || this.laps > 1;
    const [wide, row] = [252 * u, 34 * u];
    const heading = whole && this.title;
    const high = (heading ? 30 * u : 0) + 62 * u + (compares ? row * order.length + 6 * u : 0);
    this.panel(left, top, wide, high);
    let y = top + (heading ? 30 * u : 0);
    if (heading) this.write(this.title, left + 14 * u, top + 24 * u, 15, { weight: 600, colour: PALE, within: wide - 28 * u });
    this.write(clock, left + 14 * u, y + 43 * u, 38, { weight: 700 });
    this.write(place, left + wide - 14 * u, y + 41 * u, 14, { align: "right", colour: PALE, within: 120 * u });
    y += 62 * u;
    const begun = time > (order[0]?.flight.passing(1)?.time ?? Infinity);
    for (const [i, { flight, gap }] of compares ? order.entries() : []) {
      const added = this.added(flight, now);
      const first = done ? this.number(flight.raceTime, 3) : this.say("ahead");
      const text = !begun || order.length < 2 ? "" : i === 0 ? first : Number.isFinite(gap) ? this.number(gap, 3, signed) : "";
      this.context.fillStyle = flight.colour;
      this.context.fillRect(left + 14 * u, y + 4 * u, 6 * u, 22 * u);
      this.write(shortened(flight.label), left + 28 * u, y + 17.5 * u, 16, { weight: flight === this.lead ? 650 : 500, within: (added ? 86 : 132) * u });
      if (added) this.write(added, left + wide - 86 * u, y + 17.5 * u, 14, { align: "right", weight: 650, colour: SLOWER, within: 50 * u });
      this.write(text, left + wide - 14 * u, y + 17.5 * u, 16, { align: "right", weight: 600, colour: i === 0 ? PALE : WHITE, within: 64 * u });
      this.bars(flight, now, left + 28 * u, y + 23 * u, wide - 42 * u);
      y += row;
    }
    if (whole) this.calls(left, top + high + 8 * u, time);
  }

  /** What has been added to the time of a flight so far, in words. */
  added(flight, time) {
    const called = flight.penalties.filter((penalty) => penalty.time <= time);
    if (called.some(({ seconds }) => seconds === null)) return DISQUALIFIED;
    const sum = called.reduce((total, { seconds }) => total + seconds, 0);
    return sum > 0 ? `+${this.number(sum, Number.isInteger(sum) ? 0 : 1)} s` : "";
  }

  /** A bar for every sector. */
  bars(flight, time, left, top, wide) {
    const { context, unit: u } = this;
    const step = wide / Math.max(this.lead.passings.length - 1, 1);
    const colours = this.sectors(flight, time).map((kind) => SECTOR[kind]);
    for (let i = 0; i < this.lead.passings.length - 1; i += 1) {
      context.fillStyle = colours[i] ?? "rgba(255, 255, 255, 0.16)";
      context.fillRect(left + i * step, top, Math.max(step - 1.5 * u, 1), 4 * u);
    }
  }

  /** Penalties as they happen, one below the other. */
  calls(left, top, time) {
    const u = this.unit;
    const called = this.flights.filter(({ visible }) => visible).flatMap((flight) =>
      flight.penalties.filter((penalty) => penalty.time <= time && time < penalty.time + CALLED).map((penalty) => ({ flight, ...penalty })),
    );
    called.forEach(({ flight, rule, gate, seconds }, i) => {
      const y = top + 52 * i * u;
      const price = seconds > 0 ? ` +${this.number(seconds, Number.isInteger(seconds) ? 0 : 1)} s` : "";
      this.panel(left, y, 252 * u, 46 * u);
      this.context.fillStyle = SLOWER;
      this.context.fillRect(left + 14 * u, y + 8 * u, 6 * u, 30 * u);
      this.write(seconds === null ? this.say("race over") : `${this.say("penalty")}${price}`, left + 28 * u, y + 20 * u, 16, { weight: 700, colour: SLOWER, within: 210 * u });
      const words = [this.flights.length > 1 ? shortened(flight.label) : "", this.say(rule), gate].filter(Boolean).join(", ");
      this.write(words, left + 28 * u, y + 38 * u, 14, { within: 210 * u });
    });
  }

  /** Who flies, at the beginning of a race. */
  presentation(left, bottom, time) {
    if (time < PRESENTED.from || time > PRESENTED.to) return;
    const u = this.unit;
    const shown = this.flights.filter(({ visible }) => visible);
    const [wide, row] = [330 * u, 48 * u];
    const top = bottom - row * shown.length - 8 * u;
    this.context.globalAlpha = Math.min(1, (time - PRESENTED.from) / FADE, (PRESENTED.to - time) / FADE);
    this.panel(left, top, wide, bottom - top);
    shown.forEach((flight, i) => {
      const y = top + 4 * u + i * row;
      this.context.fillStyle = flight.colour;
      this.context.fillRect(left + 14 * u, y + 6 * u, 6 * u, 36 * u);
      this.write(flight.raceNumber, left + 62 * u, y + 34 * u, 26, { weight: 750, align: "right", within: 38 * u });
      const x = left + (flight.raceNumber ? 74 : 32) * u;
      this.write(shortened(flight.label), x, y + 23 * u, 20, { weight: 700, within: left + wide - x - 60 * u });
      this.write(flight.aircraft.name, x, y + 41 * u, 14, { colour: PALE, within: left + wide - x - 14 * u });
      this.write(flight.nation, left + wide - 14 * u, y + 23 * u, 18, { weight: 700, align: "right" });
    });
    this.context.globalAlpha = 1;
  }

  /** That something is shown again, and who loses how much in it. */
  repeated(right, top) {
    const u = this.unit;
    const { flight, change } = this.replay;
    const loser = change > 0 ? this.flights[flight] : this.lead;
    const wide = 300 * u;
    this.panel(right - wide, top, wide, 66 * u);
    this.write(this.say("replay"), right - 14 * u, top + 28 * u, 22, { weight: 750, align: "right", colour: SECTOR.slower, within: wide - 28 * u });
    this.context.fillStyle = loser.colour;
    this.context.fillRect(right - wide + 14 * u, top + 38 * u, 6 * u, 18 * u);
    this.write(shortened(loser.label), right - wide + 28 * u, top + 54 * u, 17, { weight: 600, within: 160 * u });
    const lost = `${this.number(Math.abs(change), 3, signed)} s`;
    this.write(lost, right - 14 * u, top + 54 * u, 19, { weight: 700, align: "right", colour: SLOWER });
  }

  /** After a passing its time, and how far the others were behind it or before it there. */
  split(middle, bottom, time) {
    const { passings } = this.lead;
    const number = this.lead.leg(time);
    const passing = passings[number];
    const since = passing ? time - passing.time : Infinity;
    const final = number === passings.length - 1;
    if (number < 1 || since < 0 || (since > SHOWN && !final)) return;
    const u = this.unit;
    const rivals = this.flights.filter((flight) => flight.visible && flight !== this.lead);
    const times = rivals.map((flight) => flight.passing(passing.number)?.time).filter((then) => then !== undefined);
    const ahead = times.length ? passing.time - Math.min(...times) : NaN;
    this.context.globalAlpha = final ? 1 : Math.min(1, since / FADE, (SHOWN - since) / FADE);
    const [wide, high] = [(Number.isFinite(ahead) ? 292 : 200) * u, 50 * u];
    const [left, top] = [middle - 0.5 * wide, bottom - high];
    this.panel(left, top, wide, high);
    this.write(final ? this.say("finish") : passing.name, left + 16 * u, top + 32 * u, 17, { colour: PALE, within: 78 * u });
    this.write(this.number(passing.time, 3), left + 182 * u, top + 34 * u, 25, { weight: 700, align: "right" });
    if (Number.isFinite(ahead)) {
      const colour = ahead <= 0 ? FASTER : SLOWER;
      this.write(this.number(ahead, 3, signed), left + wide - 16 * u, top + 33 * u, 21, { weight: 700, align: "right", colour });
    }
    this.context.globalAlpha = 1;
  }

  /** Speed, height and load factor at the lower right. */
  gauges(right, bottom, time) {
    const u = this.unit;
    const [wide, high] = [330 * u, 74 * u];
    const [left, top] = [right - wide, bottom - high];
    this.panel(left, top, wide, high);
    const values = [
      ["V_I", this.units.speed, 0],
      ["height", this.units.length, 0],
      ["n_z", "g", 1],
    ];
    values.forEach(([name, unit, digits], i) => {
      const x = left + (i + 1) * 104 * u - 18 * u;
      this.write(this.number(this.lead.value(name, time), digits), x, top + 44 * u, 32, { weight: 700, align: "right" });
      this.write(unit, x + 6 * u, top + 44 * u, 15, { colour: PALE });
    });
    const load = this.lead.value("n_z", time);
    const [bar, share] = [wide - 28 * u, Math.min(Math.max(load / 12, 0), 1)];
    this.context.fillStyle = "rgba(255, 255, 255, 0.18)";
    this.context.fillRect(left + 14 * u, top + 58 * u, bar, 6 * u);
    this.context.fillStyle = share > 0.8 ? SLOWER : share > 0.5 ? "#ffd166" : FASTER;
    this.context.fillRect(left + 14 * u, top + 58 * u, bar * share, 6 * u);
  }

  /** Horizon and ladder, the way that is flown, the next gate, and numbers beside them. */
  headUp(width, height, time, camera) {
    const u = this.unit;
    const [x, y] = [0.5 * width, 0.5 * height];
    const seen = (direction) => {
      const at = camera.position.clone().addScaledVector(direction, 1000).project(camera);
      return at.z < 1 ? [x * (1 + at.x), y * (1 - at.y)] : null;
    };
    const nose = camera.getWorldDirection(new Vector3());
    const heading = Math.atan2(nose.x, -nose.z);
    const towards = (aside, up) => {
      const [turn, climb] = [heading + (aside * Math.PI) / 180, (up * Math.PI) / 180];
      return new Vector3(Math.sin(turn) * Math.cos(climb), Math.sin(climb), -Math.cos(turn) * Math.cos(climb));
    };
    const near = Math.min(x, y) * 0.95;
    const stroke = (from, to) => {
      const ends = [from, to].map(seen);
      if (ends.some((end) => end === null || Math.hypot(end[0] - x, end[1] - y) > near)) return null;
      this.stroke([ends], LIGHT, 1.6);
      return ends;
    };
    for (let aside = -44; aside < 44; aside += 4) stroke(towards(aside, 0), towards(aside + 4, 0));
    for (const up of LADDER)
      for (const side of [-1, 1]) {
        const ends = stroke(towards(4 * side, up), towards(9 * side, up));
        if (ends && side > 0) this.write(`${up}`.replace("-", "−"), ends[1][0] + 6 * u, ends[1][1] + 5 * u, 13, { colour: LIGHT });
      }
    const way = this.lead.position(time + 0.05).sub(this.lead.position(time - 0.05));
    const path = way.lengthSq() > 0 ? seen(way.normalize()) : null;
    if (path) this.pathMarker(...path);
    this.nextGate(width, height, time, camera);
    const side = Math.min(0.3 * width, 0.48 * height);
    this.reading(x - side, y, this.number(this.lead.value("V_I", time), 0), this.units.speed, "right");
    this.reading(x + side, y, this.number(this.lead.value("height", time), 0), this.units.length, "left");
    this.reading(x - side, y + 40 * u, this.number(this.lead.value("n_z", time), 1), "g", "right");
  }

  pathMarker(x, y) {
    const r = 9 * this.unit;
    const { context } = this;
    context.beginPath();
    context.arc(x, y, r, 0, 2 * Math.PI);
    context.strokeStyle = LIGHT;
    context.lineWidth = 2 * this.unit;
    context.stroke();
    this.stroke([[[x - 2.4 * r, y], [x - r, y]], [[x + r, y], [x + 2.4 * r, y]], [[x, y - r], [x, y - 1.9 * r]]], LIGHT, 2);
  }

  /** Brackets around the place of the next passing, at the edge where it lies outside of the picture. */
  nextGate(width, height, time, camera) {
    const next = this.lead.passings.find((one) => one.time > time + 1e-3);
    if (!next) return;
    const place = this.lead.position(next.time);
    const away = place.distanceTo(this.lead.position(time));
    const at = place.clone().project(camera);
    if (at.z >= 1) [at.x, at.y] = [-at.x, -at.y];
    const reach = Math.max(Math.abs(at.x) / 0.78, Math.abs(at.y) / 0.62, at.z >= 1 ? 1e-6 : 0);
    const inside = at.z < 1 && reach <= 1;
    const [x, y] = [0.5 * width * (1 + at.x / (inside ? 1 : reach)), 0.5 * height * (1 - at.y / (inside ? 1 : reach))];
    const u = this.unit;
    const r = Math.min(Math.max(2600 / Math.max(away, 1), 11), 40) * u;
    const corner = (a, b) => [[x + a * r, y + 0.45 * b * r], [x + a * r, y + b * r], [x + 0.45 * a * r, y + b * r]];
    this.stroke([corner(-1, -1), corner(1, -1), corner(-1, 1), corner(1, 1)], "#ffd166", 2.4);
    const text = `${next.name}  ${this.number(away, 0)} m  ${this.number(next.time - time, 1)} s`;
    this.write(text, x, y + r + 20 * u, 15, { align: "center", colour: "#ffd166", weight: 650, outline: true });
  }

  reading(x, y, value, unit, align) {
    const u = this.unit;
    const sense = align === "right" ? -1 : 1;
    this.panel(align === "right" ? x - 92 * u : x, y - 18 * u, 92 * u, 36 * u);
    this.write(value, align === "right" ? x - 30 * u : x + 62 * u, y + 9 * u, 24, { weight: 700, align: "right", colour: LIGHT });
    this.write(unit, (align === "right" ? x - 30 * u : x + 62 * u) + 5 * u, y + 9 * u, 13, { colour: LIGHT });
    this.stroke([[[x, y], [x - sense * 8 * u, y]]], LIGHT, 2);
  }

  panel(left, top, wide, high) {
    this.context.fillStyle = PANEL;
    this.context.beginPath();
    this.context.roundRect(left, top, wide, high, 7 * this.unit);
    this.context.fill();
  }

  stroke(paths, colour, width) {
    const { context } = this;
    context.beginPath();
    for (const path of paths) path.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    for (const [ink, more] of [["rgba(0, 20, 10, 0.55)", 2], [colour, 0]]) {
      context.strokeStyle = ink;
      context.lineWidth = width * this.unit + more;
      context.stroke();
    }
  }

  /** What the flight is, in small letters at the foot of a picture. */
  stamp(width, height) {
    const text = this.lead.stamp;
    const within = width - 20 * this.unit;
    this.write(text, width / 2, height - 7 * this.unit, 14, { align: "center", colour: PALE, within, outline: true });
  }

  write(text, x, y, size, { weight = 500, align = "left", colour = WHITE, within = undefined, outline = false } = {}) {
    const { context } = this;
    context.font = `${weight} ${size * this.unit}px ${getComputedStyle(document.body).fontFamily}`;
    context.textAlign = align;
    context.textBaseline = "alphabetic";
    if (outline) {
      Object.assign(context, { strokeStyle: "rgba(0, 20, 10, 0.7)", lineWidth: 3 * this.unit });
      context.strokeText(text, x, y, within);
    }
    context.fillStyle = colour;
    context.fillText(text, x, y, within);
  }
}

/** What people call a flight, without what tells them that it lies in a file. */
function shortened(label) {
  const name = label.replace(/\.h5(?=:|$)/, "");
  return name.length > LONGEST ? `${name.slice(0, LONGEST)}…` : name;
}

const NAMES = 15; // pixels high, in a picture of FULL
const THICK = 2.2; // of the line on a card, against that of the page
const VERDICTS = { good: "#57e389", bad: "#ff7b6b", caution: "#ffc24d", unsure: "#c7d4df" }; // colours, by the badge of the page
const QUALITY = 0.94;
const CARD = { elevation: 0.2 }; // rad, of the eye: so low that the horizon is seen
const CARD_SHARE = 0.12; // of the race, at which the aircraft is shown on a card
const ENLARGED = 9; // times, there

export class Film {
  constructor(scene, graphics, clock) {
    Object.assign(this, { scene, graphics, clock, sheet: document.createElement("canvas") });
  }

  /** What is shown again behind the finish: `{from, to}`, s; or null. */
  get replay() {
    return this.graphics.replay;
  }

  /**
   * The picture of an instant (s) as base64, so many pixels wide and high.
   *
   * @param type `jpeg` or `png`.
   * @param alone whether graphics are drawn alone, on nothing; else over the scene in the view of a name.
   */
  frame(time, name, width, height, type = "jpeg", alone = false) {
    const view = alone ? { name, follows: true } : this.scene.views.get(name);
    const context = alone ? sized(this.sheet, width, height, 1) : this.drawn(time, view, width, height, [0, 0], 1);
    const size = NAMES * Math.sqrt((width * height) / FULL);
    if (!alone) writeLabels(context, this.scene.labels, view.camera, width, height, size);
    this.graphics.draw(context, width, height, time, view, { whole: true });
    this.graphics.stamp(width, height);
    return this.sheet.toDataURL(`image/${type}`, QUALITY).split(",")[1];
  }

  /** The card of all flights as base64 of a PNG: their lines over the course, and what the head of the page tells. */
  card(width, height) {
    const { actors, views } = this.scene;
    const view = views.get("orbit");
    view.home();
    Object.assign(view, CARD);
    this.scene.enlarged = ENLARGED;
    const context = this.drawn(CARD_SHARE * actors[0].flight.duration, view, width, height, [110, 165], THICK);
    this.head(context, width, height, actors.map(({ flight }) => flight));
    return this.sheet.toDataURL("image/png").split(",")[1];
  }

  drawn(time, view, width, height, covered, thick) {
    this.clock.time = time;
    this.scene.draw(width, height, 1, view, covered, thick, false);
    const context = sized(this.sheet, width, height, 1);
    context.drawImage(this.scene.canvas, 0, 0, width, height);
    return context;
  }

  /** The faster of two flights above, each in the colour of its line, with the gap behind the slower one. */
  duel(write, width, height, flights, name) {
    const ranked = [...flights].sort((a, b) => (a.raceTime ?? Infinity) - (b.raceTime ?? Infinity));
    write(name, 48, height - 84, 58, 700, "#ffffff", "left", 520);
    const { graphics } = this;
    for (const [row, { label, colour, raceTime, stamp, nation, raceNumber }] of ranked.entries()) {
      const gap = row && raceTime !== null ? ` (${graphics.number(raceTime - ranked[0].raceTime, 3, signed)})` : "";
      const time = raceTime === null ? graphics.say("not finished") : `${graphics.number(raceTime, 3)} s${gap}`;
      const who = [raceNumber, label, nation].filter(Boolean).join(" ");
      write(`${who}  ${time}`, width - 48, height - 122 + 46 * row, 36, 700, colour, "right", 560);
      write(`${label}: ${stamp}`, 50, height - 40 + 24 * row, 17, 500, "#c7d4df", "left", width - 100);
    }
  }

  head(context, width, height, flights) {
    const text = (selector) => document.querySelector(selector)?.innerText.replace(/\s+/g, " ").trim() ?? "";
    const dark = context.createLinearGradient(0, height - 260, 0, height);
    dark.addColorStop(0, "rgba(6, 14, 22, 0)");
    dark.addColorStop(0.55, "rgba(6, 14, 22, 0.72)");
    dark.addColorStop(1, "rgba(6, 14, 22, 0.9)");
    context.fillStyle = dark;
    context.fillRect(0, height - 260, width, 260);
    const family = getComputedStyle(document.body).fontFamily;
    const write = (words, x, y, size, weight, colour, align, within) => {
      Object.assign(context, { font: `${weight} ${size}px ${family}`, fillStyle: colour, textAlign: align });
      context.fillText(words, x, y, within);
    };
    context.textBaseline = "alphabetic";
    if (flights.length > 1) {
      this.duel(write, width, height, flights, text("h1"));
      return;
    }
    const [{ raceTime, stamp, label, nation, raceNumber, named }] = flights;
    const { subtitle, state } = this.graphics.broadcast;
    const who = named ? `${[raceNumber, label, nation].filter(Boolean).join(" ")}, ` : "";
    write(text("h1"), 48, height - 84, 58, 700, "#ffffff", "left", 760);
    write(`${who}${subtitle}`, 50, height - 46, 25, 500, "#c7d4df", "left", 800);
    write(stamp, 50, height - 16, 17, 500, "#c7d4df", "left", width - 100);
    write(`${this.graphics.number(raceTime, 3)} s`, width - 48, height - 72, 78, 750, "#ffffff", "right", 330);
    const verdict = document.querySelector(".verdict");
    const colour = Object.entries(VERDICTS).find(([name]) => verdict.classList.contains(name))[1];
    write(state, width - 50, height - 46, 22, 600, colour, "right", 330);
  }
}
