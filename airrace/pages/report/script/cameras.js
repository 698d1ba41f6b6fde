// Where the scene is looked at from: around, above, from the side, behind the aircraft, from its seat; and television:
// cameras at the gates and in the air, and a director who cuts between them. All of that follows from the flights and the
// instant alone, so a moment looks the same whenever it is shown.

import { Box3, Matrix4, OrthographicCamera, PerspectiveCamera, Quaternion, Vector3 } from "three";
import { placed } from "./flight.js";
import { extent } from "./values.js";

const UP = new Vector3(0, 1, 0);
const NOSE_BACK = new Quaternion().setFromRotationMatrix(
  // A camera looks along its -z with +x to the right; an aircraft's nose is x, its right wing y, its top -z.
  new Matrix4().makeBasis(new Vector3(0, 1, 0), new Vector3(0, 0, -1), new Vector3(-1, 0, 0)),
);
const STEADY = 0.45; // s, over which the chase camera's course is averaged
const LABEL = 22; // pixels, that a name takes above its place
const CHASE = { back: 26, up: 7, ahead: 30 }; // m

/** From anywhere around the course: one finger turns, two move. */
export class Orbit {
  /** `points` are to be seen; Vector3. */
  constructor(points) {
    this.name = "orbit";
    this.camera = new PerspectiveCamera(36, 1, 1, 60000);
    this.all = points;
    this.points = points;
    this.height = 1;
    this.home();
  }

  /** Show these points alone, or all for null. */
  focus(points) {
    this.points = points ?? this.all;
    this.home();
  }

  home() {
    const box = new Box3().setFromPoints(this.points);
    this.target = box.getCenter(new Vector3());
    this.azimuth = longAxis(box) + 0.55;
    this.elevation = 0.46;
    this.zoomed = 1;
    this.fitted = null;
  }

  turn(dx, dy) {
    this.azimuth -= 0.006 * dx;
    this.elevation = Math.min(Math.max(this.elevation + 0.006 * dy, 0.02), 1.55);
  }

  move(dx, dy) {
    const pace = (2 * this.fitted * this.zoomed * this.tangent) / this.height;
    const right = new Vector3(Math.cos(this.azimuth), 0, -Math.sin(this.azimuth));
    const ahead = new Vector3(-Math.sin(this.azimuth), 0, -Math.cos(this.azimuth));
    this.target.addScaledVector(right, -dx * pace).addScaledVector(ahead, dy * pace);
  }

  zoom(factor) {
    this.zoomed = Math.min(Math.max(this.zoomed * factor, 0.01), 6);
  }

  get tangent() {
    return Math.tan((this.camera.fov * Math.PI) / 360);
  }

  /** The direction from the target to the eye. */
  get outward() {
    const flat = Math.cos(this.elevation);
    return new Vector3(Math.sin(this.azimuth) * flat, Math.sin(this.elevation), Math.cos(this.azimuth) * flat);
  }

  /** Move the target to the middle of what is seen; the distance from which all of it is, in a share of the height. */
  fit(aspect, share) {
    const outward = this.outward;
    const right = new Vector3(Math.cos(this.azimuth), 0, -Math.sin(this.azimuth));
    const up = outward.clone().cross(right);
    const room = [0.88 * this.tangent * aspect, share * this.tangent];
    let distance = 0;
    for (let round = 0; round < 4; round += 1) {
      const spans = [right, up].map((axis, i) => {
        const ends = this.points.map((point) => {
          const from = point.clone().sub(this.target);
          return [from.dot(axis), from.dot(outward), room[i]];
        });
        const reach = (sense) => Math.max(...ends.map(([off, near, wide]) => (sense * off) / wide + near));
        const [plus, minus] = [reach(1), reach(-1)];
        this.target.addScaledVector(axis, 0.5 * (plus - minus) * room[i]);
        return 0.5 * (plus + minus);
      });
      distance = Math.max(...spans);
    }
    return distance;
  }

  place(width, height, time, covered) {
    const [[top, bottom], free] = freeOf(height, covered);
    this.height = height;
    this.camera.aspect = width / height;
    this.camera.setViewOffset(width, height, 0, 0.5 * (bottom - top), width, height);
    this.fitted ??= this.fit(width / height, Math.min(free / height, 0.8));
    this.camera.position.copy(this.target).addScaledVector(this.outward, this.fitted * this.zoomed);
    this.camera.position.y = Math.max(this.camera.position.y, 1);
    this.camera.lookAt(this.target);
    this.camera.updateProjectionMatrix();
  }
}

