// Names in the scene: plain text over the picture, hidden where they would lie on one another.

import { Vector3 } from "three";
import { themed } from "./palette.js";

const LONGEST = 40; // letters
const TAG_INK = "#0b1620"; // of names of aircraft, likewise in the style sheet
const INK = { crowd: "limit", line: "caution", north: "muted" };

/** Labels over a scene; the function that is returned puts them where their places are seen by a camera. */
export function labelsOver(element, labels) {
  const shown = labels.filter((label) => label.text).map((label) => Object.assign(label, { span: named(element, label) }));
  return (camera, width, height) => {
    const boxes = arranged(shown, camera, width, height, ({ span }) => [span.offsetWidth, span.offsetHeight]);
    shown.forEach(({ span }, i) => {
      span.classList.toggle("hidden", boxes[i] === null);
      if (boxes[i]) span.style.transform = `translate(${boxes[i][0].toFixed(1)}px, ${boxes[i][1].toFixed(1)}px)`;
    });
  };
}

/** The same written into a drawing, so many pixels high. */
export function writeLabels(context, labels, camera, width, height, size = 13) {
  context.font = `600 ${size}px ${getComputedStyle(document.body).fontFamily}`;
  context.textBaseline = "top";
  context.textAlign = "left";
  const shown = labels.filter((label) => label.text);
  const sizeOf = ({ text }) => [context.measureText(shortened(text)).width + 0.6 * size, 1.4 * size];
  const boxes = arranged(shown, camera, width, height, sizeOf);
  shown.forEach(({ text, kind, colour }, i) => {
    if (boxes[i] === null) return;
    const [left, top, across, down] = boxes[i];
    context.fillStyle = colour ?? themed("label");
    context.fillRect(left, top, across, down);
    context.fillStyle = colour ? TAG_INK : themed(INK[kind] ?? "ink");
    context.fillText(shortened(text), left + 0.3 * size, top + 0.22 * size);
  });
}

/**
 * Left, top, width and height of every label above its place; null where it is not seen or would lie on another.
 *
 * Names of aircraft come first, and move out of one another's way; one is `hidden()` while its aircraft is.
 */
function arranged(labels, camera, width, height, sizeOf) {
  const place = new Vector3();
  const taken = [];
  const boxes = labels.map(() => null);
  const order = [...labels.keys()].sort((a, b) => Number(labels[b].kind === "tag") - Number(labels[a].kind === "tag") || a - b);
  for (const i of order) {
    const label = labels[i];
    if (label.hidden?.()) continue;
    place.copy(label.place).project(camera);
    const [across, down] = [0.5 * (place.x + 1) * width, 0.5 * (1 - place.y) * height];
    const seen = place.z > -1 && place.z < 1 && across > 0 && across < width && down > 8 && down < height;
    if (!seen) continue;
    const [wide, high] = sizeOf(label);
    const lift = label.kind === "tag" ? 1.5 * high : 0;
    const rows = label.kind === "tag" ? [0, 1, 2, -4, 3, -5] : [0];
    const left = Math.min(Math.max(across - 0.5 * wide, 2), width - wide - 2);
    const tried = rows.map((row) => [left, down - high - 3 - lift - row * (high + 2), wide, high]);
    const free = tried.find((box) => !taken.some((other) => overlap(box, other)));
    if (!free) continue;
    taken.push(free);
    boxes[i] = free;
  }
  return boxes;
}

function named(element, { text, kind, colour }) {
  const span = document.createElement("span");
  span.className = `label ${kind}`;
  span.textContent = shortened(text);
  if (colour) span.style.background = colour;
  element.append(span);
  return span;
}

function shortened(text) {
  return text.length > LONGEST ? `${text.slice(0, LONGEST)}…` : text;
}

function overlap(a, b) {
  return a[0] < b[0] + b[2] && b[0] < a[0] + a[2] && a[1] < b[1] + b[3] && b[1] < a[1] + a[3];
}
