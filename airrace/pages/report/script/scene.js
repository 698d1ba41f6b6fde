// The scene: ground, course, flights, light and names, drawn from the view that is chosen whenever something has changed.

import {
  Box3,
  BufferGeometry,
  DirectionalLight,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshBasicMaterial,
  Scene,
  SphereGeometry,
  Vector3,
  WebGLRenderer,
} from "three";
import { Chase, Cockpit, Orbit, Parallel } from "./cameras.js";
import { watchGestures } from "./controls.js";
import { courseOf } from "./course.js";
import { Director, Replay, Television } from "./director.js";
import { aircraftOf, envelopeOf, extremitiesOf, placed, ribbonOf } from "./flight.js";
import { groundOf, shadowOf } from "./ground.js";
import { extent, roundStep, themed, written } from "./values.js";

const NEAR = 12; // m, from the eye in the cockpit, within which no other aircraft is drawn
const [LATE, EARLY] = [40, 20]; // ms between pictures, beyond which fewer pixels are drawn, and below which more
const COARSEST = 0.4;
const CORNER = 120; // pixels, of the upper left, where the order of the flights is written
const SHARP = 3; // pixels of a picture for print per pixel of the page
export const RESULT = "result"; // the view behind the result
const DOT = 4; // pixels, of the marker by which a small aircraft is found

