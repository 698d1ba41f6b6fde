// On paper there is nothing to play: pictures of four views stand in for the scene, in light colours.

import { written } from "./numbers.js";

const VIEWS = ["above", "orbit", "side", "chase"];
const WIDTH = 690; // pixels: what a page takes between its margins

/** Make the page ready before it is printed, and put it back afterwards. */
export function watchPrinting(element, scene, strips, clock, forceTheme) {
  window.addEventListener("beforeprint", () => {
    clock.stop();
    forceTheme("light");
    if (scene !== null) element.replaceChildren(...VIEWS.map((name) => pictured(scene, name, clock.time)));
    document.documentElement.classList.add("printing");
    strips.resize(WIDTH);
  });
  window.addEventListener("afterprint", () => {
    document.documentElement.classList.remove("printing");
    element.replaceChildren();
    forceTheme(null);
    strips.resize();
    scene?.invalidate();
  });
}

function pictured(scene, name, time) {
  const figure = document.createElement("figure");
  const image = document.createElement("img");
  image.src = scene.picture(name, 900, name === "side" ? 340 : 560);
  image.alt = "";
  const caption = document.createElement("figcaption");
  caption.textContent = name === "chase" ? `${name}, at ${written(time, 2)} s` : name;
  figure.className = name;
  figure.append(image, caption);
  return figure;
}
