// What is chosen over the scene by buttons, and by fingers, mouse and wheel: view, colour, size, turn, move, zoom.

import { Vector3 } from "three";
import { extent, rangeOf, stops, written } from "./values.js";

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
    const metres = this.scene.scaleBar(BAR);
    const bar = this.element.querySelector(".scalebar");
    const text = metres === null ? `grid ${this.scene.ground.step} m` : `${metres} m`;
    bar.querySelector("span").textContent = text;
    bar.querySelector("i").style.width = metres === null ? "0" : `${(metres / this.scene.pixel).toFixed(1)}px`;
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
