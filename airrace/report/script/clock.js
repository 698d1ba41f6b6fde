// The one clock of the page, and what leads and follows it: buttons, a slider, keys, and the tables.

import { written } from "./values.js";

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
