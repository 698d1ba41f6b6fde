// The way of a flight: lines as wide wherever they are looked at from, and a ribbon as wide as its wings.

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Group,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  ShaderMaterial,
  Vector2,
  Vector3,
} from "three";
import { extent } from "./numbers.js";
import { colourOf, ghostColour, rangeOf, themed } from "./palette.js";

const RIB_EVERY = 1; // s, between the lines across the ribbon that show its bank

/** The way of a flight as a group with `fit(width, height)`, `colour(scale)`, `wings(shown)` and `restyle()`. */
export function ribbonOf(flight) {
  const group = new Group();
  const centre = Array.from({ length: flight.count }, (_, i) => flight.positionOf(i));
  const middle = line(centre, { width: flight.number === 0 ? 3 : 2, opacity: flight.number === 0 ? 1 : 0.85 });
  const shadow = line(centre.map((place) => new Vector3(place.x, 0, place.z)), { width: 1.5, opacity: 0.3 });
  shadow.material.depthWrite = false;
  shadow.renderOrder = -5;
  group.add(shadow, middle);
  group.fit = (across, down) => [middle, shadow].forEach((one) => one.fit(across, down));
  group.restyle = () => {
    shadow.paintAll(themed("shadow"));
    if (flight.number > 0) middle.paintAll(ghostColour(flight.number));
  };
  if (flight.number > 0) {
    group.colour = () => {};
    group.wings = () => {};
    return group;
  }
  const [left, right] = wingTips(flight, centre);
  const wings = surface(left, right);
  const ribs = acrossTheWay(flight, left, right);
  group.add(wings, ...ribs);
  group.fit = (across, down) => [middle, shadow, ...ribs].forEach((one) => one.fit(across, down));
  group.wings = (shown) => {
    wings.visible = shown;
  };
  group.colour = (scale) => {
    const values = flight.history(scale.history) ?? new Float32Array(flight.count);
    const colour = colourOf(scale, rangeOf(scale, extent(values)));
    middle.paint((i) => colour(values[i]));
    wings.paint((i) => colour(values[i]));
    for (const rib of ribs) rib.paintAll(colour(values[rib.sample]));
  };
  return group;
}

/** Where the wing tips were, sample by sample. */
function wingTips(flight, centre) {
  const wing = new Vector3();
  const attitude = new Quaternion();
  const half = flight.aircraft.span / 2;
  const tip = (side) =>
    centre.map((place, i) => {
      wing.set(0, side * half, 0).applyQuaternion(flight.attitudeOf(i, attitude));
      return place.clone().add(wing);
    });
  return [tip(-1), tip(1)];
}

/** The surface between two lines of as many points. */
function surface(left, right) {
  const count = left.length;
  const places = new Float32Array(6 * count);
  const index = [];
  for (let i = 0; i < count; i += 1) {
    left[i].toArray(places, 6 * i);
    right[i].toArray(places, 6 * i + 3);
    if (i > 0) index.push(2 * i - 2, 2 * i - 1, 2 * i, 2 * i - 1, 2 * i + 1, 2 * i);
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(places, 3));
  geometry.setAttribute("color", new BufferAttribute(new Float32Array(6 * count), 3));
  geometry.setIndex(index);
  const look = { vertexColors: true, side: DoubleSide, transparent: true, opacity: 0.42, depthWrite: false };
  const mesh = new Mesh(geometry, new MeshBasicMaterial(look));
  mesh.frustumCulled = false;
  mesh.paint = (colour) => paintPairs(geometry.getAttribute("color"), colour);
  return mesh;
}

/** A line from tip to tip at every full second. */
function acrossTheWay(flight, left, right) {
  const ribs = [];
  for (let time = RIB_EVERY; time < flight.duration; time += RIB_EVERY) {
    const [i] = flight.at(time);
    const rib = line([left[i], right[i]], { width: 1.5 });
    rib.sample = i;
    ribs.push(rib);
  }
  return ribs;
}

const VERTEX = `
attribute vec3 before;
attribute vec3 after;
attribute float side;
attribute vec3 tint;
uniform vec2 size;
uniform float width;
varying vec3 shade;

vec2 onScreen(vec4 place) { return place.xy / max(place.w, 1e-4) * size; }

void main() {
  vec4 here = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  vec4 from = projectionMatrix * modelViewMatrix * vec4(before, 1.0);
  vec4 to = projectionMatrix * modelViewMatrix * vec4(after, 1.0);
  vec2 along = onScreen(to) - onScreen(from);
  float stretch = length(along);
  vec2 across = stretch > 1e-3 ? vec2(-along.y, along.x) / stretch : vec2(0.0, 1.0);
  // Behind the eye a projection means nothing.
  if (here.w > 0.1 && from.w > 0.1 && to.w > 0.1) here.xy += across * side * width / size * here.w;
  gl_Position = here;
  shade = tint;
}`;

const FRAGMENT = `
uniform float opacity;
varying vec3 shade;
void main() {
  gl_FragColor = vec4(shade, opacity);
  #include <colorspace_fragment>
}`;

/** Give every point of a band, which has two vertices, its colour; `colour(i)` is the Color of point i. */
export function paintPairs(attribute, colour) {
  for (let i = 0; 2 * i < attribute.count; i += 1) {
    const { r, g, b } = colour(i);
    attribute.setXYZ(2 * i, r, g, b);
    attribute.setXYZ(2 * i + 1, r, g, b);
  }
  attribute.needsUpdate = true;
}

/**
 * A line through points of the scene.
 *
 * @param points an array of Vector3.
 * @param width in pixels.
 * @param opacity from 0 to 1.
 * @returns a mesh with `paint(colour)`, where `colour(i)` is the Color of point i, and `fit(width, height)` in pixels.
 */
export function line(points, { width = 3, opacity = 1 } = {}) {
  const count = points.length;
  const buffers = { position: 3, before: 3, after: 3, side: 1, tint: 3 };
  const arrays = Object.fromEntries(Object.entries(buffers).map(([name, n]) => [name, new Float32Array(2 * count * n)]));
  for (let i = 0; i < count; i += 1) {
    for (let half = 0; half < 2; half += 1) {
      const vertex = 2 * i + half;
      points[i].toArray(arrays.position, 3 * vertex);
      points[Math.max(i - 1, 0)].toArray(arrays.before, 3 * vertex);
      points[Math.min(i + 1, count - 1)].toArray(arrays.after, 3 * vertex);
      arrays.side[vertex] = half === 0 ? -1 : 1;
    }
  }
  const index = [];
  for (let i = 0; i + 1 < count; i += 1) index.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2);
  const geometry = new BufferGeometry();
  for (const [name, n] of Object.entries(buffers)) geometry.setAttribute(name, new BufferAttribute(arrays[name], n));
  geometry.setIndex(index);
  const uniforms = { size: { value: new Vector2(1, 1) }, width: { value: width }, opacity: { value: opacity } };
  const material = new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms,
    side: DoubleSide,
    transparent: opacity < 1,
    depthWrite: opacity >= 1,
  });
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.fit = (across, down) => uniforms.size.value.set(across, down);
  mesh.paint = (colour) => paintPairs(geometry.getAttribute("tint"), colour);
  mesh.paintAll = (colour) => {
    const one = new Color(colour);
    mesh.paint(() => one);
  };
  return mesh;
}
