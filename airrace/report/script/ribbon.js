// The way of a flight: lines as wide wherever they are looked at from, and a ribbon as wide as its wings.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, Group, Mesh, Quaternion, ShaderMaterial, Vector2, Vector3 } from "three";
import { extent } from "./numbers.js";
import { colourOf, rangeOf, tagColour, themed } from "./palette.js";

const NARROW = 0.36; // of the span: enough to show the bank, and little of what lies behind
const AROUND = { ahead: 1, near: 0 }; // of views in which all of the way is looked at
const ALONG = { ahead: 0.3, near: 45 }; // of those that follow the aircraft: dim ahead, and clear before the eye
const FINE = 0.03; // s between samples that are drawn
const TRAIL = 2.2; // s, over which the way behind the aircraft fades to what it is ahead

/** The way of a flight as a group with `show(time, view, width, height)`, `colour(scale)` and `restyle()`. */
export function ribbonOf(flight) {
  const group = new Group();
  const lead = flight.number === 0;
  const rows = rowsOf(flight);
  const centre = rows.map((i) => flight.positionOf(i));
  const sight = { now: { value: 0 }, ahead: { value: 1 }, near: { value: 0 } };
  const seen = { times: rows.map((i) => flight.time[i]), sight };
  const middle = line(centre, { ...seen, width: lead ? 2.6 : 1.8, opacity: lead ? 0.95 : 0.7 });
  const shadow = line(centre.map((place) => new Vector3(place.x, 0, place.z)), { ...seen, width: 1.5, opacity: 0.22 });
  shadow.renderOrder = -5;
  const wings = band(...wingTips(flight, rows, centre), seen);
  group.add(shadow, wings, middle);
  group.show = (time, view, width, height) => {
    for (const one of [middle, shadow]) one.fit(width, height);
    const look = view.follows ? ALONG : AROUND;
    Object.assign(sight.now, { value: time });
    sight.ahead.value = look.ahead * (lead || !view.follows ? 1 : 0.5);
    sight.near.value = look.near;
  };
  group.restyle = () => {
    shadow.paintAll(themed("shadow"));
    if (!lead) for (const one of [middle, wings]) one.paintAll(tagColour(flight.number));
  };
  group.colour = (scale) => {
    if (!lead) return;
    const values = flight.history(scale.history) ?? new Float32Array(flight.count);
    const colour = colourOf(scale, rangeOf(scale, extent(values)));
    for (const one of [middle, wings]) one.paint((i) => colour(values[rows[i]]));
  };
  return group;
}

/** The tube in which most closed-loop flights along a flight lie, as a group. */
export function envelopeOf(flight) {
  const { time, left, right, below, above } = flight.envelope;
  const centre = Array.from(time, (one) => flight.position(one));
  const up = new Vector3(0, 1, 0);
  const edges = [[left, above], [right, above], [right, below], [left, below]].map(([aside, upward]) =>
    centre.map((place, i) => {
      const along = centre[Math.min(i + 1, centre.length - 1)].clone().sub(centre[Math.max(i - 1, 0)]);
      const across = along.cross(up).normalize();
      return place.clone().addScaledVector(across, aside[i]).addScaledVector(up, upward[i]);
    }),
  );
  const sight = { now: { value: 1e9 }, ahead: { value: 1 }, near: { value: 0 } };
  const sides = edges.map((edge, i) => band(edge, edges[(i + 1) % 4], { times: time, sight, opacity: 0.16 }));
  for (const one of sides) one.paintAll("#e08b3c");
  return new Group().add(...sides);
}

/** The samples that are drawn: the first, the last, and between them as few as follow the way. */
function rowsOf(flight) {
  const rows = [];
  for (let i = 0; i + 1 < flight.count; i += 1)
    if (!rows.length || flight.time[i] - flight.time[rows[rows.length - 1]] > FINE) rows.push(i);
  return [...rows, flight.count - 1];
}

/** Where the edges of the ribbon were at these samples. */
function wingTips(flight, rows, centre) {
  const wing = new Vector3();
  const attitude = new Quaternion();
  const half = 0.5 * NARROW * flight.aircraft.span;
  const tip = (side) =>
    centre.map((place, i) => {
      wing.set(0, side * half, 0).applyQuaternion(flight.attitudeOf(rows[i], attitude));
      return place.clone().add(wing);
    });
  return [tip(-1), tip(1)];
}

