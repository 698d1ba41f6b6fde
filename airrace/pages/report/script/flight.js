// One flight: its histories, read off at any instant; its aircraft, to scale; its way: lines as wide wherever they are
// looked at from, and a ribbon as wide as its wings.

import {
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  Color,
  DoubleSide,
  Group,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  Quaternion,
  ShaderMaterial,
  SphereGeometry,
  Vector2,
  Vector3,
} from "three";
import { colourOf, extent, indexBefore, numbersOf, rangeOf, tagColour, themed } from "./values.js";

/** The rotation that takes north, east, down to the scene's axes: east, up, south. */
const FROM_NORTH_EAST_DOWN = new Quaternion(0.5, 0.5, -0.5, 0.5);

/** A place in the scene. */
export function placed(north, east, height, target = new Vector3()) {
  return target.set(east, height, -north);
}

export class Flight {
  constructor(flight, number) {
    this.number = number;
    this.label = flight.label;
    this.stamp = flight.stamp;
    this.raceTime = flight.race_time; // null where it did not finish
    this.aircraft = flight.aircraft;
    this.named = flight.named;
    this.nation = flight.nation;
    this.raceNumber = flight.number;
    this.colour = flight.colour || tagColour(number); // in scene and graphics
    this.mark = flight.colour || PAINT.mark; // on the aircraft itself
    this.penalties = flight.penalties;
    this.passings = flight.passings;
    this.time = numbersOf(flight.time);
    this.histories = new Map(Object.entries(flight.histories).map(([name, text]) => [name, numbersOf(text)]));
    this.count = this.time.length;
    this.duration = this.time[this.count - 1];
    this.visible = true;
    const deviations = Object.entries(flight.envelope ?? {}).map(([name, text]) => [name, numbersOf(text)]);
    this.envelope = flight.envelope ? Object.fromEntries(deviations) : null;
  }

  /** The history of this name, or undefined. */
  history(name) {
    return this.histories.get(name);
  }

  /** The sample before a time, and the share of the way to the next. */
  at(time) {
    if (time >= this.duration) return [Math.max(this.count - 2, 0), this.count > 1 ? 1 : 0];
    const low = indexBefore(this.time, time);
    const step = this.time[low + 1] - this.time[low];
    return [low, step > 0 ? Math.min(Math.max((time - this.time[low]) / step, 0), 1) : 0];
  }

  /** A history at a time; where it jumps over half of `period`, it is taken the short way round. */
  value(name, time, period = 0) {
    const values = this.history(name);
    if (!values) return NaN;
    const [i, share] = this.at(time);
    let change = values[Math.min(i + 1, this.count - 1)] - values[i];
    if (period && Math.abs(change) > period / 2) change -= Math.sign(change) * period;
    return values[i] + share * change;
  }

  /** Where the aircraft is, in the scene. */
  position(time, target = new Vector3()) {
    return placed(this.value("north", time), this.value("east", time), this.value("up", time), target);
  }

  /** The same flight, so much earlier (s) in space. */
  earlier(shift) {
    return Object.assign(Object.create(this), { position: (time, target) => this.position(time + shift, target) });
  }

  /** Where it is at a sample, in the scene. */
  positionOf(i, target = new Vector3()) {
    return placed(this.history("north")[i], this.history("east")[i], this.history("up")[i], target);
  }

  /** Where it is from one time to another, in the scene. */
  places(from, to) {
    const within = [from, ...this.time.filter((time) => time > from && time < to), Math.min(to, this.duration)];
    return Array.from(within, (time) => this.position(time));
  }

  /** The rotation from body axes (nose, right wing, down) to the scene. */
  attitude(time, target = new Quaternion()) {
    const [i, share] = this.at(time);
    const next = this.attitudeOf(Math.min(i + 1, this.count - 1), new Quaternion());
    return this.attitudeOf(i, target).slerp(next, share);
  }

  /** The same at a sample. */
  attitudeOf(i, target = new Quaternion()) {
    const [w, x, y, z] = ["q0", "q1", "q2", "q3"].map((name) => this.history(name)[i]);
    return target.set(x, y, z, w).premultiply(FROM_NORTH_EAST_DOWN);
  }

  /** The passing of this number of the course, or undefined. */
  passing(number) {
    return this.passings.find((passing) => passing.number === number);
  }

  /** The number of the passing that was made last. */
  leg(time) {
    let number = 0;
    for (let i = 0; i < this.passings.length; i += 1) if (this.passings[i].time <= time + 1e-4) number = i;
    return number;
  }
}

