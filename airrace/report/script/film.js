// Pictures of the scene alone, for films and cards: the page is asked for one instant after the other.

import { writeLabels } from "./labels.js";
import { sized } from "./scene.js";

const NAMES = 15; // pixels high, in a picture of FULL
const FULL = 1280 * 720;
const THICK = 2.2; // of the line on a card, against that of the page
const VERDICTS = { good: "#57e389", bad: "#ff7b6b", unsure: "#c7d4df" }; // colours, by the badge of the page
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
    return this.sheet.toDataURL("image/jpeg", QUALITY).split(",")[1];
  }

  /** The card of the first flight as base64 of a PNG: its line over the course, and what the head of the page tells. */
  card(width, height) {
    const { actors, views } = this.scene;
    const view = views.get("orbit");
    view.home();
    Object.assign(view, CARD);
    actors.forEach(({ flight }) => Object.assign(flight, { visible: flight.number === 0 }));
    this.scene.enlarged = ENLARGED;
    const context = this.drawn(CARD_SHARE * actors[0].flight.duration, view, width, height, [110, 165], THICK);
    this.head(context, width, height);
    return this.sheet.toDataURL("image/png").split(",")[1];
  }

  drawn(time, view, width, height, covered, thick) {
    this.clock.time = time;
    this.scene.draw(width, height, 1, view, covered, thick, false);
    const context = sized(this.sheet, width, height, 1);
    context.drawImage(this.scene.canvas, 0, 0, width, height);
    return context;
  }

  head(context, width, height) {
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
    write(text("h1"), 48, height - 84, 58, 700, "#ffffff", "left", 760);
    write(text(".mast p"), 50, height - 42, 25, 500, "#c7d4df", "left", 800);
    write(text(".race-time").replace(/ ?s$/, " s"), width - 48, height - 72, 78, 750, "#ffffff", "right", 330);
    const verdict = document.querySelector(".verdict");
    const colour = Object.entries(VERDICTS).find(([name]) => verdict.classList.contains(name))[1];
    write(verdict.dataset.state, width - 50, height - 40, 22, 600, colour, "right", 330);
  }
}
