// Graphics over the scene as television shows them: clock, order and gaps, splits, gauges, and the pilot's head-up display;
// and pictures with them for films and cards: the page is asked for one instant after the other.

import { Vector3 } from "three";
import { overlap, RESULT, sized, writeLabels } from "./scene.js";
import { pursuitsOf, signed, swingsOf, written } from "./values.js";

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
const EVEN = 0.5; // of what a flight loses: where its two costliest legs make less, it lost little by little
const COUNTS = 0.1; // of what all other legs cost, from which on one of its causes is told
const TOLD = 0.02; // s, that is lost on a leg from which on the result tells of it
const RESULT_SHOWN = 8; // s
const PENALTIES = 3; // of which the result tells
const EDGE = 26; // pixels, in a picture of FULL, that are left free along its edges

export class Graphics {
  /** `title` is the name of the course, `broadcast` has the texts, and `differences` are those of the flights. */
  constructor(flights, title, units, broadcast, differences) {
    Object.assign(this, { flights, title, lead: flights[0], units, broadcast, differences, panels: [] });
    this.swings = swingsOf(differences, flights);
    this.pursuits = pursuitsOf(differences, flights);
    this.finish = Math.max(flights[0].duration, ...differences.map(({ flight }) => flights[flight]).map(({ raceTime, duration }) => raceTime && duration));
  }