const SPAN = 7.43; // m, of the drawing below
const FACES = 14; // faces around the fuselage
const EYE = [-0.75, 0, -0.9]; // m, the pilot's
const PAINT = { body: "#173f86", wing: "#f7f8fa", mark: "#ef6a1a", glass: "#1d2b38", dark: "#2a2f36" };

/** The nose, the tail, the tips of the wings and the fin, and the wheels of an aircraft of a span, in body axes, m. */
export function extremitiesOf(span) {
  const points = [[2.05, 0, 0], [-4.15, 0, 0], [0.1, -3.715, 0], [0.1, 3.715, 0], [-3.6, 0, -1.4], [0.7, 0, 1.25]];
  return points.map((point) => new Vector3(...point).multiplyScalar(span / SPAN));
}

// Fuselage: distance to the nose, half width, half height, height of the middle (down is positive), m.
const FUSELAGE = [
  [2.05, 0.05, 0.05, 0.0],
  [1.98, 0.16, 0.16, 0.0],
  [1.72, 0.25, 0.25, 0.0],
  [1.7, 0.42, 0.4, 0.02],
  [1.2, 0.48, 0.46, 0.02],
  [0.4, 0.44, 0.48, 0.02],
  [-0.6, 0.4, 0.46, 0.0],
  [-1.6, 0.32, 0.38, -0.02],
  [-2.8, 0.18, 0.25, -0.06],
  [-3.9, 0.07, 0.14, -0.1],
  [-4.15, 0.02, 0.05, -0.1],
];

// Wings and tail: leading edge, chord, half thickness, and where the section stands, from inboard to outboard, m.
const WING = [
  [0.62, 1.62, 0.13, 0.0],
  [0.6, 1.3, 0.1, 2.2],
  [0.57, 1.0, 0.07, 3.3],
  [0.55, 0.85, 0.05, 3.715],
];
const TAILPLANE = [
  [-3.12, 0.95, 0.05, 0.0],
  [-3.28, 0.62, 0.03, 1.3],
];
const FIN = [
  [-3.05, 1.1, 0.05, 0.1],
  [-3.5, 0.72, 0.03, 1.3],
];

/**
 * An aerobatic monoplane of few faces, to scale by its wing span, in body axes: x to the nose, y to the right wing, z down; its
 * tips are of the colour `mark`.
 *
 * The aircraft as a group; `eye` is the pilot's, in body axes, and `inside(is)` hides what would be in its way. A ghost is
 * translucent, and of one colour, which `paint(colour)` gives it.
 */
export function aircraftOf(span, ghost, mark = PAINT.mark) {
  const group = new Group();
  const scale = span / SPAN;
  const pale = new MeshLambertMaterial({ side: DoubleSide, transparent: true, opacity: 0.62 });
  const look = (name) => (ghost ? pale : new MeshLambertMaterial({ color: name === "mark" ? mark : PAINT[name], side: DoubleSide }));
  const body = new Mesh(loft(FUSELAGE.map(ring)), look("body"));
  const canopy = new Mesh(new SphereGeometry(1, 14, 10), look("glass"));
  canopy.scale.set(0.95, 0.3, 0.42);
  canopy.position.set(-0.55, 0, -0.36);
  group.add(body, canopy, ...lifting(look), ...gear(look), propeller());
  group.scale.setScalar(scale);
  group.eye = EYE.map((one) => one * scale);
  group.paint = (colour) => pale.color.set(colour);
  group.inside = (is) => {
    canopy.visible = !is;
  };
  return group;
}

/** Wings with coloured tips, tailplane and fin. */
function lifting(look) {
  const parts = [];
  for (const side of [-1, 1]) {
    const flat = (sections) => loft(sections.map((one) => section(one, (across) => [side * across, -0.02])));
    parts.push(new Mesh(flat(WING.slice(0, 3)), look("wing")), new Mesh(flat(WING.slice(2)), look("mark")));
    const tail = TAILPLANE.map((one) => section(one, (across) => [side * across, -0.12]));
    parts.push(new Mesh(loft(tail), look("wing")));
  }
  const fin = FIN.map(([edge, chord, thick, up]) =>
    section([edge, chord, thick, 0], () => [0, 0]).map(([x, , z]) => [x, z, -0.1 - up]),
  );
  parts.push(new Mesh(loft(fin), look("mark")));
  return parts;
}