/** In parallel, from above with north up, or from the side that shows most: dragging moves. */
export class Parallel {
  constructor(name, points) {
    this.name = name;
    this.camera = new OrthographicCamera(-1, 1, 1, -1, 1, 60000);
    this.all = points;
    this.points = points;
    const side = longAxis(new Box3().setFromPoints(points));
    this.from = name === "above" ? UP.clone() : new Vector3(Math.sin(side), 0, Math.cos(side));
    this.up = name === "above" ? new Vector3(0, 0, -1) : UP.clone();
    this.right = this.up.clone().cross(this.from).normalize();
    this.home();
  }

  /** Show these points alone, or all for null. */
  focus(points) {
    this.points = points ?? this.all;
    this.home();
  }

  home() {
    this.target = new Box3().setFromPoints(this.points).getCenter(new Vector3());
    this.zoomed = 1;
  }

  turn(dx, dy) {
    this.move(dx, dy);
  }

  move(dx, dy) {
    this.target.addScaledVector(this.right, -dx * this.pixel).addScaledVector(this.up, dy * this.pixel);
  }

  zoom(factor) {
    this.zoomed = Math.min(Math.max(this.zoomed * factor, 0.02), 4);
  }

  place(width, height, time, covered) {
    const reach = (axis) => {
      const along = extent(this.points.map((point) => point.dot(axis)));
      return along[1] - along[0] + 20;
    };
    const [[top, bottom], free] = freeOf(height, covered);
    this.pixel = 1.06 * this.zoomed * Math.max(reach(this.right) / width, reach(this.up) / free);
    const across = 0.5 * width * this.pixel;
    // What is looked at stands in the middle of what is left free.
    const up = 0.5 * (height + top - bottom) * this.pixel;
    Object.assign(this.camera, { left: -across, right: across, top: up, bottom: up - height * this.pixel });
    this.camera.up.copy(this.up);
    this.camera.position.copy(this.target).addScaledVector(this.from, 8000);
    this.camera.lookAt(this.target);
    this.camera.updateProjectionMatrix();
  }
}

/** Behind the first flight and a little above it, on its course averaged over a moment. */
export class Chase {
  constructor(flight) {
    this.name = "chase";
    this.follows = true;
    this.camera = new PerspectiveCamera(55, 1, 0.5, 60000);
    this.flight = flight;
    this.home();
  }

  home() {
    this.aside = 0;
    this.above = 0;
    this.zoomed = 1;
  }

  turn(dx, dy) {
    this.aside -= 0.006 * dx;
    this.above = Math.min(Math.max(this.above + 0.004 * dy, -0.4), 1.2);
  }

  move(dx, dy) {
    this.turn(dx, dy);
  }

  zoom(factor) {
    this.zoomed = Math.min(Math.max(this.zoomed * factor, 0.3), 12);
  }

  place(width, height, time) {
    const place = this.flight.position(time);
    const course = this.course(time);
    const ahead = course.clone().applyAxisAngle(UP, this.aside);
    const right = ahead.clone().cross(UP);
    const upright = right.lengthSq() > 1e-6 ? right.normalize().cross(ahead).normalize() : UP.clone();
    const eye = place.clone().addScaledVector(ahead, -CHASE.back * this.zoomed * Math.cos(this.above));
    eye.addScaledVector(upright, this.zoomed * (CHASE.up + CHASE.back * Math.sin(this.above)));
    eye.y = Math.max(eye.y, 1.5);
    this.camera.aspect = width / height;
    this.camera.position.copy(eye);
    this.camera.up.copy(upright);
    this.camera.lookAt(place.addScaledVector(ahead, CHASE.ahead));
    this.camera.updateProjectionMatrix();
  }

  /** The way made over a moment around a time, as a direction. */
  course(time) {
    const [from, to] = [Math.max(time - STEADY, 0), Math.min(time + STEADY / 3, this.flight.duration)];
    const way = this.flight.position(to).sub(this.flight.position(from));
    return way.lengthSq() > 0 ? way.normalize() : new Vector3(0, 0, -1);
  }
}

/** From the seat of the first flight; dragging looks around. */
export class Cockpit {
  constructor(flight, model) {
    Object.assign(this, { name: "cockpit", follows: true, seat: true });
    this.camera = new PerspectiveCamera(72, 1, 0.15, 60000);
    this.flight = flight;
    this.model = model;
    this.home();
  }

  home() {
    this.aside = 0;
    this.above = 0;
  }

  turn(dx, dy) {
    this.aside = Math.min(Math.max(this.aside + 0.004 * dx, -2.4), 2.4);
    this.above = Math.min(Math.max(this.above + 0.004 * dy, -0.7), 1.4);
  }

  move(dx, dy) {
    this.turn(dx, dy);
  }

