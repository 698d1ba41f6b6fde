// The course in space: gates, pylons, people, lines and the ground that they stand on.

import {
  BackSide,
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  Color,
  CylinderGeometry,
  DoubleSide,
  Group,
  LineBasicMaterial,
  LineDashedMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  NotEqualStencilFunc,
  OctahedronGeometry,
  ReplaceStencilOp,
  Shape,
  ShapeGeometry,
  SphereGeometry,
  Vector3,
} from "three";
import { placed } from "./flight.js";
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

const FOOT = 2.5; // m, radius of an inflated pylon at the ground
const TOP = 0.4; // m, at its top
const BANDS = 5; // of colour, from the ground to the top
const ROUND = 24; // corners of a circle around people
const FENCE = 30; // m, the height at which airspace and safety lines are drawn

/** All of the course as a group; `labels` are what is to be named in it, `restyle()` repaints. */
export function courseOf(course) {
  const group = new Group();
  const painted = [];
  const labels = [];
  const add = (mesh, colour) => {
    group.add(mesh);
    painted.push([mesh.material, colour]);
  };
  for (const element of course.elements) addElement(element, add, labels);
  course.crowd.forEach((crowd, number) => addCrowd(crowd, number, add, labels));
  for (const obstacle of course.obstacles) addObstacle(obstacle, add, labels);
  for (const safety of course.lines) addSafetyLine(safety, add, labels);
  if (course.airspace.length) addAirspace(course.airspace, add, labels);
  group.labels = labels;
  group.restyle = () => painted.forEach(([material, colour]) => material.color.set(themed(colour)));
  return group;
}

function addElement(element, add, labels) {
  for (const [north, east] of element.posts) addPylon(placed(north, east, 0), element.top, add);
  if (element.window) addWindow(element, add);
  if (element.reach) addReach(element.reach, add);
  if (!element.posts.length) addMark(element, add);
  const height = element.posts.length ? element.top : element.place[2];
  const place = placed(element.place[0], element.place[1], height);
  labels.push({ text: element.label, place, kind: "element" });
}

/** An inflated pylon: a cone in bands of white and red. */
function addPylon(foot, top, add) {
  for (let band = 0; band < BANDS; band += 1) {
    const radius = (share) => FOOT + (TOP - FOOT) * share;
    const [low, high] = [band / BANDS, (band + 1) / BANDS];
    const geometry = new CylinderGeometry(radius(high), radius(low), top / BANDS, 16, 1, band < BANDS - 1);
    const mesh = new Mesh(geometry, new MeshLambertMaterial());
    mesh.position.set(foot.x, top * (low + high) * 0.5, foot.z);
    add(mesh, band % 2 ? "pylon-band" : "pylon");
  }
}

/** The opening that the aircraft flies through, at the heights that count. */
function addWindow({ window, heights }, add) {
  const [left, right] = window;
  const [low, high] = heights[1] - heights[0] < 1 ? [heights[0] - 0.5, heights[1] + 0.5] : heights;
  const corners = [
    placed(left[0], left[1], low),
    placed(right[0], right[1], low),
    placed(right[0], right[1], high),
    placed(left[0], left[1], high),
  ];
  const mesh = new Mesh(polygon(corners), translucent(0.2));
  const frame = new LineSegments(segments(sidesOf(corners, true)), new LineBasicMaterial());
  add(mesh, "accent");
  add(frame, "accent");
}

/** How far beside a pylon its passing counts, on the ground. */
function addReach([from, to], add) {
  const dashes = { dashSize: 4, gapSize: 4, depthWrite: false };
  const mesh = new LineSegments(
    segments([[placed(from[0], from[1], 0), placed(to[0], to[1], 0)]]),
    new LineDashedMaterial(dashes),
  );
  mesh.computeLineDistances();
  add(mesh, "muted");
}

/** An attitude that is flown somewhere: a small diamond where the first flight passed it. */
function addMark({ place }, add) {
  const mesh = new Mesh(new OctahedronGeometry(2.5), new MeshLambertMaterial({ flatShading: true }));
  mesh.position.copy(placed(...place));
  add(mesh, "accent");
}

/** People, and the ground within their distance. */
function addCrowd({ name, corners, closed, distance, height }, number, add, labels) {
  const places = corners.map(([north, east]) => placed(north, east, height));
  const near = new Mesh(around(corners, closed, distance), once(translucent(0.14), number + 1));
  near.renderOrder = -10;
  add(near, "limit");
  if (closed) {
    const area = new Mesh(flat(corners), translucent(0.6));
    area.renderOrder = -9;
    add(area, "limit");
  }
  for (const [a, b] of sidesOf(places, closed || places.length === 1)) {
    const wall = new Mesh(upright(a, b, height + 4), translucent(0.85));
    add(wall, "limit");
  }
  if (places.length === 1) {
    const post = new Mesh(new CylinderGeometry(3, 3, 4, 16), new MeshLambertMaterial());
    post.position.copy(places[0]).setY(height + 2);
    add(post, "limit");
  }
  labels.push({ text: `${name}, ${Math.round(distance)} m`, place: middle(places).setY(height + 8), kind: "crowd" });
}