export class RaceScene {
  /** @throws Error where the browser has no WebGL. */
  constructor(element, course, flights, clock, graphics, units) {
    this.element = element;
    this.units = units;
    this.clock = clock;
    this.graphics = graphics;
    [this.canvas, this.overlay] = element.querySelectorAll("canvas");
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, stencil: true, alpha: true });
    this.scene = new Scene();
    const points = pointsOf(course, flights);
    this.ground = groundOf(new Box3().setFromPoints(points), course);
    this.course = courseOf(course, units);
    this.actors = flights.map((flight) => new Actor(flight, this.ground.sun, flights.length > 1));
    this.light();
    this.scene.add(this.ground, shadowOf(this.course.standing, this.ground.sun), this.course);
    this.scene.add(...this.actors.flatMap((actor) => actor.parts));
    const lead = this.actors[0];
    const parallel = ["above", "side"].map((name) => new Parallel(name, points));
    const [chase, cockpit] = [new Chase(lead.flight), new Cockpit(lead.flight, lead.model)];
    const directed = (those, camera, ...part) => new Director(those, course.elements, this.ground.shore, this.ground.sun, camera, ...part);
    const director = directed(flights, chase);
    const pursuing = graphics.pursuits.map(({ flight, from, to }) => {
      const beside = flights.filter((other) => other !== flight && other.duration > from);
      return directed([flight, ...beside], new Chase(flight), from, to);
    });
    const replays = graphics.swings.map((swing, number) => new Replay(director, swing, number));
    const result = Object.assign(new Orbit(points), { name: RESULT });
    const views = [new Orbit(points), ...parallel, chase, cockpit, new Television(director, pursuing), ...replays, result];
    this.views = new Map(views.map((view) => [view.name, view]));
    this.view = views[0];
    this.enlarged = 1;
    this.pending = false;
    Object.assign(this, { sharpness: 1, last: 0 });
    const north = { text: "N", place: this.ground.arrow.position, kind: "north", hidden: () => !this.gridded };
    this.labels = [north, ...this.course.labels, ...this.actors.map(({ tag }) => tag)];
    this.showLabels = labelsOver(element.querySelector(".labels"), this.labels);
    watchGestures(this.canvas, this.wishes());
    new ResizeObserver(() => this.invalidate()).observe(element);
    clock.watch(() => this.invalidate());
    this.restyle();
  }

  light() {
    this.daylight = new DirectionalLight("#ffffff", 2.3);
    this.daylight.position.copy(this.ground.sun);
    this.skylight = new HemisphereLight("#ffffff", "#b9c6cc", 2.4);
    this.scene.add(this.skylight, this.daylight);
  }

  wishes() {
    const wish = (name) => (...values) => {
      this.view[name](...values);
      this.invalidate();
    };
    return { turn: wish("turn"), move: wish("move"), zoom: wish("zoom") };
  }

  look(name) {
    this.view = this.views.get(name);
    this.view.home();
    this.invalidate();
  }

  /** Let the views that do not follow an aircraft show these points, or the whole course for null. */
  focus(points) {
    for (const view of this.views.values()) view.focus?.(points);
    this.invalidate();
  }

  enlarge(factor) {
    this.enlarged = factor;
    this.invalidate();
  }

  flood(kind) {
    this.ground.flood(kind);
    this.invalidate();
  }

  colour(scale) {
    for (const actor of this.actors) actor.way.colour(scale);
    this.invalidate();
  }

  restyle() {
    this.ground.restyle();
    this.course.restyle();
    this.daylight.color.set(themed("sunlight"));
    this.skylight.color.set(themed("skylight"));
    for (const actor of this.actors) actor.restyle();
    this.invalidate();
  }

  invalidate() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      const { clientWidth: width, clientHeight: height } = this.element;
      const ratio = Math.min(window.devicePixelRatio, 2);
      const covered = this.covered();
      this.draw(width, height, ratio * this.share(), this.view, covered);
      const context = sized(this.overlay, width, height, ratio);
      const whole = document.fullscreenElement !== null;
      this.graphics.draw(context, width, height, this.clock.time, this.view, { whole, top: covered[2], bottom: covered[1] });
      this.showLabels(this.view.camera, width, height, this.graphics.panels);
      this.onDrawn?.();
    });
  }

  /** The share of the screen's pixels, along each side, that are drawn: fewer while the race plays and pictures come late. */
  share() {
    const now = performance.now();
    const took = now - this.last;
    this.last = now;
    if (!this.clock.running) return 1;
    if (took < 1000) this.sharpness = Math.min(Math.max(this.sharpness * (took > LATE ? 0.9 : took < EARLY ? 1.03 : 1), COARSEST), 1);
    return this.sharpness;
  }

  /**
   * One picture; pixels of the page, and how many of the screen each of them is; lines `thick` times as wide. It is `apart` from
   * sky and ground, and without a grid, where these are drawn below it, see `groundOf`.
   */
  draw(width, height, ratio, view, covered, thick = 1, apart = false) {
    if (!width || !height) return;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    view.place(width, height, this.clock.time, covered);
    this.gridded = !apart && !view.follows;
    this.ground.show(view.camera, this.clock.time, this.gridded);
    this.actors.forEach((actor) => actor.show(this, view, width / thick, height / thick));
    this.ground.prepare(this.renderer, view.camera, apart);
    this.renderer.render(this.scene, view.camera);
  }

  /** Pixels of what lies over the picture along its upper and its lower edge, and in its upper left corner. */
  covered() {
    const { top, bottom, left } = this.element.getBoundingClientRect();
    const boxes = [...this.element.querySelectorAll(".hud")].map((one) => one.getBoundingClientRect());
    const isAbove = (box) => box.top + box.bottom < top + bottom;
    const below = (box) => box.bottom - top;
    return [
      Math.max(0, ...boxes.filter(isAbove).map(below)),
      Math.max(0, ...boxes.filter((box) => !isAbove(box)).map((box) => bottom - box.top)),
      Math.max(0, ...boxes.filter((box) => isAbove(box) && box.left < left + CORNER).map(below)),
    ];
  }

  /** A picture of a view with its names, as the address of an image, for print. */
  picture(name, width, height) {
    const view = this.views.get(name);
    this.draw(width, height, SHARP, view);
    this.sheet ??= document.createElement("canvas");
    const context = sized(this.sheet, width, height, SHARP);
    context.drawImage(this.canvas, 0, 0, width, height);
    writeLabels(context, this.labels, view.camera, width, height);
    return this.sheet.toDataURL("image/jpeg", 0.9);
  }

  /** How large a picture of a view is, in words: its own width where that has a scale, else that of the grid. */
  scaleOf(name, width) {
    const { pixel } = this.views.get(name);
    const { length, per_m: perMetre } = this.units;
    const metres = pixel ? pixel * width : this.ground.step;
    const size = `${written(metres * perMetre, 0)} ${length}`;
    return pixel ? `${size} wide` : `grid ${size}`;
  }

  /** Metres per pixel where the view has a scale that holds all over the picture; else null. */
  get pixel() {
    return this.view.pixel ?? null;
  }

  /** The round length, in the page's unit, of a bar that is about so many pixels long; null where no scale holds. */
  scaleBar(pixels) {
    return this.pixel === null ? null : roundStep(this.pixel * pixels * this.units.per_m);
  }
}

