// Names in the scene: plain text over the picture, hidden where they would lie on one another.

import { Vector3 } from "three";

const LONGEST = 40; // letters

/** Labels over a scene; `show(camera, width, height)` puts them where their places are seen. */
export function labelsOver(element, labels) {
  const shown = labels.filter((label) => label.text).map((label) => ({ ...label, span: named(element, label) }));
  const place = new Vector3();
  return (camera, width, height) => {
    const taken = [];
    for (const { span, place: where, kind } of shown) {
      place.copy(where).project(camera);
      const across = 0.5 * (place.x + 1) * width;
      const down = 0.5 * (1 - place.y) * height;
      const seen = place.z > -1 && place.z < 1 && across > 0 && across < width && down > 8 && down < height;
      const box = [across - 0.5 * span.offsetWidth, down - span.offsetHeight, span.offsetWidth, span.offsetHeight];
      const free = seen && (kind === "flight" || !taken.some((other) => overlap(box, other)));
      span.classList.toggle("hidden", !free);
      if (!free) continue;
      taken.push(box);
      span.style.transform = `translate(${box[0].toFixed(1)}px, ${(box[1] - 3).toFixed(1)}px)`;
    }
  };
}

function named(element, { text, kind }) {
  const span = document.createElement("span");
  span.className = `label ${kind}`;
  span.textContent = text.length > LONGEST ? `${text.slice(0, LONGEST)}…` : text;
  element.append(span);
  return span;
}

function overlap(a, b) {
  return a[0] < b[0] + b[2] && b[0] < a[0] + a[2] && a[1] < b[1] + b[3] && b[1] < a[1] + a[3];
}
