// The course in space: gates, pylons, people, lines and obstacles.

import {
  BufferAttribute,
  BufferGeometry,
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
  OctahedronGeometry,
  Shape,
  ShapeGeometry,
  Vector3,
} from "three";
import { placed } from "./flight.js";
import { once } from "./ground.js";
import { themed } from "./values.js";

const FOOT = 2.5; // m, radius of an inflated pylon at the ground
const TOP = 0.4; // m, at its top
const BANDS = 5; // of colour, from the ground to the top
const ROUND = 24; // corners of a circle around people
const FENCE = 30; // m, the height at which airspace and safety lines are drawn

/** The radius of a pylon at a height, m. */
export function radiusOf(height, top) {
  return FOOT + (TOP - FOOT) * Math.min(Math.max(height / top, 0), 1);
}

/** All of the course as a group; `labels` are what is to be named in it, `standing` casts shadows, `restyle()` repaints. */
export function courseOf(course, units) {
  const group = new Group();
  const painted = [];
  const labels = [];
  const standing = new Group();
  const add = (mesh, colour, casts = false) => {
    (casts ? standing : group).add(mesh);
    painted.push([mesh.material, colour]);
  };
  for (const element of course.elements) addElement(element, add, labels);
  course.crowd.forEach((crowd, number) => addCrowd(crowd, number, add, labels, units));
  for (const obstacle of course.obstacles) addObstacle(obstacle, add, labels);
  for (const safety of course.lines) addSafetyLine(safety, add, labels);
  if (course.airspace.length) addAirspace(course.airspace, add, labels);
  group.add(standing);
  Object.assign(group, { labels, standing });
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
    const [low, high] = [band / BANDS, (band + 1) / BANDS];
    const geometry = new CylinderGeometry(radiusOf(high * top, top), radiusOf(low * top, top), top / BANDS, 16, 1, band < BANDS - 1);
    const mesh = new Mesh(geometry, new MeshLambertMaterial());
    mesh.position.set(foot.x, top * (low + high) * 0.5, foot.z);
    add(mesh, band % 2 ? "pylon-band" : "pylon", true);
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
function addCrowd({ name, corners, closed, distance, height }, number, add, labels, units) {
  const places = corners.map(([north, east]) => placed(north, east, height));
  const near = new Mesh(around(corners, closed, distance), once(translucent(0.14), 1 + (number % 250)));
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
  labels.push({ text: `${name}, ${Math.round(distance * units.per_m)} ${units.length}`, place: middle(places).setY(height + 8), kind: "crowd" });
}

/** A mast, a cylinder or a box, from the ground to its top. */
function addObstacle({ name, corners, height }, add, labels) {
  const places = corners.map(([north, east]) => placed(north, east, height));
  for (const [a, b] of sidesOf(places, true)) {
    const wall = new Mesh(upright(a, b, height), translucent(0.6));
    add(wall, "limit", true);
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
