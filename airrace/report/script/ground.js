// The ground: a plain with a grid in metres, where north is, and the sky above it.

import {
  BackSide,
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  Color,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  Shape,
  ShapeGeometry,
  SphereGeometry,
} from "three";
import { roundStep } from "./numbers.js";
import { themed } from "./palette.js";

export const FAR = 9000; // m, the radius of sky and ground
const LINES = 14; // of the grid, about, along the longer side of the course

/** Sky, ground and grid around a box in the scene; `step` is the grid's, in metres, and `restyle()` repaints. */
export function groundOf(box) {
  const group = new Group();
  const sky = new Mesh(new SphereGeometry(FAR, 24, 16), new MeshBasicMaterial({ vertexColors: true, side: BackSide }));
  const plain = flatPlain();
  const extent = Math.max(box.max.x - box.min.x, box.max.z - box.min.z, 200);
  const step = roundStep(extent / LINES);
  const fine = grid(box, step, extent, false);
  const bold = grid(box, 5 * step, extent, true);
  const arrow = northArrow(box, extent);
  group.add(sky, plain, fine, bold, arrow);
  group.step = step;
  group.arrow = arrow;
  group.restyle = () => {
    paintSky(sky);
    plain.material.color.set(themed("ground"));
    fine.material.color.set(themed("grid"));
    bold.material.color.set(themed("grid-bold"));
    arrow.material.color.set(themed("muted"));
  };
  return group;
}

function flatPlain() {
  const plain = new Mesh(new CircleGeometry(FAR * 0.995, 64), new MeshBasicMaterial({ depthWrite: false }));
  plain.rotation.x = -Math.PI / 2;
  plain.renderOrder = -20;
  return plain;
}

/** From the horizon, where the ground's haze is, to the zenith. */
function paintSky(sky) {
  const [low, high] = [new Color(themed("horizon")), new Color(themed("zenith"))];
  const places = sky.geometry.getAttribute("position");
  const tints = new Float32Array(3 * places.count);
  const mixed = new Color();
  for (let i = 0; i < places.count; i += 1) {
    const up = Math.max(places.getY(i) / FAR, 0);
    mixed.copy(low).lerp(high, Math.min(1, 1.6 * up)).toArray(tints, 3 * i);
  }
  sky.geometry.setAttribute("color", new BufferAttribute(tints, 3));
  sky.renderOrder = -30;
  sky.material.depthWrite = false;
}

function grid(box, step, extent, bold) {
  const beyond = bold ? 2.0 : 0.6;
  const begin = (least) => Math.floor((least - beyond * extent) / step) * step;
  const end = (largest) => Math.ceil((largest + beyond * extent) / step) * step;
  const [west, east] = [begin(box.min.x), end(box.max.x)];
  const [north, south] = [begin(box.min.z), end(box.max.z)];
  const places = [];
  // In pieces, for some renderers lose a line that begins far behind the eye.
  for (let x = west; x <= east + 1e-6; x += step)
    for (let z = north; z < south - 1e-6; z += step) places.push(x, 0, z, x, 0, z + step);
  for (let z = north; z <= south + 1e-6; z += step)
    for (let x = west; x < east - 1e-6; x += step) places.push(x, 0, z, x + step, 0, z);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ depthWrite: false }));
  lines.renderOrder = bold ? -18 : -19;
  return lines;
}

/** A broad arrow on the ground, in the north-west of the course. */
function northArrow(box, extent) {
  const size = 0.05 * extent;
  const shape = new Shape();
  shape.moveTo(0, size);
  shape.lineTo(0.42 * size, -0.55 * size);
  shape.lineTo(0, -0.25 * size);
  shape.lineTo(-0.42 * size, -0.55 * size);
  shape.closePath();
  const arrow = new Mesh(new ShapeGeometry(shape), new MeshBasicMaterial({ depthWrite: false }));
  arrow.rotation.x = -Math.PI / 2;
  arrow.position.set(box.min.x - 0.1 * extent, 0, box.min.z - 0.1 * extent + size);
  arrow.renderOrder = -17;
  return arrow;
}
