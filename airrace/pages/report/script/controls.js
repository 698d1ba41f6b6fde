// The controls of the page: its one clock, with what leads and follows it (buttons, a slider, keys and the tables); and what
// is chosen over the scene by buttons, fingers, mouse and wheel: view, colour, size, turn, move, zoom.

import { Vector3 } from "three";
import { extent, rangeOf, stops, written } from "./values.js";

export class Clock {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.rate = 1;
    this.running = false;
    this.listeners = [];
    this.last = 0;
  }

  /** Call back whenever the time, the rate or whether it runs has changed. */
  watch(listener) {
    this.listeners.push(listener);
  }

  set(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    if (this.time >= this.duration) this.running = false;
    this.tell();
  }

  setRate(rate) {
    this.rate = rate;
    this.tell();
  }

  toggle() {
    if (this.running) {
      this.running = false;
      this.tell();
      return;
    }
    if (this.time >= this.duration) this.time = 0;
    this.running = true;
    this.last = performance.now();
    requestAnimationFrame((now) => this.step(now));
    this.tell();
  }

  stop() {
    this.running = false;
    this.tell();
  }

  step(now) {
    if (!this.running) return;
    // A frame that came late (a hidden tab, say) must not make the aircraft jump.
    const elapsed = Math.min(Math.max(now - this.last, 0) / 1000, 0.25);
    this.last = now;
    this.set(this.time + elapsed * this.rate);
    if (this.running) requestAnimationFrame((later) => this.step(later));
  }

  tell() {
    for (const listener of this.listeners) listener(this.time);
  }
}

const AROUND = 0.4; // s before and after a leg that is shown alone
const SHORTEST = 0.5; // s that are shown at least

/** The stretch of the race that strips, maps and scene show, by the clock: all of it, the present leg, or any other. */
export class Stretch {
  constructor(clock, lead) {
    Object.assign(this, { clock, lead, kind: "race", leg: -1, from: 0, to: clock.duration, listeners: [] });
    clock.watch(() => this.follow());
  }

  /** Call back whenever another stretch is shown. */
  watch(listener) {
    this.listeners.push(listener);
  }

  /** Show `race`, or `leg`: the present one. */
  show(kind) {
    this.kind = kind;
    this.leg = kind === "leg" ? this.lead.leg(this.clock.time) : -1;
    if (this.leg < 0) this.set(0, this.clock.duration);
    else {
      const { passings } = this.lead;
      const [from, to] = [this.leg, Math.min(this.leg + 1, passings.length - 1)].map((number) => passings[number].time);
      this.set(from - AROUND, Math.max(to, from) + AROUND);
    }
  }

  /** Show a stretch so many times as long, in which an instant keeps its place. */
  zoom(factor, around = this.clock.time) {
    const length = Math.min(Math.max((this.to - this.from) * factor, SHORTEST), this.clock.duration);
    const share = (around - this.from) / (this.to - this.from);
    this.kind = length < this.clock.duration ? "free" : "race";
    const from = Math.min(Math.max(around - share * length, 0), this.clock.duration - length);
    this.set(from, from + length);
  }

  set(from, to) {
    this.from = Math.max(from, 0);
    this.to = Math.min(to, this.clock.duration);
    for (const listener of this.listeners) listener();
  }

  /** Keep the present instant in what is shown. */
  follow() {
    const { time } = this.clock;
    if (this.kind === "leg" && this.lead.leg(time) !== this.leg) this.show("leg");
    if (this.kind !== "free" || (time >= this.from && time <= this.to)) return;
    const length = this.to - this.from;
    const from = Math.min(Math.max(time < this.from ? time : time - length, 0), this.clock.duration - length);
    this.set(from, from + length);
  }
}

const STEP = 0.1; // s, of an arrow key
const LEAP = 1; // s, with Shift

export class Transport {
  constructor(element, flight, clock) {
    this.clock = clock;
    this.flight = flight;
    this.button = element.querySelector("[data-play]");
    this.slider = element.querySelector("input[type=range]");
    this.reading = element.querySelector(".time");
    this.slider.max = clock.duration;
    this.button.addEventListener("click", () => clock.toggle());
    this.slider.addEventListener("input", () => clock.set(this.slider.valueAsNumber));
    const rates = element.querySelector("select");
    rates.addEventListener("change", () => clock.setRate(Number(rates.value)));
    for (const one of element.querySelectorAll("[data-gate]"))
      one.addEventListener("click", () => this.toGate(Number(one.dataset.gate)));
    this.ticks(element.querySelector(".ticks"));
    clock.watch((time) => this.show(time));
    this.show(clock.time);
  }

  /** A mark under the slider for every gate. */
  ticks(element) {
    for (const { time } of this.flight.passings) {
      const tick = document.createElement("i");
      tick.style.left = `${(100 * time) / this.clock.duration}%`;
      element.append(tick);
    }
  }

