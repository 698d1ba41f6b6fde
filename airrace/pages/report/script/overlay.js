// The live graphic: that of films, of a flight while it is flown, over nothing, or with `?key=00b140` over that colour.

import { Flight } from "./flight.js";
import { Graphics } from "./graphics.js";
import { sized } from "./scene.js";

const EVERY = 40; // ms between two pictures
const PATIENCE = 2000; // ms, for an answer of the server
const OLD = 2; // s without a state, from which on it is told
const VIEW = { name: "tv", follows: true };

/** The live flight as far as it is known: its next passings are made at no time. */
class LiveFlight extends Flight {
  constructor(live, { race_time, passings, values }) {
    const made = passings.map((passing) => ({ ...passing, time: passing.time ?? Infinity }));
    super({ ...live, race_time, passings: made }, 0);
    this.duration = race_time ?? Infinity;
    this.values = values;
  }

  value(name) {
    return this.values[name] ?? NaN;
  }
}

class Overlay {
  constructor(contents, canvas) {
    Object.assign(this, { contents, canvas, shown: null, received: 0 });
    this.beside = contents.flights.map((flight, i) => new Flight(flight, i + 1));
  }

  /** Ask for the state and draw it, again and again; while there is none, what is known stays, and gets old. */
  async run() {
    for (;;) {
      try {
        const answer = await fetch("state", { cache: "no-store", signal: AbortSignal.timeout(PATIENCE) });
        this.take(await answer.json());
      } catch (reason) {
        console.info(`no state: ${reason.message}`);
      }
      if (this.shown) this.draw();
      await new Promise((done) => setTimeout(done, EVERY));
    }
  }

  /** A server that was started anew knows nothing of the flight in the air: what is shown stays until the next start. */
  take(state) {
    if (state.page !== this.contents.page) window.location.reload();
    if (state.clock === null && this.shown && this.shown.clock !== null) return;
    Object.assign(this, { shown: state, received: performance.now() });
  }

  draw() {
    const { contents, canvas, shown } = this;
    const [width, height] = [window.innerWidth, window.innerHeight];
    const context = sized(canvas, width, height, window.devicePixelRatio);
    const live = new LiveFlight(contents.live, shown);
    const graphics = new Graphics([live, ...this.beside], contents.title, contents.units, contents.broadcast, []);
    graphics.draw(context, width, height, shown.clock ?? 0, VIEW, { whole: true });
    const age = shown.age + (performance.now() - this.received) / 1000;
    if (age > OLD && live.raceTime === null) tellAge(graphics, width, age);
  }
}

/** Mark in the upper right corner that nothing has been heard for some seconds. */
function tellAge(graphics, width, age) {
  const u = graphics.unit;
  const [left, top, wide, high] = [width - 246 * u, 26 * u, 220 * u, 40 * u];
  graphics.panel(left, top, wide, high);
  graphics.write(graphics.say("silent"), left + 14 * u, top + 26 * u, 17, { weight: 700, colour: "#ffd166", within: 136 * u });
  graphics.write(`${graphics.number(age, 0)} s`, left + wide - 14 * u, top + 26 * u, 17, { align: "right", weight: 600 });
}

const key = new URLSearchParams(window.location.search).get("key") ?? "";
const canvas = document.querySelector("canvas");
if (/^[0-9a-f]{6}$/i.test(key)) {
  document.body.style.background = `#${key}`;
  canvas.style.filter = "url(#opaque)"; // nothing half transparent would take on the colour that is cut out
}
window.airrace = new Overlay(JSON.parse(document.getElementById("contents").textContent), canvas);
window.airrace.run();