/** A flight in the scene: its way, its aircraft with shadow and name, a plumb line to the ground and a dot by which it is found. */
class Actor {
  constructor(flight, sun, named) {
    this.flight = flight;
    this.way = ribbonOf(flight);
    this.model = aircraftOf(flight.aircraft.span, flight.number > 0, flight.mark);
    this.plumb = new Line(new BufferGeometry().setFromPoints([new Vector3(), new Vector3()]), new LineBasicMaterial());
    this.plumb.frustumCulled = false;
    this.dot = new Mesh(new SphereGeometry(1, 12, 8), new MeshBasicMaterial({ transparent: true, depthTest: false }));
    this.size = this.model.scale.x;
    this.shadow = shadowOf(this.model, sun);
    this.parts = [this.way, this.shadow, this.model, this.plumb, this.dot];
    if (flight.envelope) this.parts.push(envelopeOf(flight));
    const hidden = () => !this.model.visible || this.nameless || (flight.number === 0 && this.close);
    const extent = () => extremitiesOf(flight.aircraft.span * this.scale).map((point) => point.applyQuaternion(this.model.quaternion).add(this.model.position));
    this.tag = { text: named ? flight.label : "", place: this.model.position, kind: "tag", colour: flight.colour, hidden, extent };
    this.scale = 1;
  }

  restyle() {
    this.way.restyle();
    const { colour } = this.flight;
    this.plumb.material.color.set(colour);
    this.dot.material.color.set(colour);
    this.model.paint(colour);
  }

  show(scene, view, width, height) {
    for (const part of this.parts) part.visible = this.flight.visible && (view.shows?.(this.flight, scene.clock.time) ?? true);
    const time = scene.clock.time + (view.shiftOf?.(this.flight) ?? 0);
    this.way.show(time, view, width, height);
    this.flight.position(time, this.model.position);
    this.flight.attitude(time, this.model.quaternion);
    this.close = view.seat || view.name === "chase";
    this.nameless = view.name === RESULT; // where names of gates are wanted
    this.inside = view.seat === true && this.flight.number === 0;
    this.scale = this.inside ? 1 : scene.enlarged;
    this.model.scale.setScalar(this.size * this.scale);
    const ends = this.plumb.geometry.getAttribute("position");
    this.model.position.toArray(ends.array, 0);
    ends.setXYZ(1, this.model.position.x, 0, this.model.position.z);
    ends.needsUpdate = true;
    this.model.inside(this.inside);
    this.plumb.visible &&= !view.follows;
    // A ghost that flies in one's own seat would hide everything.
    if (view.seat && !this.inside) this.model.visible &&= this.away(view.camera) > NEAR * scene.enlarged;
    this.shadow.follow();
    this.showDot(scene, view, height);
  }

  away(camera) {
    return camera.position.distanceTo(this.model.position);
  }

  /** Only where the aircraft itself is too small to be seen. */
  showDot(scene, view, height) {
    const { camera } = view;
    const pixel = view.pixel ?? (2 * this.away(camera) * Math.tan((camera.fov * Math.PI) / 360)) / height;
    const seen = (this.flight.aircraft.span * scene.enlarged) / pixel;
    this.dot.visible = this.model.visible && !this.inside && seen < 26;
    this.dot.material.opacity = seen < 14 ? 0.9 : 0.25;
    this.dot.position.copy(this.model.position);
    this.dot.scale.setScalar(DOT * pixel * (seen < 14 ? 1 : 0.6));
  }
}

/** The context of a canvas of so many pixels of the page, empty. */
export function sized(canvas, width, height, ratio) {
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d", { willReadFrequently: canvas.isConnected === false });
  context.scale(ratio, ratio);
  return context;
}

/** What is to be seen: the flights, and the feet and tops of what stands on the course. */
function pointsOf(course, flights) {
  const points = flights.flatMap((flight) =>
    Array.from({ length: Math.ceil(flight.count / 10) }, (_, i) => flight.positionOf(10 * i)),
  );
  for (const { posts, top, place } of course.elements)
    for (const [north, east] of [...posts, place]) points.push(placed(north, east, 0), placed(north, east, posts.length ? top : 0));
  return points;
}

const LONGEST = 40; // letters
const ROOM = 0.3; // of the height of a name, between it and others
const TAG_INK = "#0b1620"; // of names of aircraft, likewise in the style sheet
const INK = { crowd: "limit", line: "caution", north: "muted" };