const VERTEX = `
attribute vec3 before;
attribute vec3 after;
attribute float side;
attribute float moment;
attribute vec3 tint;
uniform vec2 size;
uniform float width;
varying vec3 shade;
varying float when, away;

vec4 onto(vec3 place) { return projectionMatrix * (modelViewMatrix * vec4(place, 1.0)); }

vec2 onScreen(vec4 place) { return place.xy / max(place.w, 1e-4) * size; }

void main() {
  vec4 here = onto(position);
  if (width > 0.0) {
    vec4 from = onto(before);
    vec4 to = onto(after);
    vec2 along = onScreen(to) - onScreen(from);
    float stretch = length(along);
    vec2 across = stretch > 1e-3 ? vec2(-along.y, along.x) / stretch : vec2(0.0, 1.0);
    // Behind the eye a projection means nothing.
    if (here.w > 0.1 && from.w > 0.1 && to.w > 0.1) here.xy += across * side * width / size * here.w;
  }
  gl_Position = here;
  shade = tint;
  when = moment;
  away = distance(cameraPosition, position);
}`;

const FRAGMENT = `
uniform float opacity, now, ahead, near;
varying vec3 shade;
varying float when, away;
void main() {
  float share = when > now ? ahead : mix(ahead, 1.0, exp((when - now) / ${TRAIL.toFixed(1)}));
  gl_FragColor = vec4(shade, opacity * share * smoothstep(0.35 * near, near + 0.01, away));
  #include <colorspace_fragment>
}`;

/** Give every point of a band, which has two vertices, its colour; `colour(i)` is the Color of point i. */
function paintPairs(attribute, colour) {
  for (let i = 0; 2 * i < attribute.count; i += 1) {
    const { r, g, b } = colour(i);
    attribute.setXYZ(2 * i, r, g, b);
    attribute.setXYZ(2 * i + 1, r, g, b);
  }
  attribute.needsUpdate = true;
}

/** A line through points of the scene, so many pixels wide, with `fit(width, height)` in pixels; else as `band`. */
function line(points, { width, ...look }) {
  return band(points, points, { width, ...look });
}

/**
 * The surface between two lines of as many points.
 *
 * @param times s, of every point.
 * @param sight uniforms: what the time is `now`, how much of the opacity is left `ahead` of it, and within how many
 *   metres, `near`, nothing is drawn.
 * @param width of a line in pixels; 0 for a surface.
 * @returns a mesh with `paint(colour)`, where `colour(i)` is the Color of point i, and `paintAll(colour)`.
 */
function band(left, right, { times, sight, width = 0, opacity = 0.3 }) {
  const count = left.length;
  const buffers = { position: 3, before: 3, after: 3, side: 1, moment: 1, tint: 3 };
  const arrays = Object.fromEntries(Object.entries(buffers).map(([name, n]) => [name, new Float32Array(2 * count * n)]));
  for (let i = 0; i < count; i += 1)
    [left, right].forEach((points, half) => {
      const vertex = 2 * i + half;
      points[i].toArray(arrays.position, 3 * vertex);
      points[Math.max(i - 1, 0)].toArray(arrays.before, 3 * vertex);
      points[Math.min(i + 1, count - 1)].toArray(arrays.after, 3 * vertex);
      arrays.side[vertex] = half === 0 ? -1 : 1;
      arrays.moment[vertex] = times[i];
    });
  const index = [];
  for (let i = 0; i + 1 < count; i += 1) index.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2);
  const geometry = new BufferGeometry();
  for (const [name, n] of Object.entries(buffers)) geometry.setAttribute(name, new BufferAttribute(arrays[name], n));
  geometry.setIndex(index);
  const uniforms = { size: { value: new Vector2(1, 1) }, width: { value: width }, opacity: { value: opacity }, ...sight };
  const shaders = { vertexShader: VERTEX, fragmentShader: FRAGMENT };
  const material = new ShaderMaterial({ ...shaders, uniforms, side: DoubleSide, transparent: true, depthWrite: false });
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
