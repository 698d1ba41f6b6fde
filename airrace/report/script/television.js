// Television: cameras at the gates and in the air, and a director who cuts between them. All follows from the flights and
// the instant alone, so a moment looks the same whenever it is shown.

import { Box3, PerspectiveCamera, Vector3 } from "three";
import { placed } from "./flight.js";
import { UP } from "./views.js";

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