/** Labels over a scene; the function that is returned puts them where their places are seen by a camera. */
function labelsOver(element, labels) {
  const shown = labels.filter((label) => label.text).map((label) => Object.assign(label, { span: named(element, label) }));
  return (camera, width, height, covered) => {
    const boxes = arranged(shown, camera, width, height, ({ span }) => [span.offsetWidth, span.offsetHeight], covered);
    shown.forEach(({ span }, i) => {
      span.classList.toggle("hidden", boxes[i] === null);
      if (boxes[i]) span.style.transform = `translate(${boxes[i][0].toFixed(1)}px, ${boxes[i][1].toFixed(1)}px)`;
    });
  };
}

/** The same written into a drawing, so many pixels high. */
export function writeLabels(context, labels, camera, width, height, size = 13, covered = []) {
  context.font = `600 ${size}px ${getComputedStyle(document.body).fontFamily}`;
  context.textBaseline = "top";
  context.textAlign = "left";
  const shown = labels.filter((label) => label.text);
  const sizeOf = ({ text }) => [context.measureText(shortened(text)).width + 0.6 * size, 1.4 * size];
  const boxes = arranged(shown, camera, width, height, sizeOf, covered);
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
 * Left, top, width and height of every label above its place; null where it is not seen, would lie on a box of `covered`, or
 * come too close to one that is nearer.
 *
 * Names of aircraft come first, and stand beside them: never on an aircraft, nor on another name; one is `hidden()` while its
 * aircraft is.
 */
function arranged(labels, camera, width, height, sizeOf, covered) {
  const place = new Vector3();
  const tags = labels.filter((label) => label.kind === "tag" && label.text && !label.hidden?.());
  const aircraft = new Map(tags.map((tag) => [tag, boxOf(tag.extent(), camera, width, height)]));
  const taken = [...covered];
  const boxes = labels.map(() => null);
  const named = labels.map(({ kind }) => Number(kind === "tag"));
  const depths = labels.map((label) => place.copy(label.place).project(camera).z);
  const order = [...labels.keys()].sort((a, b) => named[b] - named[a] || depths[a] - depths[b]);
  for (const i of order) {
    const label = labels[i];
    if (label.hidden?.()) continue;
    place.copy(label.place).project(camera);
    const [across, down] = [0.5 * (place.x + 1) * width, 0.5 * (1 - place.y) * height];
    const seen = place.z > -1 && place.z < 1 && across > 0 && across < width && down > 8 && down < height;
    if (!seen) continue;
    const [wide, high] = sizeOf(label);
    const left = Math.min(Math.max(across - 0.5 * wide, 2), width - wide - 2);
    let tried = [[left, down - high - 3, wide, high]];
    let obstacles = taken;
    if (aircraft.has(label)) {
      const [x, y, w, h] = aircraft.get(label);
      const rows = [0, 1, 2, 3].map((row) => row * (high + 2));
      const above = rows.map((row) => [left, y - high - 3 - row, wide, high]);
      const below = rows.map((row) => [left, y + h + 3 + row, wide, high]);
      const beside = [x + w + 4, x - wide - 4].map((edge) => [edge, down - 0.5 * high, wide, high]);
      tried = [...above, ...beside, ...below].filter((box) => box[0] > 0 && box[1] > 0 && box[0] + wide < width && box[1] + high < height);
      obstacles = [...taken, ...aircraft.values()];
    }
    const room = aircraft.has(label) ? 0 : high * ROOM;
    const free = tried.find((box) => !obstacles.some((other) => overlap(box, other, room)));
    if (!free) continue;
    taken.push(free);
    boxes[i] = free;
  }
  return boxes;
}

/** Left, top, width and height of points in a picture. */
function boxOf(points, camera, width, height) {
  const seen = points.map((point) => point.project(camera));
  const [left, right] = extent(seen.map(({ x }) => 0.5 * (x + 1) * width));
  const [top, bottom] = extent(seen.map(({ y }) => 0.5 * (1 - y) * height));
  return [left, top, right - left, bottom - top];
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

/** Whether boxes overlap, or lie closer than some room beside each other. */
export function overlap(a, b, room) {
  return a[0] < b[0] + b[2] + room && b[0] < a[0] + a[2] + room && a[1] < b[1] + b[3] + room && b[1] < a[1] + a[3] + room;
}
