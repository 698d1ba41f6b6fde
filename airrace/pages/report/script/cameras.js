// Where the scene is looked at from: around, above, from the side, behind the aircraft, from its seat. All of that follows from
// the flights and the instant alone, so a moment looks the same whenever it is shown.

import { Box3, Matrix4, OrthographicCamera, PerspectiveCamera, Quaternion, Vector3 } from "three";
import { extent } from "./values.js";

const UP = new Vector3(0, 1, 0);
const NOSE_BACK = new Quaternion().setFromRotationMatrix(
  // A camera looks along its -z with +x to the right; an aircraft's nose is x, its right wing y, its top -z.
  new Matrix4().makeBasis(new Vector3(0, 1, 0), new Vector3(0, 0, -1), new Vector3(-1, 0, 0)),
);
const STEADY = 0.45; // s, over which the chase camera's course is averaged
const LABEL = 22; // pixels, that a name takes above its place
const CHASE = { back: 32, up: 8, ahead: 30, field: 55 }; // m, and degrees

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
    this.camera = new PerspectiveCamera(CHASE.field, 1, 0.5, 60000);
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
    this.camera.aspect = width / height;
    this.follow(this.camera, time, this);
  }

  /** Place any camera so, by default as it stands before anybody turns or zooms. */
  follow(camera, time, { aside, above, zoomed } = { aside: 0, above: 0, zoomed: 1 }) {
    const place = this.flight.position(time);
    const ahead = this.course(time).applyAxisAngle(UP, aside);
    const right = ahead.clone().cross(UP);
    const upright = right.lengthSq() > 1e-6 ? right.normalize().cross(ahead).normalize() : UP.clone();
    const eye = place.clone().addScaledVector(ahead, -CHASE.back * zoomed * Math.cos(above));
    eye.addScaledVector(upright, zoomed * (CHASE.up + CHASE.back * Math.sin(above)));
    eye.y = Math.max(eye.y, 1.5);
    camera.fov = CHASE.field;
    camera.position.copy(eye);
    camera.up.copy(upright);
    camera.lookAt(place.addScaledVector(ahead, CHASE.ahead));
    camera.updateProjectionMatrix();
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