  /** Whom television follows at an instant. */
  subject(time) {
    return this.pursuits.findLast(({ flight, from }) => from < time && flight.visible)?.flight ?? this.lead;
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
   * Draw what belongs over a picture; `panels` are then the boxes that are covered: left, top, width, height.
   *
   * @param context of a canvas, in pixels of the page.
   * @param view that is shown, placed.
   * @param whole whether nothing else tells title and gauges; else only what a page has nowhere else.
   * @param top pixels that are covered along the upper edge, and `bottom` along the lower one.
   */
  draw(context, width, height, time, view, { whole = false, top = 0, bottom = 0 } = {}) {
    this.context = context;
    this.unit = unitOf(width, height, whole ? 0.4 : 0.78);
    context.lineJoin = "round";
    const edge = whole ? EDGE * this.unit : 10;
    this.panels = [];
    if (view.seat) this.headUp(width, height, time, view.camera);
    if (!view.follows && !whole) return;
    if (view.name === RESULT) return this.result(width, height, edge, view.camera);
    if (view.swing) this.repeated(edge, edge, Math.min(width - 2 * edge, 430 * this.unit), view.swing, time);
    else this.tower(edge, top + edge, time, whole);
    const gauged = whole && !view.seat;
    // Upright there is no room beside the gauges.
    const above = gauged && width < 1.2 * height ? (this.flights.length > 1 ? 108 : 84) * this.unit : 0;
    if (!view.swing) this.split(0.5 * width, height - bottom - edge - above, time);
    if (gauged) this.gauges(width - edge, height - edge, time, view.name === "tv" ? this.subject(time) : this.lead);
    if (whole && !view.swing) this.presentation(edge, height - edge - (above && above + 58 * this.unit), time);
    if (view.camera && view.follows && !view.seat) this.outside(width, height, time, view);
  }

  /**
   * Flights in their order at the last passing that all have made which are still in the race: `[{flight, gap}]`, how much later
   * than the first one each made it, s; NaN, and last, for those that have not.
   */
  order(time) {
    const visible = this.flights.filter((flight) => flight.visible && flight.passings.length);
    const last = this.last(time);
    const times = new Map(visible.map((flight) => [flight, flight.passing(last)?.time ?? Infinity]));
    const first = Math.min(...times.values());
    const sorted = [...visible].sort((a, b) => (times.get(a) === times.get(b) ? 0 : times.get(a) - times.get(b)));
    return sorted.map((flight) => ({ flight, gap: times.get(flight) < Infinity ? times.get(flight) - first : NaN }));
  }

  /** The number of the last passing that all have made which are still in the race. */
  last(time) {
    const visible = this.flights.filter((flight) => flight.visible && flight.passings.length);
    const racing = visible.filter((flight) => time <= flight.duration || flight.raceTime !== null);
    return Math.min(...(racing.length ? racing : visible).map((flight) => flight.passings[flight.leg(time)].number));
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

  /** What is written at the upper left: clock, lap and leg, the flights in their order and where, and whether all have finished. */
  state(time) {
    const subject = this.subject(time);
    const { passings } = subject;
    const leg = subject.leg(time);
    const last = passings.length - 1;
    const done = time >= this.finish - 1e-6;
    const compared = this.last(done ? Infinity : time);
    return {
      clock: this.number(Math.min(time, this.finish), 2),
      lap: this.lapName(passings[Math.min(leg + 1, last)]),
      place: done || leg === last ? this.say("finish") : legName({ before: passings[leg], after: passings[leg + 1] }),
      order: this.order(done ? Infinity : time),
      gapAt: compared > 0 && this.flights.length > 1 ? this.say("gap at", this.lead.passing(compared)?.name ?? "") : "",
      done,
    };
  }

  tower(left, top, time, whole) {
    const u = this.unit;
    const { clock, lap, place, order, gapAt, done } = this.state(time);
    const now = done ? Infinity : time;
    const compares = order.length > 1 || this.laps > 1;
    const [wide, row] = [252 * u, 34 * u];
    const heading = whole && this.title;
    const high = (heading ? 30 * u : 0) + 80 * u + (compares ? row * order.length + 6 * u : 0);
    this.panel(left, top, wide, high);
    let y = top + (heading ? 30 * u : 0);
    if (heading) this.write(this.title, left + 14 * u, top + 24 * u, 15, { weight: 600, colour: PALE, within: wide - 28 * u });
    this.write(clock, left + 14 * u, y + 43 * u, 38, { weight: 700 });
    this.write(lap, left + wide - 14 * u, y + 41 * u, 14, { align: "right", colour: PALE, within: 100 * u });
    y += 62 * u;
    this.write(place, left + 14 * u, y + 8 * u, 14, { within: 108 * u });
    this.write(gapAt, left + wide - 14 * u, y + 8 * u, 14, { align: "right", colour: PALE, within: 108 * u });
    y += 18 * u;
    for (const [i, { flight, gap }] of compares ? order.entries() : []) {
      const added = this.added(flight, now);
      const first = time >= flight.duration - 1e-6 ? this.number(flight.raceTime, 3) : this.say("ahead");
      const text = !gapAt || order.length < 2 ? "" : i === 0 ? first : Number.isFinite(gap) ? this.number(gap, 3, signed) : "";
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
      const costs = seconds === null || seconds > 0;
      const price = seconds === null ? this.say("race over") : `${this.say("penalty")} +${this.number(seconds, Number.isInteger(seconds) ? 0 : 1)} s`;
      this.panel(left, y, 252 * u, 46 * u);
      this.context.fillStyle = SLOWER;
      this.context.fillRect(left + 14 * u, y + 8 * u, 6 * u, 30 * u);
      this.write(costs ? price : this.say(rule), left + 28 * u, y + 20 * u, 16, { weight: 700, colour: SLOWER, within: 210 * u });
      const words = [this.flights.length > 1 ? shortened(flight.label) : "", costs && this.say(rule), gate].filter(Boolean).join(", ");
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

  /** That a leg is shown again, who loses how much on it, and why. */
  repeated(left, top, wide, swing, time) {
    const u = this.unit;
    const { leg, loser, reasons } = swing;
    const flight = this.flights[loser];
    const common = this.commonCause(swing.flight, loser);
    const why = [...reasons.map((reason) => reasonText(reason)), ...(common ? [common] : [])];
    const high = (100 + 22 * why.length) * u;
    this.panel(left, top, wide, high);
    this.write(this.say("replay"), left + 14 * u, top + 28 * u, 22, { weight: 750, colour: SECTOR.slower, within: 180 * u });
    const within = wide - 216 * u;
    this.write(legName(leg), left + wide - 14 * u, top + 27 * u, 17, { weight: 650, align: "right", within });
    this.write(this.say("level", leg.before.name), left + 14 * u, top + 50 * u, 14, { colour: PALE, within: wide - 140 * u });
    this.write(this.lapName(leg.after), left + wide - 14 * u, top + 50 * u, 14, { align: "right", colour: PALE, within: 100 * u });
    this.named(flight, left + 14 * u, top + 62 * u, wide - 212 * u);
    const { lost, metres, over } = this.runningGap(swing, time);
    const text = `${this.number(lost, over ? 3 : 2, signed)} s`;
    this.write(text, left + wide - 14 * u, top + 79 * u, 20, { weight: 700, align: "right", colour: SLOWER });
    const away = `${this.number(metres * this.units.per_m, 0)} ${this.units.length}`;
    this.write(away, left + wide - 124 * u, top + 79 * u, 16, { align: "right", colour: PALE, within: 60 * u });
    why.forEach((reason, i) => this.write(reason, left + 28 * u, top + (104 + 22 * i) * u, 16, { within: wide - 42 * u }));
  }

  /** How much the loser of a replay has lost where the first flight is, s, how far both are apart, and whether the leg is over. */
  runningGap({ flight, loser, leg, shift }, time) {
    const { at } = this.differences.find((pair) => pair.flight === flight);
    const now = Math.min(Math.max(time, leg.before.time), leg.after.time);
    const other = this.flights[flight];
    const flown = Math.min(now, other.passing(leg.after.number).time - shift); // by both
    const metres = this.lead.position(flown).distanceTo(other.position(flown + shift));
    return { lost: (loser ? 1 : -1) * (at(now) - shift), metres, over: time >= leg.after.time };
  }

  /** What costs a flight of a pair time on every leg; null where nothing does. */
  commonCause(pair, loser) {
    const causes = this.differences.find(({ flight }) => flight === pair)?.common ?? [];
    const same = causes.filter(({ flight }) => flight === loser).map(({ cause }) => cause);
    return same.length ? this.say("everywhere", same.join(", ")) : null;
  }

  /** The colour and the name of a flight. */
  named(flight, left, top, within) {
    const u = this.unit;
    this.context.fillStyle = flight.colour;
    this.context.fillRect(left, top, 6 * u, 22 * u);
    this.write(shortened(flight.label), left + 14 * u, top + 17 * u, 18, { weight: 650, within });
  }

  /** In which lap a passing is, where there are several. */
  lapName({ lap }) {
    return this.laps > 1 ? this.say("lap", lap, this.laps) : "";
  }

  /** The result of a race of several flights: who has won and by how much, and where time was lost, by whom and why. */
  result(width, height, edge, camera) {
    const u = this.unit;
    const bottom = height - edge;
    const { rows, told, lines, high: units } = this.outcome();
    if (camera) for (const { leg, flight } of told) if (leg) this.highlight(leg, flight, width, height, camera);
    const wide = Math.min(width - 52 * u, 940 * u);
    const [left, row, high] = [0.5 * (width - wide), 28 * u, units * u];
    const right = left + wide - 16 * u;
    let y = bottom - high;
    this.panel(left, y, wide, high);
    const [winner] = rows;
    this.write(this.verdict(rows), left + 16 * u, y + 36 * u, 27, { weight: 750, within: wide - 32 * u });
    y += 50 * u;
    for (const { flight, total, added } of rows) {
      this.named(flight, left + 16 * u, y, 0.3 * wide);
      const time = flight.raceTime === null ? this.say("not finished") : this.number(flight.raceTime, 3);
      const penalty = added && `${this.say("penalty")} ${added}`;
      this.write(penalty, left + 0.58 * wide, y + 17 * u, 16, { align: "right", colour: SLOWER, within: 0.22 * wide });
      this.write(time, left + 0.78 * wide, y + 17 * u, 18, { align: "right", weight: 650, within: 0.19 * wide });
      const behind = total === winner.total || total === Infinity ? "" : `${this.number(total - winner.total, 3, signed)} s`;
      this.write(behind, right, y + 17 * u, 18, { align: "right", weight: 700, colour: SLOWER, within: 0.19 * wide });
      y += row;
    }
    for (const line of lines) {
      this.write(line, left + 16 * u, y + 19 * u, 15, { colour: PALE, within: wide - 32 * u });
      y += 22 * u;
    }
    y += lines.length && 6 * u;
    for (const { name, lap, flight, lost, reasons } of told) {
      this.write(name, left + 16 * u, y + (lap ? 14 : 19) * u, 17, { weight: 650, within: 0.17 * wide });
      this.write(lap, left + 16 * u, y + 31 * u, 13, { colour: PALE, within: 0.17 * wide });
      this.named(flight, left + 0.205 * wide, y + 2 * u, 0.15 * wide);
      const bold = { align: "right", weight: 700, colour: SLOWER, within: 0.12 * wide };
      const text = lost === null ? DISQUALIFIED : `${this.number(lost, 3, signed)} s`;
      this.write(text, left + 0.51 * wide, y + 19 * u, 18, bold);
      const [x, within] = [left + 0.53 * wide, right - left - 0.53 * wide];
      const first = reasons.length > 1 ? 14 : 19;
      reasons.forEach((reason, i) => this.write(reason, x, y + (first + 18 * i) * u, 15, { within }));
      y += 40 * u;
    }
  }

  /** The way of a flight on a leg, over a picture. */
  highlight({ before, after }, flight, width, height, camera) {
    const [from, to] = [before, after].map(({ number }) => flight.passing(number).time);
    const seen = flight.places(from, to).map((place) => place.project(camera));
    this.stroke([seen.map(({ x, y }) => [0.5 * width * (1 + x), 0.5 * height * (1 - y)])], SLOWER, 5);
  }

  /** Who has won, and by how much, in words. */
  verdict([winner, second]) {
    const name = shortened(winner.flight.label);
    if (winner.total === Infinity) return this.say("not finished");
    if (!second || second.total === Infinity) return this.say("won", name);
    const gap = second.total - winner.total;
    return gap < 0.0005 ? this.say("tie") : this.say("won by", name, this.number(gap, 3));
  }

  /**
   * What the result tells: `rows` of all flights in their order, in which penalties count; `told`, what cost whom time, and
   * the `lines` above that; how `high` it is.
   */
  outcome() {
    const rows = this.flights.filter(({ visible }) => visible).map((flight) => {
      const added = flight.penalties.reduce((sum, { seconds }) => sum + (seconds ?? Infinity), 0);
      return { flight, total: (flight.raceTime ?? Infinity) + added, added: this.added(flight, Infinity) };
    });
    rows.sort((a, b) => (a.total === b.total ? 0 : a.total - b.total));
    const [first, second] = rows.map(({ flight }) => flight);
    const other = first === this.lead ? second : first;
    const told = [...this.costlyPenalties(rows), ...this.costlyLegs(other)];
    const heading = told.length ? this.heading(other, told) : "";
    const losers = [other, this.lead].filter((flight) => told.some((row) => row.leg && row.flight === flight));
    const common = losers.map((flight) => ({ flight, cause: this.commonCause(other.number, flight.number) }));
    const everywhere = common.filter(({ cause }) => cause).map(({ flight, cause }) => `${shortened(flight.label)}, ${cause}`).join("; ");
    const lines = [heading, everywhere].filter(Boolean);
    return { rows, told, lines, high: 56 + 28 * rows.length + (lines.length && 6 + 22 * lines.length) + 40 * told.length };
  }

  /** What the rows of losses are: where most was lost, or that it was lost little by little. */
  heading(other, told) {
    const legs = this.differences.find(({ flight }) => flight === other?.number)?.legs ?? [];
    const [costly, ...others] = told.filter(({ leg }) => leg);
    const lossOf = ({ lost }) => (costly?.flight === other ? lost : -lost);
    const losing = legs.map(lossOf).filter((lost) => lost >= TOLD).sort((a, b) => b - a);
    const sum = (values) => values.reduce((total, lost) => total + lost, 0);
    const both = others.some(({ flight }) => flight !== costly.flight);
    if (!costly || both || sum(losing.slice(0, 2)) >= EVEN * sum(losing)) return this.say("where");
    return this.say("spread", shortened(costly.flight.label), losing.length, legs.length);
  }

  /** The penalties that cost most, as `{name, lap, flight, lost, reasons}`; what is lost is null where the race was over. */
  costlyPenalties(rows) {
    const cost = ({ lost }) => lost ?? Infinity;
    const reasonsOf = ({ rule, seconds }) => [`${this.say(seconds === null ? "race over" : "penalty")}: ${this.say(rule)}`];
    const called = rows.flatMap(({ flight }) =>
      flight.penalties.map((penalty) => ({ name: penalty.gate, lap: "", flight, lost: penalty.seconds, reasons: reasonsOf(penalty) })),
    );
    return called.filter((penalty) => cost(penalty) > 0).sort((a, b) => (cost(a) === cost(b) ? 0 : cost(b) - cost(a))).slice(0, PENALTIES);
  }

  /** The two legs on which the first flight lost most against another one, and the two of that; then all others together. */
  costlyLegs(other) {
    const legs = this.differences.find(({ flight }) => flight === other?.number)?.legs ?? [];
    const ranked = legs.filter(({ lost }) => Math.abs(lost) >= TOLD).sort((a, b) => Math.abs(b.lost) - Math.abs(a.lost));
    const chosen = [1, -1].flatMap((sense) => ranked.filter(({ lost }) => sense * lost > 0).slice(0, 2));
    const entry = (name, lap, lost, reasons) => ({ name, lap, flight: lost > 0 ? other : this.lead, lost: Math.abs(lost), reasons });
    const told = ranked.filter((leg) => chosen.includes(leg)).map(({ passing, lost, reasons }) => {
      const leg = { before: this.lead.passing(passing - 1), after: this.lead.passing(passing) };
      return { ...entry(legName(leg), this.lapName(leg.after), lost, reasons.map((reason) => reasonText(reason, 1))), leg };
    });
    const finished = other && this.lead.raceTime !== null && other.raceTime !== null;
    const sum = (some) => some.reduce((total, { lost }) => total + lost, 0);
    const rest = (finished ? other.raceTime - this.lead.raceTime : sum(legs)) - sum(chosen);
    if (!told.length || Math.abs(rest) < TOLD) return told;
    const causes = new Map();
    const same = legs.filter((leg) => !chosen.includes(leg) && leg.lost * rest > 0).flatMap(({ reasons }) => reasons);
    for (const { cause, lost, rank } of same) causes.set(cause, { rank, lost: (causes.get(cause)?.lost ?? 0) + lost });
    const counting = [...causes].filter(([, cause]) => cause.lost >= COUNTS * Math.abs(rest));
    const inOrder = counting.sort(([, a], [, b]) => a.rank - b.rank || b.lost - a.lost);
    const reasons = inOrder.slice(0, 2).map(([cause]) => cause);
    return [...told, entry(this.say("others"), "", rest, reasons)];
  }

  /** Where flights are that are not in the picture, and how much later than the first one they made the gate of the order. */
  outside(width, height, time, view) {
    const u = this.unit;
    const order = new Map(this.order(time).map(({ flight, gap }) => [flight, gap]));
    const last = this.last(time);
    const gate = !view.swing && last > 0 ? (this.lead.passing(last)?.name ?? "") : "";
    for (const flight of this.flights.slice(1)) {
      if (!flight.visible || !(view.shows?.(flight, time) ?? true)) continue;
      const at = flight.position(time + (view.shiftOf?.(flight) ?? 0)).project(view.camera);
      if (at.z < 1 && Math.abs(at.x) < 1 && Math.abs(at.y) < 1) continue;
      const sense = at.z < 1 ? 1 : -1; // behind the camera places are mirrored
      const reach = Math.max(Math.abs(at.x), Math.abs(at.y), 1e-9);
      const [x, y] = [(sense * at.x) / reach, (-sense * at.y) / reach];
      const [across, down] = [0.5 * width + x * (0.5 * width - 70 * u), 0.5 * height + y * (0.5 * height - 40 * u)];
      const behind = order.get(flight) - order.get(this.lead);
      const text = gate && Number.isFinite(behind) ? this.say("at", this.number(behind, 3, signed), gate) : "";
      const box = this.clearOf([across - 60 * u, down - 24 * u, 120 * u, 48 * u], height);
      if (box !== null) this.marker(box, flight, text, Math.atan2(y * height, x * width));
    }
  }

  /** A box of this size, pushed down or up from the panels that it would lie on; null where there is no room. */
  clearOf([left, top, wide, high], height) {
    const room = 8 * this.unit;
    const free = (y) => y >= 0 && y + high <= height && !this.panels.some((panel) => overlap([left, y, wide, high], panel, 0));
    const tops = [top, ...this.panels.flatMap((panel) => [panel[1] + panel[3] + room, panel[1] - high - room])].filter(free);
    return tops.length ? [left, tops.reduce((best, y) => (Math.abs(y - top) < Math.abs(best - top) ? y : best)), wide, high] : null;
  }

  marker([left, top, wide, high], flight, text, angle) {
    const { context, unit: u } = this;
    this.panel(left, top, wide, high);
    context.save();
    context.translate(left + 16 * u, top + 0.5 * high);
    context.rotate(angle);
    context.fillStyle = flight.colour;
    context.beginPath();
    for (const [x, y] of [[12, 0], [-10, -7], [-5, 0], [-10, 7]]) context.lineTo(x * u, y * u);
    context.fill();
    context.restore();
    this.write(shortened(flight.label), left + 32 * u, top + (text ? 20 : 29) * u, 15, { weight: 650, within: wide - 38 * u });
    this.write(text, left + 32 * u, top + 38 * u, 14, { within: wide - 38 * u });
  }

  /** After a passing of whom television follows its time. */
  split(middle, bottom, time) {
    const followed = [{ flight: this.lead, from: 0 }, ...this.pursuits.filter(({ flight }) => flight.visible)];
    const splits = followed.flatMap(({ flight, from }) =>
      flight.passings.slice(1).filter((passing) => passing.time > from).map((passing) => ({ flight, passing })),
    );
    const last = splits.findLast(({ passing }) => passing.time <= time + 1e-3);
    if (!last) return;
    const { flight, passing } = last;
    const since = time - passing.time;
    const final = last === splits.at(-1);
    if (since > SHOWN && !final) return;
    const u = this.unit;
    const several = this.flights.length > 1;
    this.context.globalAlpha = final ? 1 : Math.min(1, since / FADE, (SHOWN - since) / FADE);
    const [wide, high] = [(several ? 330 : 200) * u, 50 * u];
    const [left, top] = [middle - 0.5 * wide, bottom - high];
    this.panel(left, top, wide, high);
    if (several) this.named(flight, left + 14 * u, top + 14 * u, 102 * u);
    this.write(passing === flight.passings.at(-1) ? this.say("finish") : passing.name, left + wide - 184 * u, top + 32 * u, 17, { colour: PALE, within: 68 * u });
    this.write(this.number(passing.time, 3), left + wide - 16 * u, top + 34 * u, 25, { weight: 700, align: "right" });
    this.context.globalAlpha = 1;
  }

  /** Speed, height and load factor of a flight at the lower right, and whose they are where there are several. */
  gauges(right, bottom, time, flight) {
    const u = this.unit;
    const [wide, high] = [330 * u, 74 * u];
    const [left, top] = [right - wide, bottom - high];
    const name = this.flights.length > 1 ? 24 * u : 0;
    this.panel(left, top - name, wide, high + name);
    if (name) this.named(flight, left + 14 * u, top - name + 9 * u, wide - 42 * u);
    const values = [
      ["V_I", this.units.speed, 0],
      ["height", this.units.length, 0],
      ["n_z", "g", 1],
    ];
    values.forEach(([name, unit, digits], i) => {
      const x = left + (i + 1) * 104 * u - 18 * u;
      this.write(this.number(flight.value(name, time), digits), x, top + 44 * u, 32, { weight: 700, align: "right" });
      this.write(unit, x + 6 * u, top + 44 * u, 15, { colour: PALE });
    });
    const load = flight.value("n_z", time);
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
    this.panels.push([left, top, wide, high]);
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

/** Pixels of a unit in which sizes are those of a picture of FULL, at least so many. */
function unitOf(width, height, least = 0) {
  return Math.max(Math.sqrt((width * height) / FULL), least);
}

/** From which passing to which one. */
function legName({ before, after }) {
  return `${before.name} → ${after.name}`;
}

/** A reason of a loss with at most so many of the facts that explain it. */
function reasonText({ cause, facts }, most = Infinity) {
  return facts.length ? `${cause} (${facts.slice(0, most).join(", ")})` : cause;
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

  /** Up to when a race is filmed, s: until all whom television follows have finished. */
  get end() {
    const { pursuits, finish } = this.graphics;
    return pursuits.at(-1)?.to ?? finish;
  }

  /** What follows the finish of several flights: `[{view, from, to, seconds}]`, instants of the race and how long they are shown. */
  get sequel() {
    const { swings, finish, flights } = this.graphics;
    const replays = swings.map(({ from, to, seconds }, number) => ({ view: `replay ${number + 1}`, from, to, seconds }));
    const result = { view: RESULT, from: finish, to: finish, seconds: RESULT_SHOWN };
    return flights.length > 1 ? [...replays, result] : [];
  }

  /**
   * The picture of an instant (s) as base64, so many pixels wide and high.
   *
   * @param type `jpeg` or `png`.
   * @param alone whether graphics are drawn alone, on nothing; else over the scene in the view of a name.
   */
  frame(time, name, width, height, type = "jpeg", alone = false) {
    const shown = this.scene.views.get(name);
    const view = alone ? { name, follows: true, swing: shown.swing } : shown;
    const covered = [0, name === RESULT ? (this.graphics.outcome().high + 2 * EDGE) * unitOf(width, height) : 0];
    const context = alone ? sized(this.sheet, width, height, 1) : this.drawn(time, view, width, height, covered, 1);
    this.graphics.draw(context, width, height, time, view, { whole: true });
    const size = NAMES * unitOf(width, height);
    if (!alone) writeLabels(context, this.scene.labels, view.camera, width, height, size, this.graphics.panels);
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
    this.scene.draw(width, height, 1, view, covered, thick, true);
    const context = sized(this.sheet, width, height, 1);
    this.scene.ground.drawOn(context, this.scene.renderer, width, height);
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
