// The way of a flight: a line where its centre was, and a ribbon as wide as its wings, banked as they were.

import { BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshBasicMaterial, Quaternion, Vector3 } from "three";
import { line, paintPairs } from "./line.js";
import { colourOf, ghostColour, rangeOf, themed } from "./palette.js";
import { extent } from "./numbers.js";

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
