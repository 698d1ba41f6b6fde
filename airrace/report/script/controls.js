// What is chosen over the scene: the view, the colour of the line, the size of the aircraft; legend, scale and north.

import { Vector3 } from "three";
import { extent, written } from "./numbers.js";
import { rangeOf, stops } from "./palette.js";

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
    scene.onDrawn = () => this.bearings();
    this.colour(0);
    this.look("orbit");
  }

  look(name) {
    this.scene.look(name);
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.view === name));
    this.element.dataset.view = name;
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
