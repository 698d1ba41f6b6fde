// The scene: ground, course, flights and light, drawn from the view that is chosen whenever something has changed.

import {
  AmbientLight,
  Box3,
  BufferGeometry,
  DirectionalLight,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshBasicMaterial,
  Scene,
  SphereGeometry,
  Vector3,
  WebGLRenderer,
} from "three";
import { courseOf, groundOf } from "./course.js";
import { aircraftOf, placed } from "./flight.js";
import { watchGestures } from "./controls.js";
import { labelsOver, writeLabels } from "./labels.js";
import { roundStep, written } from "./numbers.js";
import { ghostColour, themed } from "./palette.js";
import { ribbonOf } from "./ribbon.js";
import { Chase, Cockpit, Orbit, Parallel } from "./views.js";

const NEAR = 12; // m, from the eye in the cockpit, within which no other aircraft is drawn
const SHARP = 3; // pixels of a picture for print per pixel of the page
const DOT = 4; // pixels, of the marker by which a small aircraft is found

export class RaceScene {
  /** @throws Error where the browser has no WebGL. */
  constructor(element, course, flights, clock) {
    this.element = element;
    this.clock = clock;
    this.canvas = element.querySelector("canvas");
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, stencil: true });
    this.scene = new Scene();
    const points = pointsOf(course, flights);
    this.ground = groundOf(new Box3().setFromPoints(points));
    this.course = courseOf(course);
    this.actors = flights.map((flight) => new Actor(flight));
    this.light();
    this.scene.add(this.ground, this.course, ...this.actors.flatMap((actor) => actor.parts));
    const lead = this.actors[0];
    const parallel = ["above", "side"].map((name) => new Parallel(name, points));
    const views = [new Orbit(points), ...parallel, new Chase(lead.flight), new Cockpit(lead.flight, lead.model)];
    this.views = new Map(views.map((view) => [view.name, view]));
    this.view = views[0];
    this.enlarged = 1;
    this.pending = false;
    const north = { text: "N", place: this.ground.arrow.position, kind: "north" };
    this.labels = [north, ...this.course.labels];
    this.showLabels = labelsOver(element.querySelector(".labels"), this.labels);
    watchGestures(this.canvas, this.wishes());
    new ResizeObserver(() => this.invalidate()).observe(element);
    clock.watch(() => this.invalidate());
    this.restyle();
  }

  light() {
    const sun = new DirectionalLight("#ffffff", 2.2);
    sun.position.set(0.5, 1, 0.35);
    this.scene.add(new AmbientLight("#ffffff", 1.9), sun);
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

  enlarge(factor) {
    this.enlarged = factor;
    this.invalidate();
  }

  colour(scale) {
    for (const actor of this.actors) actor.way.colour(scale);
    this.invalidate();
  }

  restyle() {
    this.ground.restyle();
    this.course.restyle();
    for (const actor of this.actors) actor.restyle();
    this.invalidate();
  }

  invalidate() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      const { clientWidth, clientHeight } = this.element;
      this.draw(clientWidth, clientHeight, Math.min(window.devicePixelRatio, 2), this.view, this.covered());
      this.showLabels(this.view.camera, this.element.clientWidth, this.element.clientHeight);
      this.onDrawn?.();
    });
  }

  /** One picture; pixels of the page, and how many of the screen each of them is. */
  draw(width, height, ratio, view, covered) {
    if (!width || !height) return;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    view.place(width, height, this.clock.time, covered);
    this.actors.forEach((actor) => actor.show(this, view, width, height));
    this.renderer.render(this.scene, view.camera);
  }

  /** Pixels of what lies over the picture along its upper and its lower edge. */
  covered() {
    const { top, bottom } = this.element.getBoundingClientRect();
    const boxes = [...this.element.querySelectorAll(".hud")].map((one) => one.getBoundingClientRect());
    const isAbove = (box) => box.top + box.bottom < top + bottom;
    return [
      Math.max(0, ...boxes.filter(isAbove).map((box) => box.bottom - top)),
      Math.max(0, ...boxes.filter((box) => !isAbove(box)).map((box) => bottom - box.top)),
    ];
  }

  /** A picture of a view with its names, as the address of an image, for print. */
  picture(name, width, height) {
    const view = this.views.get(name);
    this.draw(width, height, SHARP, view);
    const sheet = document.createElement("canvas");
    [sheet.width, sheet.height] = [SHARP * width, SHARP * height];
    const context = sheet.getContext("2d");
    context.drawImage(this.canvas, 0, 0, sheet.width, sheet.height);
    context.scale(SHARP, SHARP);
    writeLabels(context, this.labels, view.camera, width, height);
    return sheet.toDataURL("image/jpeg", 0.9);
  }

  /** How large a picture of a view is, in words: its own width where that has a scale, else that of the grid. */
  scaleOf(name, width) {
    const { pixel } = this.views.get(name);
    return pixel ? `${written(pixel * width, 0)} m wide` : `grid ${this.ground.step} m`;
  }

  /** Metres per pixel where the view has a scale that holds all over the picture; else null. */
  get pixel() {
    return this.view.pixel ?? null;
  }

  /** The length in metres of a bar that is about so many pixels long; null where no scale holds. */
  scaleBar(pixels) {
    return this.pixel === null ? null : roundStep(this.pixel * pixels);
  }
}