/** Two legs and two wheels in spats. */
function gear(look) {
  return [-1, 1].flatMap((side) => {
    const leg = [
      [0.55, 0.3 * side, 0.4],
      [0.75, 0.95 * side, 1.05],
    ];
    const spat = new Mesh(new SphereGeometry(1, 10, 8), look("body"));
    spat.scale.set(0.42, 0.1, 0.19);
    spat.position.set(0.72, 0.98 * side, 1.12);
    const thick = (x, y, z, half) => [
      [x - half, y, z],
      [x, y, z - 0.04],
      [x + half, y, z],
      [x, y, z + 0.04],
    ];
    const strut = loft([thick(...leg[0], 0.14), thick(...leg[1], 0.09)]);
    return [new Mesh(strut, look("dark")), spat];
  });
}

/** The disc that a turning propeller looks like. */
function propeller() {
  const look = { color: "#5a6670", transparent: true, opacity: 0.14, side: DoubleSide, depthWrite: false };
  const disc = new Mesh(new CircleGeometry(1.0, 28), new MeshBasicMaterial(look));
  disc.rotation.y = Math.PI / 2;
  disc.position.x = 1.85;
  return disc;
}

/** A ring around the fuselage, an ellipse. */
function ring([x, wide, high, middle]) {
  return Array.from({ length: FACES }, (_, i) => {
    const angle = (2 * Math.PI * i) / FACES;
    return [x, wide * Math.cos(angle), middle + high * Math.sin(angle)];
  });
}

/** A symmetric profile; `where` puts it beside the middle of the aircraft. */
function section([edge, chord, thick, across], where) {
  const [y, z] = where(across);
  const upper = [0, 0.08, 0.28, 0.6, 1].map((share) => [share, share === 0 || share === 1 ? 0 : profile(share)]);
  const lower = upper.slice(1, -1).reverse();
  const sided = [...upper.map(([s, t]) => [s, -t]), ...lower.map(([s, t]) => [s, t])];
  return sided.map(([share, t]) => [edge - share * chord, y, z + thick * t]);
}

/** Thickness along the chord, of its half. */
function profile(share) {
  return share < 0.28 ? Math.sqrt(share / 0.28) : (1 - share) / 0.72;
}

/** The skin over closed sections of as many points, with flat ends. */
function loft(sections) {
  const around = sections[0].length;
  const places = [];
  const triangle = (a, b, c) => places.push(...a, ...b, ...c);
  for (let s = 0; s + 1 < sections.length; s += 1) {
    for (let i = 0; i < around; i += 1) {
      const j = (i + 1) % around;
      const [a, b, c, d] = [sections[s][i], sections[s][j], sections[s + 1][i], sections[s + 1][j]];
      triangle(a, b, c);
      triangle(b, d, c);
    }
  }
  for (const end of [sections[0], sections[sections.length - 1]])
    for (let i = 1; i + 1 < around; i += 1) triangle(end[0], end[i], end[i + 1]);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
  geometry.computeVertexNormals();
  return geometry;
}

const NARROW = 0.36; // of the span: enough to show the bank, and little of what lies behind
const AROUND = { ahead: 1, near: 0 }; // of views in which all of the way is looked at
const ALONG = { ahead: 0.3, near: 45 }; // of those that follow the aircraft: dim ahead, and clear before the eye
const BEHIND = { ahead: 0, near: 45 }; // of television: what has been flown, and no more
const FINE = 0.03; // s between samples that are drawn
const TRAIL = 2.2; // s, over which the way behind the aircraft fades
const FAINT = 0.3; // of its opacity, that is left of it far behind

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
    const look = view.onAir ? BEHIND : view.follows ? ALONG : AROUND;
    Object.assign(sight.now, { value: time });
    for (const one of [middle, shadow, wings]) one.until(look.ahead > 0 ? Infinity : time);
    sight.ahead.value = look.ahead * (lead || !view.follows ? 1 : 0.5);
    sight.near.value = look.near;
  };
  group.restyle = () => {
    shadow.paintAll(themed("shadow"));
    if (!lead) for (const one of [middle, wings]) one.paintAll(flight.colour);
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
  float share = when > now ? ahead : mix(max(ahead, ${FAINT.toFixed(1)}), 1.0, exp((when - now) / ${TRAIL.toFixed(1)}));
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
 * @returns a mesh with `until(time)`, `fit(width, height)` and `paint(colour)`, where `colour(i)` is the Color of point i, and `paintAll(colour)`.
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
  const last = times.length - 1;
  /** Draw it up to an instant alone; what lies ahead of it costs nothing then. */
  mesh.until = (time) => geometry.setDrawRange(0, 6 * (time < times[last] ? indexBefore(times, time) + 1 : last));
  mesh.fit = (across, down) => uniforms.size.value.set(across, down);
  mesh.paint = (colour) => paintPairs(geometry.getAttribute("tint"), colour);
  mesh.paintAll = (colour) => {
    const one = new Color(colour);
    mesh.paint(() => one);
  };
  return mesh;
}
