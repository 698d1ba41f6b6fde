// Names in the scene: plain text over the picture, hidden where they would lie on one another.

import { Vector3 } from "three";
import { themed } from "./palette.js";

const LONGEST = 40; // letters
const INK = { crowd: "limit", line: "caution", north: "muted" };

/** Labels over a scene; the function that is returned puts them where their places are seen by a camera. */
export function labelsOver(element, labels) {
  const shown = labels.filter((label) => label.text).map((label) => ({ ...label, span: named(element, label) }));
  return (camera, width, height) => {
    const boxes = arranged(shown, camera, width, height, ({ span }) => [span.offsetWidth, span.offsetHeight]);
    shown.forEach(({ span }, i) => {
      span.classList.toggle("hidden", boxes[i] === null);
      if (boxes[i]) span.style.transform = `translate(${boxes[i][0].toFixed(1)}px, ${boxes[i][1].toFixed(1)}px)`;
    });
  };
}

/** The same written into a drawing. */
export function writeLabels(context, labels, camera, width, height) {
  context.font = `600 13px ${getComputedStyle(document.body).fontFamily}`;
  context.textBaseline = "top";
  const shown = labels.filter((label) => label.text).map((label) => ({ ...label, text: shortened(label.text) }));
  const boxes = arranged(shown, camera, width, height, ({ text }) => [context.measureText(text).width + 8, 18]);
  shown.forEach(({ text, kind }, i) => {
    if (boxes[i] === null) return;
    const [left, top, across, down] = boxes[i];
    context.fillStyle = themed("label");
    context.fillRect(left, top, across, down);
    context.fillStyle = themed(INK[kind] ?? "ink");
    context.fillText(text, left + 4, top + 3);
  });
}

/** Left, top, width and height of every label above its place; null where it is not seen or would lie on another. */
function arranged(labels, camera, width, height, sizeOf) {
  const place = new Vector3();
  const taken = [];
  return labels.map((label) => {
    place.copy(label.place).project(camera);
    const [across, down] = [0.5 * (place.x + 1) * width, 0.5 * (1 - place.y) * height];
    const seen = place.z > -1 && place.z < 1 && across > 0 && across < width && down > 8 && down < height;
    const [wide, high] = sizeOf(label);
    const box = [across - 0.5 * wide, down - high - 3, wide, high];
    if (!seen || taken.some((other) => overlap(box, other))) return null;
    taken.push(box);
    return box;
  });
}

function named(element, { text, kind }) {
  const span = document.createElement("span");
  span.className = `label ${kind}`;
  span.textContent = shortened(text);
  element.append(span);
  return span;
}

function shortened(text) {
  return text.length > LONGEST ? `${text.slice(0, LONGEST)}…` : text;
}

function overlap(a, b) {
  return a[0] < b[0] + b[2] && b[0] < a[0] + a[2] && a[1] < b[1] + b[3] && b[1] < a[1] + a[3];
}