/** A flight in the scene: its way, its aircraft, a plumb line to the ground and a dot by which it is found. */
class Actor {
  constructor(flight) {
    this.flight = flight;
    this.way = ribbonOf(flight);
    this.model = aircraftOf(flight.aircraft.span, flight.number > 0);
    this.plumb = new Line(new BufferGeometry().setFromPoints([new Vector3(), new Vector3()]), new LineBasicMaterial());
    this.plumb.frustumCulled = false;
    this.dot = new Mesh(new SphereGeometry(1, 12, 8), new MeshBasicMaterial({ transparent: true, depthTest: false }));
    this.size = this.model.scale.x;
    this.parts = [this.way, this.model, this.plumb, this.dot];
  }

  restyle() {
    this.way.restyle();
    const colour = this.flight.number === 0 ? themed("ink") : ghostColour(this.flight.number);
    this.plumb.material.color.set(colour);
    this.dot.material.color.set(colour);
    this.model.paint(colour);
  }

  show(scene, view, width, height) {
    for (const part of this.parts) part.visible = this.flight.visible;
    this.way.fit(width, height);
    const { time } = scene.clock;
    this.flight.position(time, this.model.position);
    this.flight.attitude(time, this.model.quaternion);
    this.model.scale.setScalar(this.size * scene.enlarged);
    const ends = this.plumb.geometry.getAttribute("position");
    this.model.position.toArray(ends.array, 0);
    ends.setXYZ(1, this.model.position.x, 0, this.model.position.z);
    ends.needsUpdate = true;
    const inside = view.name === "cockpit" && this.flight.number === 0;
    this.model.inside(inside);
    if (inside) this.model.scale.setScalar(this.size);
    this.plumb.visible &&= !inside;
    this.way.wings(view.name !== "cockpit");
    // A ghost that flies in one's own seat would hide everything.
    if (view.name === "cockpit" && !inside) this.model.visible &&= this.away(view.camera) > NEAR * scene.enlarged;
    this.showDot(scene, view, height, inside);
  }

  away(camera) {
    return camera.position.distanceTo(this.model.position);
  }

  /** Only where the aircraft itself is too small to be seen. */
  showDot(scene, view, height, inside) {
    const { camera } = view;
    const pixel = view.pixel ?? (2 * this.away(camera) * Math.tan((camera.fov * Math.PI) / 360)) / height;
    const seen = (this.flight.aircraft.span * scene.enlarged) / pixel;
    this.dot.visible = this.flight.visible && !inside && seen < 26;
    this.dot.material.opacity = seen < 14 ? 0.9 : 0.25;
    this.dot.position.copy(this.model.position);
    this.dot.scale.setScalar(DOT * pixel * (seen < 14 ? 1 : 0.6));
  }
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