  zoom(factor) {
    this.camera.fov = Math.min(Math.max(this.camera.fov * factor, 25), 100);
  }

  place(width, height, time) {
    const attitude = this.flight.attitude(time);
    const eye = new Vector3(...this.model.eye).applyQuaternion(attitude).add(this.flight.position(time));
    const look = new Quaternion().setFromAxisAngle(UP, this.aside);
    look.multiply(new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), this.above));
    this.camera.aspect = width / height;
    this.camera.position.copy(eye);
    this.camera.quaternion.copy(attitude).multiply(NOSE_BACK).multiply(look);
    this.camera.updateProjectionMatrix();
  }
}

/** Pixels along the upper and the lower edge that are covered by what lies over the picture, and those that are free. */
function freeOf(height, covered = [0, 0]) {
  const [top, bottom] = [covered[0] + LABEL, covered[1]];
  return [[top, bottom], Math.max(height - top - bottom, 0.4 * height)];
}

/** The azimuth from which the box's longer side is seen. */
function longAxis(box) {
  const size = box.getSize(new Vector3());
  return size.x >= size.z ? 0 : Math.PI / 2;
}

const BEFORE = 1.8; // s before a gate, from which its camera is shown
const AFTER = 0.9; // s behind it
const SHORTEST = 1.4; // s of a shot; what would be shorter is left to the one before
const BETWEEN = ["aerial", "seat", "chase", "aerial", "wide"]; // shots between gates, in turn
const CLEAR = 13; // m, that a camera keeps from every way and every pylon
const CLOSE = 24; // m, from the way to a gate's camera: what is liked best
const HIDDEN = 3; // of the price of a place, against the other reasons: that pylons stand before the aircraft
const APART = 0.1; // s between the places of the ways that cameras keep clear of
const FIELD = 10; // m around the aircraft that a tracking camera shows, to each side
const COMPANY = 45; // m, within which other flights are kept in the picture
const HEIGHTS = [8, 26]; // m, of the cameras at gates in turn: against the horizon, and against water or land
const NARROWEST = 5; // degrees, of a camera's field
const WIDEST = 60;

/** All shots in their order: `{from, kind}` and, of a fixed camera, its `place`. */
export class Director {
  /** `elements` are those of the course, and `shore` tells the side of the land: there the wide camera stands. */
  constructor(flights, elements, shore, sun) {
    this.flights = flights;
    this.sun = sun;
    this.posts = elements.flatMap(({ posts }) => posts).map(([north, east]) => placed(north, east, 0));
    const [lead] = flights;
    const places = (flight) => Array.from({ length: Math.ceil(flight.duration / APART) + 1 }, (_, i) => flight.position(i * APART));
    this.places = flights.flatMap(places);
    const box = new Box3().setFromPoints(places(lead));
    const size = box.getSize(new Vector3());
    this.tower = box.getCenter(new Vector3()).setY(0.06 * Math.max(size.x, size.z) + 15);
    this.tower.add(new Vector3(shore.x, 0, shore.y).multiplyScalar(0.5 * Math.hypot(size.x, size.z) + 60));
    this.shots = this.cut(lead);
  }

  cut(lead) {
    const shots = [];
    const add = (from, kind, place = null) => {
      const last = shots[shots.length - 1];
      if (last && from - last.from < SHORTEST) return;
      shots.push({ from, kind, place });
    };
    const times = lead.passings.map(({ time }) => time).filter((time, i, all) => i === 0 || time > all[i - 1]);
    add(-Infinity, "wide", this.tower);
    let turn = 0;
    times.forEach((time, i) => {
      const last = i > 0 ? times[i - 1] + AFTER : -Infinity;
      if (i > 0 && time - BEFORE - last >= SHORTEST) {
        const kind = BETWEEN[turn % BETWEEN.length];
        add(last, kind, kind === "wide" ? this.tower : null);
        turn += 1;
      }
      add(Math.max(time - BEFORE, last), "gate", this.beside(lead, time, i));
    });
    if (!shots[1]) shots[0].kind = "aerial";
    return shots;
  }