  show(time) {
    this.slider.value = time;
    this.slider.setAttribute("aria-valuetext", `${written(time, 2)} s`);
    this.reading.textContent = written(time, 2);
    this.button.classList.toggle("running", this.clock.running);
    this.button.setAttribute("aria-label", this.clock.running ? "Stop" : "Play");
  }

  /** To the passing before (-1) or after (1) the present instant. */
  toGate(sense) {
    const times = this.flight.passings.map(({ time }) => time);
    const { time } = this.clock;
    const next = sense > 0 ? times.find((one) => one > time + 1e-3) : times.filter((one) => one < time - 1e-3).pop();
    this.clock.set(next ?? (sense > 0 ? this.clock.duration : 0));
  }

  /** What a key does; whether it did anything. */
  key(event) {
    const step = event.shiftKey ? LEAP : STEP;
    const deeds = {
      " ": () => this.clock.toggle(),
      ArrowLeft: () => this.clock.set(this.clock.time - step),
      ArrowRight: () => this.clock.set(this.clock.time + step),
      ArrowUp: () => this.toGate(-1),
      ArrowDown: () => this.toGate(1),
      Home: () => this.clock.set(0),
      End: () => this.clock.set(this.clock.duration),
      f: () => document.querySelector("[data-full]").click(),
    };
    const deed = deeds[event.key];
    deed?.();
    return deed !== undefined;
  }
}

/** Watch the keyboard, with a digit for every view; what is typed into a field, and what the browser itself does with a key, is left alone. */
export function watchKeys(transport, viewButtons) {
  // A button that a finger or the mouse has pressed does not keep the keys: the space bar plays, and presses it no more.
  document.addEventListener("click", (event) => {
    if (event.detail > 0) event.target.closest("button")?.blur();
  });
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.defaultPrevented) return;
    const { target } = event;
    const typing = target.matches("select, textarea, input:not([type=range]):not([type=checkbox])");
    const pressed = event.key === " " && target.matches("button, summary, input[type=checkbox]");
    if (typing || pressed) return;
    // Up and down move the page unless the scene or the slider has been chosen.
    const vertical = event.key === "ArrowUp" || event.key === "ArrowDown";
    if (vertical && !target.matches("canvas, input[type=range]")) return;
    const view = viewButtons[Number(event.key) - 1];
    if (view) view.click();
    else if (!transport.key(event)) return;
    event.preventDefault();
  });
}