/** A mast, a cylinder or a box, from the ground to its top. */
function addObstacle({ name, corners, height }, add, labels) {
  const places = corners.map(([north, east]) => placed(north, east, height));
  for (const [a, b] of sidesOf(places, true)) {
    const wall = new Mesh(upright(a, b, height), translucent(0.6));
    add(wall, "limit");
  }
  labels.push({ text: name, place: middle(places).setY(height + 4), kind: "element" });
}

/** A line not to be crossed: a low fence, translucent, and hatches to the side that is forbidden. */
function addSafetyLine({ name, start, end, keep_right: keepRight }, add, labels) {
  const [a, b] = [placed(...start, 0), placed(...end, 0)];
  const fence = new Mesh(upright(a, b, FENCE), translucent(0.16));
  const along = b.clone().sub(a);
  const length = along.length();
  const right = new Vector3(-along.z, 0, along.x).divideScalar(length);
  const beyond = right.multiplyScalar(keepRight ? -1 : 1);
  const pairs = [[a, b]];
  for (let s = 0; s <= length; s += 25) {
    const from = a.clone().addScaledVector(along, s / length);
    pairs.push([from, from.clone().addScaledVector(beyond, 10)]);
  }
  const hatches = new LineSegments(segments(pairs), new LineBasicMaterial());
  add(fence, "caution");
  add(hatches, "caution");
  labels.push({ text: name, place: a.clone().lerp(b, 0.5).setY(FENCE), kind: "line" });
}

function addAirspace(corners, add, labels) {
  const places = corners.map(([north, east]) => placed(north, east, 0));
  const pairs = sidesOf(places, true);
  for (const [a, b] of pairs) {
    const wall = new Mesh(upright(a, b, FENCE), translucent(0.07));
    add(wall, "accent");
  }
  const border = new LineSegments(segments(pairs), new LineDashedMaterial({ dashSize: 16, gapSize: 8 }));
  border.computeLineDistances();
  add(border, "accent");
  labels.push({ text: "airspace", place: places[0].clone().setY(FENCE), kind: "line" });
}

function translucent(opacity) {
  return new MeshBasicMaterial({ transparent: true, opacity, side: DoubleSide, depthWrite: false, color: new Color() });
}

/** A material that paints no spot twice, however its triangles overlap. */
function once(material, number) {
  const stencil = { stencilWrite: true, stencilRef: number % 255, stencilFunc: NotEqualStencilFunc };
  return Object.assign(material, stencil, { stencilZPass: ReplaceStencilOp });
}

function middle(places) {
  return places.reduce((sum, place) => sum.add(place), new Vector3()).divideScalar(places.length);
}

/** A convex polygon in space. */
function polygon(corners) {
  const geometry = new BufferGeometry().setFromPoints(corners);
  geometry.setIndex(Array.from({ length: corners.length - 2 }, (_, i) => [0, i + 1, i + 2]).flat());
  return geometry;
}

/** Any simple polygon on the ground, of places [north, east]. */
function flat(corners) {
  const geometry = new ShapeGeometry(new Shape(corners.map(([north, east]) => new Vector3(east, north, 0))));
  return geometry.rotateX(-Math.PI / 2);
}

/** A wall on the ground between two places. */
function upright(a, b, height) {
  const at = (place, up) => new Vector3(place.x, up, place.z);
  return polygon([at(a, 0), at(b, 0), at(b, height), at(a, height)]);
}

/** Every place with the next; closed, the last with the first as well. */
function sidesOf(places, closed) {
  const sides = places.map((place, i) => [place, places[(i + 1) % places.length]]);
  return closed ? sides : sides.slice(0, -1);
}

function segments(pairs) {
  const places = new Float32Array(pairs.flat().flatMap((place) => place.toArray()));
  return new BufferGeometry().setAttribute("position", new BufferAttribute(places, 3));
}

/** The ground within a distance of a point, a line or an area: discs at the corners, and strips between them. */
function around(corners, closed, distance) {
  const flatPlaces = corners.map(([north, east]) => placed(north, east, 0));
  const triangles = [];
  for (const [a, b] of sidesOf(flatPlaces, closed)) {
    const across = new Vector3(a.z - b.z, 0, b.x - a.x).setLength(distance);
    const [p, q, r, s] = [a, b].flatMap((one) => [one.clone().add(across), one.clone().sub(across)]);
    triangles.push(p, q, r, q, s, r);
  }
  for (const centre of flatPlaces) {
    const rim = (i) => {
      const angle = (2 * Math.PI * i) / ROUND;
      return new Vector3(centre.x + distance * Math.cos(angle), 0, centre.z + distance * Math.sin(angle));
    };
    for (let i = 0; i < ROUND; i += 1) triangles.push(centre, rim(i), rim(i + 1));
  }
  return new BufferGeometry().setFromPoints(triangles);
}