  /** Where the camera of a gate stands: clear of all ways, near, and with the sun in its back. */
  beside(lead, time, number) {
    const at = lead.position(time);
    const ahead = courseOf(lead, time).setY(0);
    if (ahead.lengthSq() < 1e-6) ahead.set(0, 0, -1);
    ahead.normalize();
    const right = ahead.clone().cross(UP);
    let best = null;
    for (const side of [-1, 1])
      for (const far of [20, 32, 48])
        for (const on of [-12, 14, 34])
          for (const up of HEIGHTS) {
            const place = at.clone().setY(up).addScaledVector(right, side * far).addScaledVector(ahead, on);
            const clear = nearest(this.places, place);
            const posts = nearest(this.posts, place.clone().setY(0));
            if (clear < CLEAR || posts < 1.5 * CLEAR) continue;
            const glare = place.clone().sub(at).normalize().dot(this.sun);
            const price = Math.abs(clear - CLOSE) / CLOSE - 0.5 * glare + (on < 0 ? 0.35 : 0) + (up === HEIGHTS[number % 2] ? 0 : 0.4) + HIDDEN * this.hidden(lead, place, time);
            if (!best || price < best.price) best = { place, price };
          }
    return best?.place ?? at.clone().addScaledVector(right, 60).setY(at.y + 25);
  }

  /** The share of a gate's shot in which a pylon stands between a place and the aircraft. */
  hidden(lead, place, time) {
    const times = Array.from({ length: 16 }, (_, i) => time - BEFORE + (i / 15) * (BEFORE + AFTER));
    const behind = times.filter((moment) => {
      const sight = lead.position(moment).sub(place).setY(0);
      const length = sight.length();
      return this.posts.some((post) => {
        const off = post.clone().sub(place).setY(0);
        const along = off.dot(sight) / length;
        return along > 0 && along < length - 6 && Math.abs(off.x * sight.z - off.z * sight.x) / length < 4;
      });
    });
    return behind.length / times.length;
  }

  shot(time) {
    return this.shots.findLast(({ from }) => from <= time + 1e-9);
  }
}

/** What the director shows. */
export class Television {
  constructor(director, chase, cockpit) {
    Object.assign(this, { name: "tv", director, chase, cockpit, follows: true });
    this.own = new PerspectiveCamera(40, 1, 1, 60000);
    this.camera = this.own;
  }

  home() {}
  turn() {}
  move() {}
  zoom() {}

  /** Whether it is the seat that is shown. */
  get seat() {
    return this.camera === this.cockpit.camera;
  }

  place(width, height, time) {
    const { kind, place } = this.director.shot(time);
    const other = { chase: this.chase, seat: this.cockpit }[kind];
    this.camera = other?.camera ?? this.own;
    this.own.aspect = width / height;
    if (other) other.place(width, height, time);
    else if (place) this.track(place, time, kind === "wide" ? 3 : 1);
    else this.fly(time);
  }

  /** From a fixed place, turning and zooming with the aircraft and those that are near to it. */
  track(eye, time, wide) {
    const [lead, ...others] = this.director.flights;
    const at = lead.position(time + 0.04);
    const box = new Box3().expandByPoint(at);
    for (const one of others) {
      const place = one.position(time);
      if (one.visible && place.distanceTo(at) < COMPANY) box.expandByPoint(place);
    }
    const middle = box.getCenter(new Vector3()).lerp(at, 0.5);
    const field = wide * FIELD + 0.6 * middle.distanceTo(at) + 0.25 * box.getSize(new Vector3()).length();
    const angle = (2 * Math.atan(field / (eye.distanceTo(middle) * Math.min(1, this.own.aspect))) * 180) / Math.PI;
    this.own.fov = Math.min(Math.max(angle, NARROWEST), WIDEST);
    this.aim(eye, middle);
  }

  /** From the air, on a course that is smoother than the aircraft's. */
  fly(time) {
    const [lead] = this.director.flights;
    const course = courseOf(lead, time, 1.4).setY(0).normalize();
    const middle = [-1.2, -0.6, 0, 0.6, 1.2].map((shift) => lead.position(time + shift));
    const centre = middle.reduce((sum, one) => sum.add(one), new Vector3()).divideScalar(5).lerp(lead.position(time), 0.5);
    const right = course.clone().cross(UP);
    const eye = centre.clone().addScaledVector(course, -62).addScaledVector(right, 34).addScaledVector(UP, 26);
    this.own.fov = this.own.aspect < 1 ? 52 : 38;
    this.aim(eye, centre.addScaledVector(course, 18));
  }

  aim(eye, target) {
    this.own.position.copy(eye).setY(Math.max(eye.y, 2));
    this.own.up.copy(UP);
    this.own.lookAt(target);
    this.own.updateProjectionMatrix();
  }
}

function nearest(places, to) {
  return Math.sqrt(places.reduce((least, one) => Math.min(least, one.distanceToSquared(to)), Infinity));
}

/** The direction of a flight over a moment around a time. */
function courseOf(flight, time, moment = 0.2) {
  const way = flight.position(time + moment).sub(flight.position(time - moment));
  return way.lengthSq() > 1e-9 ? way.normalize() : new Vector3(0, 0, -1);
}
