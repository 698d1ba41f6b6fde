// On paper there is nothing to play: pictures of three views stand in for the scene, in light colours.

import { written } from "./numbers.js";

const PICTURES = [
  ["above", 540, 390],
  ["orbit", 540, 390],
  ["side", 1080, 260],
];
const WIDTH = 700; // pixels: what a page takes between its margins

/** Make the page ready before it is printed, and put it back afterwards. */
export function watchPrinting(element, scene, controls, strips, clock, forceTheme) {
  window.addEventListener("beforeprint", () => {
    clock.stop();
    forceTheme("light");
    if (scene !== null)
      element.replaceChildren(...PICTURES.map((one) => pictured(scene, ...one, clock.time)), keyOf(controls));
    document.documentElement.classList.add("printing");
    strips.resize(WIDTH, 2);
  });
  window.addEventListener("afterprint", () => {
    document.documentElement.classList.remove("printing");
    element.replaceChildren();
    forceTheme(null);
    strips.resize();
    scene?.invalidate();
  });
}

function pictured(scene, name, width, height, time) {
  const figure = document.createElement("figure");
  const image = document.createElement("img");
  image.src = scene.picture(name, width, height);
  image.alt = "";
  const caption = document.createElement("figcaption");
  caption.textContent = `${name}, ${scene.scaleOf(name, width)}; the aircraft at ${written(time, 2)} s`;
  figure.className = name;
  figure.append(image, caption);
  return figure;
}

/** What the colours of the line mean. */
function keyOf(controls) {
  const key = document.createElement("p");
  const ramp = document.createElement("i");
  ramp.style.background = controls.ramp;
  key.className = "key";
  const [before, behind] = controls.legend;
  key.append(before, ramp, behind);
  return key;
}
