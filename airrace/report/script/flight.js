// One flight: its histories, read off at any instant.

import { Quaternion, Vector3 } from "three";
import { indexBefore, numbersOf } from "./numbers.js";

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
    this.aircraft = flight.aircraft;
    this.passings = flight.passings;
    this.time = numbersOf(flight.time);
    this.histories = new Map(Object.entries(flight.histories).map(([name, text]) => [name, numbersOf(text)]));
    this.count = this.time.length;
    this.duration = this.time[this.count - 1];
    this.visible = true;
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
    return placed(this.value("north", time), this.value("east", time), this.value("height", time), target);
  }

  /** Where it is at a sample, in the scene. */
  positionOf(i, target = new Vector3()) {
    return placed(this.history("north")[i], this.history("east")[i], this.history("height")[i], target);
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

  /** The number of the passing that was made last. */
  leg(time) {
    let number = 0;
    for (let i = 0; i < this.passings.length; i += 1) if (this.passings[i].time <= time + 1e-4) number = i;
    return number;
  }
}
