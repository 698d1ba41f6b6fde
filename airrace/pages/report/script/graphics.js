// Graphics over the scene as television shows them: clock, order and gaps, splits, gauges, and the pilot's head-up display;
// and pictures with them for films and cards: the page is asked for one instant after the other.

import { Vector3 } from "three";
import { sized, writeLabels } from "./scene.js";
import { signed, tagColour, written } from "./values.js";

const SHOWN = 2.6; // s, that a split stays
const FADE = 0.25; // s, in which it appears and goes
const PANEL = "rgba(9, 17, 26, 0.74)";
const [WHITE, PALE, FASTER, SLOWER] = ["#ffffff", "#b9c6d2", "#57e389", "#ff7b6b"];
const LIGHT = "#8dffb4"; // of the head-up display
const FULL = 1280 * 720; // pixels of a picture in which sizes are those below
const LADDER = [-60, -45, -30, -20, -10, 10, 20, 30, 45, 60]; // degrees
const LONGEST = 18; // letters of a flight's name

export class Graphics {
  /** `differences` tell how far the others are behind, see `differencesOf`; `title` is the name of the course. */
  constructor(flights, differences, title, units) {
    Object.assign(this, { flights, title, lead: flights[0], differences, units });
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
  }

  /** Flights in their order now, with how far each is behind the one that is ahead: `[{flight, gap}]`. */
  order(time) {
    const [lead, ...others] = this.flights;
    const gaps = others.map((flight, i) => ({ flight, gap: this.differences[i]?.at(Math.min(time, lead.duration)) ?? NaN }));
    const all = [{ flight: lead, gap: 0 }, ...gaps].filter(({ flight }) => flight.visible);
    all.sort((a, b) => (Number.isFinite(a.gap) ? a.gap : 1e9) - (Number.isFinite(b.gap) ? b.gap : 1e9));
    const first = all.length ? all[0].gap : 0;
    return all.map(({ flight, gap }) => ({ flight, gap: gap - first }));
  }

  /** What is written at the upper left: clock, lap and gate, and the flights in their order. */
  state(time) {
    const { passings, duration } = this.lead;
    const leg = this.lead.leg(time);
    const last = passings.length - 1;
    const laps = Math.max(1, ...passings.map(({ lap }) => lap ?? 1));
    const done = time >= duration - 1e-6;
    const gate = done ? "finish" : `gate ${Math.min(leg + 1, last)} of ${last}`;
    return {
      clock: written(Math.min(time, duration), 2),
      place: laps > 1 ? `lap ${passings[Math.min(leg + 1, last)].lap} of ${laps}, ${gate}` : gate,
      order: this.order(time),
    };
  }