/** Let the tables follow the clock and lead it. */
export function linkTables(element, flight, clock) {
  const rows = [...element.querySelectorAll("tr[data-passing]")];
  for (const button of element.querySelectorAll("button[data-time]"))
    button.addEventListener("click", () => {
      clock.stop();
      clock.set(Number(button.dataset.time));
    });
  const mark = (time) => {
    const leg = flight.leg(time);
    for (const row of rows) {
      const here = Number(row.dataset.passing) === leg;
      if (here) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
  };
  clock.watch(mark);
  mark(clock.time);
}

/** Boxes that show and hide flights. */
export function linkFlights(element, flights, changed) {
  for (const box of element.querySelectorAll("input[data-flight]"))
    box.addEventListener("change", () => {
      flights[Number(box.dataset.flight)].visible = box.checked;
      changed();
    });
}

/** Fill every element with `data-history` whenever the clock moves. */
export function showReadings(element, flight, clock) {
  const cells = [...element.querySelectorAll("[data-history]")];
  for (const cell of cells) cell.closest("div").hidden = !flight.history(cell.dataset.history);
  const show = (time) => {
    for (const cell of cells) {
      const { history, digits, wraps } = cell.dataset;
      cell.textContent = written(flight.value(history, time, Number(wraps ?? 0)), Number(digits ?? 0));
    }
  };
  clock.watch(show);
  show(clock.time);
}

/** What chooses the axis of the strips and the stretch that is shown, and tells which one is. */
export function linkStretch(element, stretch, strips) {
  const shown = element.querySelector("[data-window]");
  const axis = element.querySelector("[data-axis]");
  shown.addEventListener("change", () => stretch.show(shown.value));
  axis.addEventListener("change", () => strips.over(axis.value));
  for (const button of element.querySelectorAll("[data-zoom]"))
    button.addEventListener("click", () => stretch.zoom(Number(button.dataset.zoom)));
  stretch.watch(() => {
    shown.value = stretch.kind;
  });
}

const BAR = 110; // pixels, about, of the bar of the scale

export class Controls {
  constructor(element, scene, flight, scales) {
    this.scene = scene;
    this.flight = flight;
    this.scales = scales;
    this.element = element;
    this.buttons = [...element.querySelectorAll("[data-view]")];
    for (const button of this.buttons) button.addEventListener("click", () => this.look(button.dataset.view));
    this.select = element.querySelector("[data-colour]");
    scales.forEach((scale, i) => this.select.append(new Option(scale.title, i)));
    this.select.addEventListener("change", () => this.colour(Number(this.select.value)));
    const size = element.querySelector("[data-size]");
    size.addEventListener("change", () => scene.enlarge(Number(size.value)));
    const ground = element.querySelector("[data-ground]");
    ground.value = scene.ground.kind;
    ground.addEventListener("change", () => scene.flood(ground.value));
    scene.onDrawn = () => this.bearings();
    this.colour(0);
    this.look("orbit");
  }

  look(name) {
    this.scene.look(name);
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.view === name));
    this.element.dataset.view = name;
    this.element.toggleAttribute("data-follows", this.scene.view.follows === true);
  }

  colour(number) {
    const scale = this.scales[number];
    this.scene.colour(scale);
    const range = rangeOf(scale, extent(this.flight.history(scale.history) ?? []));
    const colours = stops(scale);
    this.ramp = `linear-gradient(to right, ${colours.join(", ")})`;
    this.element.querySelector(".ramp").style.background = this.ramp;
    const marks = [range[0], (range[0] + range[1]) / 2, range[1]].map((mark) => written(mark, scale.digits));
    this.element.querySelectorAll(".marks output").forEach((mark, i) => {
      mark.textContent = marks[i];
    });
    // What stands before the ramp and behind it, on paper.
    this.legend = [`${scale.title} from ${marks[0]}`, ` to ${marks[2]} ${scale.unit}`];
    this.element.querySelector(".marks i").textContent = scale.unit;
  }

  /** The bar of the scale where there is one, and the needle that points north. */
  bearings() {
    const { camera } = this.scene.view;
    const { length, per_m: perMetre } = this.scene.units;
    const round = this.scene.scaleBar(BAR);
    const bar = this.element.querySelector(".scalebar");
    const grid = `grid ${written(this.scene.ground.step * perMetre, 0)} ${length}`;
    bar.querySelector("span").textContent = round === null ? grid : `${round} ${length}`;
    bar.querySelector("i").style.width = round === null ? "0" : `${(round / perMetre / this.scene.pixel).toFixed(1)}px`;
    const north = new Vector3(0, 0, -1).transformDirection(camera.matrixWorldInverse);
    const needle = this.element.querySelector(".needle");
    // Seen along the ground, north is up where it lies ahead.
    const up = Math.abs(north.y) > 0.15 ? north.y : -north.z;
    needle.style.transform = `rotate(${((Math.atan2(north.x, up) * 180) / Math.PI).toFixed(1)}deg)`;
    needle.classList.toggle("hidden", Math.hypot(north.x, up) < 0.05);
  }
}

const WHEEL = 0.0012; // of the distance per unit of a wheel
const TAP = 6; // pixels within which a press is no drag

/**
 * Watch an element.
 *
 * @param wishes `turn(dx, dy)` and `move(dx, dy)` in pixels, `zoom(factor, x, y)`; one finger turns, two move and zoom.
 */
export function watchGestures(element, wishes) {
  const fingers = new Map();
  let spread = 0;
  let travelled = 0;

  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    spread = distance(fingers);
    travelled = 0;
  });

  element.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const step = [event.clientX - before[0], event.clientY - before[1]];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    travelled += Math.hypot(...step);
    if (travelled < TAP) return;
    if (fingers.size === 1) {
      const moves = event.shiftKey || (event.buttons & 6) !== 0;
      if (moves) wishes.move(...step);
      else wishes.turn(...step);
      return;
    }
    const now = distance(fingers);
    if (spread > 0 && now > 0) wishes.zoom(spread / now, event.clientX, event.clientY);
    spread = now;
    wishes.move(step[0] / fingers.size, step[1] / fingers.size);
  });

  for (const end of ["pointerup", "pointercancel"])
    element.addEventListener(end, (event) => {
      fingers.delete(event.pointerId);
      spread = distance(fingers);
    });

  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener(
    "wheel",
    (event) => {
      // Without a key the page scrolls, as everywhere; a trackpad's pinch comes with the key down.
      if (!event.ctrlKey && !event.metaKey && !element.matches(":focus")) return;
      event.preventDefault();
      const units = event.deltaMode === 1 ? 30 * event.deltaY : event.deltaY;
      wishes.zoom(Math.exp(units * WHEEL * (event.ctrlKey ? 5 : 1)), event.clientX, event.clientY);
    },
    { passive: false },
  );
}

function distance(fingers) {
  if (fingers.size < 2) return 0;
  const [a, b] = [...fingers.values()];
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