  tower(left, top, time, whole) {
    const u = this.unit;
    const { clock, place, order } = this.state(time);
    const [wide, row] = [252 * u, 27 * u];
    const heading = whole && this.title;
    const high = (heading ? 30 * u : 0) + 62 * u + (order.length > 1 ? row * order.length + 8 * u : 0);
    this.panel(left, top, wide, high);
    let y = top + (heading ? 30 * u : 0);
    if (heading) this.write(this.title, left + 14 * u, top + 24 * u, 15, { weight: 600, colour: PALE, within: wide - 28 * u });
    this.write(clock, left + 14 * u, y + 43 * u, 38, { weight: 700 });
    this.write(place, left + wide - 14 * u, y + 41 * u, 14, { align: "right", colour: PALE, within: 120 * u });
    y += 62 * u;
    if (order.length < 2) return;
    order.forEach(({ flight, gap }, i) => {
      this.context.fillStyle = tagColour(flight.number);
      this.context.fillRect(left + 14 * u, y + 6 * u, 6 * u, 15 * u);
      const name = flight.label.length > LONGEST ? `${flight.label.slice(0, LONGEST)}…` : flight.label;
      this.write(name, left + 28 * u, y + 19.5 * u, 16, { weight: flight === this.lead ? 650 : 500, within: 140 * u });
      const text = i === 0 ? "ahead" : Number.isFinite(gap) ? signed(gap, 2) : "";
      this.write(text, left + wide - 14 * u, y + 19.5 * u, 16, { align: "right", weight: 600, colour: i === 0 ? PALE : WHITE });
      y += row;
    });
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
    const rivals = this.order(passing.time + 1e-3).filter(({ flight }) => flight !== this.lead);
    const own = this.order(passing.time + 1e-3).find(({ flight }) => flight === this.lead);
    const best = rivals.length ? Math.min(...rivals.map(({ gap }) => gap)) : NaN;
    const ahead = (own?.gap ?? 0) - best;
    this.context.globalAlpha = final ? 1 : Math.min(1, since / FADE, (SHOWN - since) / FADE);
    const [wide, high] = [(Number.isFinite(ahead) ? 292 : 200) * u, 50 * u];
    const [left, top] = [middle - 0.5 * wide, bottom - high];
    this.panel(left, top, wide, high);
    this.write(final ? "finish" : passing.name, left + 16 * u, top + 32 * u, 17, { colour: PALE, within: 78 * u });
    this.write(written(passing.time, 3), left + 182 * u, top + 34 * u, 25, { weight: 700, align: "right" });
    if (Number.isFinite(ahead)) {
      const colour = ahead <= 0 ? FASTER : SLOWER;
      this.write(signed(ahead, 3), left + wide - 16 * u, top + 33 * u, 21, { weight: 700, align: "right", colour });
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
      this.write(written(this.lead.value(name, time), digits), x, top + 44 * u, 32, { weight: 700, align: "right" });
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
    this.number(x - side, y, written(this.lead.value("V_I", time), 0), this.units.speed, "right");
    this.number(x + side, y, written(this.lead.value("height", time), 0), this.units.length, "left");
    this.number(x - side, y + 40 * u, written(this.lead.value("n_z", time), 1), "g", "right");
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
    const text = `${next.name}  ${written(away, 0)} m  ${written(next.time - time, 1)} s`;
    this.write(text, x, y + r + 20 * u, 15, { align: "center", colour: "#ffd166", weight: 650, outline: true });
  }

  number(x, y, value, unit, align) {
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
    const text = document.querySelector(".mast .stamp").textContent;
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

  /** The picture of an instant (s) as base64 of a JPEG, so many pixels wide and high. */
  frame(time, name, width, height) {
    const view = this.scene.views.get(name);
    const context = this.drawn(time, view, width, height, [0, 0], 1);
    const size = NAMES * Math.sqrt((width * height) / FULL);
    writeLabels(context, this.scene.labels, view.camera, width, height, size);
    this.graphics.draw(context, width, height, time, view, { whole: true });
    this.graphics.stamp(width, height);
    return this.sheet.toDataURL("image/jpeg", QUALITY).split(",")[1];
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
    for (const [row, { label, number, raceTime, stamp }] of ranked.entries()) {
      const gap = row && raceTime !== null ? ` (${signed(raceTime - ranked[0].raceTime, 3)})` : "";
      const time = raceTime === null ? "not finished" : `${written(raceTime, 3)} s${gap}`;
      write(`${label}  ${time}`, width - 48, height - 122 + 46 * row, 36, 700, tagColour(number), "right", 560);
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
    write(text("h1"), 48, height - 84, 58, 700, "#ffffff", "left", 760);
    write(text(".mast p"), 50, height - 46, 25, 500, "#c7d4df", "left", 800);
    write(text(".mast .stamp"), 50, height - 16, 17, 500, "#c7d4df", "left", width - 100);
    write(text(".race-time").replace(/ ?s$/, " s"), width - 48, height - 72, 78, 750, "#ffffff", "right", 330);
    const verdict = document.querySelector(".verdict");
    const colour = Object.entries(VERDICTS).find(([name]) => verdict.classList.contains(name))[1];
    write(verdict.dataset.state, width - 50, height - 46, 22, 600, colour, "right", 330);
  }
}
