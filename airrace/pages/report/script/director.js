// Television: cameras beside the course and in the air, and a director who cuts between them so that every picture keeps the
// rules of framing. All of that follows from the flights, the instant and the shape of the picture alone.

import { Box3, PerspectiveCamera, Vector3 } from "three";
import { radiusOf } from "./course.js";
import { extremitiesOf, placed } from "./flight.js";
import { SHORTEST } from "./values.js";

const UP = new Vector3(0, 1, 0);

// The rules of framing.
const [SMALLEST, LARGEST] = [0.06, 0.25]; // of the picture's height, that the aircraft takes
const NEARLY = 1.3; // of the picture, within which the middle of a large aircraft is while a part of it is seen
const SIDEWAYS = 0.25; // of the speed, across the picture: from there on a flight has a direction in it

// Planning is stricter than the rules, for it looks at few instants.
const STRICT = { smallest: 0.064, largest: 0.24, edge: 0.94 };
const INSTANT = 0.05; // s between those that planning looks at

// Composition.
const LIKED = { gate: 0.13, beside: 0.12, aerial: 0.13, wide: 0.08 }; // of the picture's height, by kind of shot
const LEVEL = 0.8; // of half of the field: how far the horizon is from the middle at most
const LEANING = 1.45; // of half of the field: how far from the horizon the aircraft may be
const ASIDE = 0.6; // of half of the field: how far from the middle the aircraft is put in favour of others
const [COMPANY, FAR] = [120, 260]; // m, within which other flights are kept in the picture, and beyond which they do not count
const NEARBY = 400; // m, within which the nearest flight is looked for, from where both are seen
const CLOSE_BY = 30; // m, below which the direction to it turns too fast for a camera
const WIDEST = 0.7; // rad, of half of the field

// Places of cameras.
const BEFORE = 1.7; // s before a gate, from which its camera is shown
const AFTER = 0.9; // s behind it
const LONGEST = 7; // s of a shot, beyond which it is divided
const CLEAR = 13; // m, that a fixed camera keeps from every way, and half as much again from every pylon
const CLOSE = 24; // m, from the way to a gate's camera: what is liked best
const APART = 0.1; // s between the places of the ways that cameras keep clear of
const HEIGHTS = [8, 26]; // m, of the cameras at gates in turn: against the horizon, and against water or land
const BESIDE_RIVAL = 0.25; // rad, of a camera beyond the first flight from a rival, so that one does not hide the other
const ACROSS = [-Math.PI / 2, -0.9, 0.9, Math.PI / 2]; // rad, of cameras that see how far apart both are
const [LOW, HIGH] = [[6, 14], 34]; // m, of cameras in the air above the first flight
const OUT = 58; // m, from the aircraft to a camera in the air
const LOWEST = 3; // m, of any camera above the ground
const BULK = 0.6; // m, around the middle of the fuselage, that a pylon must not cover
const PASSING = 0.1; // s around a passing, in which no pylon may stand before the aircraft
const GLIMPSE = 0.01; // s between instants at which that is looked at

// Prices by which shots are chosen: what breaks a rule is worse than anything that is a matter of taste.
const BROKEN = 10; // once, and for every instant
const JUMP = 20; // across the line of action
const HIDDEN = 12; // for a shot in which pylons or others stand before the aircraft all along
const [SMALL, DISTANT] = [1.5, 0.085]; // for one in which it is smaller than that share of the picture's height all along
const TWICE = 0.5; // the same kind of shot again
const TURN = ["aerial", "wide", "aerial", "chase", "beside"]; // kinds between gates that are liked in turn
const LIKED_IN_TURN = 0.4;
const ALONE = { replay: 40, race: 3 }; // for a shot in which a flight nearby is out of the picture all along
const ALIGNED = 15; // for a replay in which one flight is right before or behind the other all along

/**
 * What the rules ask of a picture.
 *
 * @param camera placed.
 * @param flight that is shown.
 * @param edge share of the picture that counts.
 * @returns `size` of the aircraft in shares of the picture's height; whether it is `inside`; whether the next `gate` and the
 *   `horizon` are seen; `across`: which share of its speed goes to the right.
 */
function framingOf(camera, flight, time, edge = 1) {
  camera.updateMatrixWorld(true);
  const attitude = flight.attitude(time);
  const middle = flight.position(time);
  const box = new Box3();
  let inside = true;
  for (const point of extremitiesOf(flight.aircraft.span)) {
    const seen = point.applyQuaternion(attitude).add(middle).project(camera);
    inside &&= isSeen(seen, edge);
    box.expandByPoint(seen);
  }
  const size = Math.max((box.max.y - box.min.y) / 2, ((box.max.x - box.min.x) / 2) * camera.aspect);
  const next = flight.passings.find((passing) => passing.time > time + 1e-3) ?? flight.passings.at(-1);
  const gate = flight.position(next.time).project(camera);
  const levels = [-edge, edge].flatMap((x) => [-edge, edge].map((y) => new Vector3(x, y, 0.5).unproject(camera).y - camera.position.y));
  const right = new Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
  return {
    size,
    inside,
    gate: isSeen(gate, edge),
    horizon: Math.min(...levels) < 0 && Math.max(...levels) > 0,
    across: courseOf(flight, time).dot(right),
  };
}

/** Whether a place, as a camera projects it, lies within the share of the picture that counts. */
function isSeen({ x, y, z }, edge) {
  return z < 1 && Math.abs(x) < edge && Math.abs(y) < edge;
}

/** Whether any of the company, wholly or in part in a picture, takes more of its height than an aircraft should. */
function crowded(camera, company, time) {
  const share = (away) => 2 * Math.tan((camera.fov * Math.PI) / 360) * away;
  return company.some((flight) => {
    const place = flight.position(time);
    const large = flight.visible && flight.aircraft.span > LARGEST * share(place.distanceTo(camera.position));
    return large && isSeen(place.project(camera), NEARLY);
  });
}

/** Which rules a picture breaks, by name. */
function brokenRules({ size, inside, gate, horizon }, { smallest = SMALLEST, largest = LARGEST } = {}) {
  const broken = [];
  if (size < smallest) broken.push("small");
  if (size > largest) broken.push("large");
  if (!inside) broken.push("outside");
  if (!gate && !horizon) broken.push("lost");
  return broken;
}

/** Whether two shots show the aircraft flying in opposite directions at their cut. */
function jumps(before, after) {
  return before * after < 0 && Math.min(Math.abs(before), Math.abs(after)) > SIDEWAYS;
}

/** Chooses the shots for pictures of one shape: `{from, kind, place(camera, time)}` in their order. */
export class Director {
  /**
   * `elements` are those of the course, and `shore` tells the side of the land: there the wide camera stands. The first flight is
   * followed from `begin` to `end`.
   */
  constructor(flights, elements, shore, sun, chase, begin = 0, end = flights[0].duration) {
    Object.assign(this, { flights, sun, chase, begin, end, plans: new Map() });
    this.posts = elements.flatMap(({ posts, top }) => posts.map(([north, east]) => placed(north, east, top)));
    const [lead] = flights;
    const places = (flight) => Array.from({ length: Math.ceil(flight.duration / APART) + 1 }, (_, i) => flight.position(i * APART));
    this.places = flights.flatMap(places);
    const box = new Box3().setFromPoints(places(lead));
    const size = box.getSize(new Vector3());
    this.tower = box.getCenter(new Vector3()).setY(0.06 * Math.max(size.x, size.z) + 15);
    this.tower.add(new Vector3(shore.x, 0, shore.y).multiplyScalar(0.5 * Math.hypot(size.x, size.z) + 60));
  }

  /** The shots of a race in pictures so many times as wide as high, for the flights that are shown; made when first asked for. */
  shots(aspect) {
    const key = [aspect.toFixed(2), ...this.flights.map(({ visible }) => visible)].join();
    if (!this.plans.has(key)) this.plans.set(key, this.plan(aspect));
    return this.plans.get(key);
  }

  shot(time, aspect) {
    return this.shots(aspect).findLast(({ from }) => from <= time + 1e-9);
  }

  /** The shot of what is shown again, see `swingsOf`: the best by itself that keeps the other flight in sight, too. */
  replay({ from, to, flight, shift }, aspect) {
    const passings = this.flights[0].passings.map(({ time }) => time).filter((time) => time >= from && time < to);
    const rival = this.flights[flight].earlier(shift);
    const piece = { from, to, passings, rival, company: [rival], alone: ALONE.replay, again: true };
    const shots = this.priced(new PerspectiveCamera(40, aspect, 1, 60000), piece, 0);
    return shots.reduce((best, shot) => (shot.price < best.price ? shot : best));
  }

  /** The candidates of a piece with their prices. */
  priced(camera, piece, number) {
    return this.candidates(piece, number).map((shot) => ({ ...shot, ...this.priceOf(camera, shot, piece) }));
  }

  /** Choose a shot for every piece so that all of their prices, and those of the cuts between them, are least in sum. */
  plan(aspect) {
    const camera = new PerspectiveCamera(40, aspect, 1, 60000);
    const pieces = this.pieces();
    let ways = [];
    pieces.forEach((piece, number) => {
      ways = this.priced(camera, piece, number).map((shot) => {
        if (!ways.length) return { price: shot.price, shots: [shot] };
        const reached = ways.map(({ price, shots }) => price + shot.price + cutPrice(shots.at(-1), shot));
        const best = reached.indexOf(Math.min(...reached));
        return { price: reached[best], shots: [...ways[best].shots, shot] };
      });
    });
    const { shots } = ways.reduce((best, way) => (way.price < best.price ? way : best));
    return shots.map((shot, i) => ({ ...shot, from: i === 0 ? -Infinity : pieces[i].from }));
  }

  /**
   * The pieces of the race between cuts: `{from, to, passings, rival, company, alone}`: times of the gates that are passed, who is to
   * be seen, too, who is kept in the picture while near, and the price of a picture without the rival.
   */
  pieces() {
    const [lead, ...others] = this.flights;
    const finish = this.end;
    const times = lead.passings.map(({ time }) => time).filter((time, i, all) => time <= finish + 1e-9 && (i === 0 || time > all[i - 1]));
    const cuts = [this.begin];
    const cut = (time, room) => {
      if (time - cuts.at(-1) >= SHORTEST && room - time >= SHORTEST) cuts.push(time);
    };
    times.forEach((time, i) => {
      cut(time - BEFORE, finish);
      const next = i + 1 < times.length ? times[i + 1] - BEFORE : finish;
      cut(time + AFTER, next);
    });
    const ends = [...cuts.slice(1), finish];
    return cuts.flatMap((from, i) => {
      const parts = Math.max(1, Math.min(Math.ceil((ends[i] - from) / LONGEST), Math.floor((ends[i] - from) / SHORTEST)));
      return Array.from({ length: parts }, (_, part) => {
        const [begin, end] = [part, part + 1].map((share) => from + ((ends[i] - from) * share) / parts);
        const last = end > finish - 1e-9; // which the finish belongs to
        const passings = times.filter((time) => time >= begin - 1e-9 && (last || time < end));
        return { from: begin, to: end, passings, rival: this.nearby(0.5 * (begin + end)), company: others, alone: ALONE.race };
      });
    });
  }

  /** The flight that is nearest to the first one, or null where none is near enough to be seen with it. */
  nearby(time) {
    const [lead, ...others] = this.flights;
    const away = (flight) => flight.position(time).distanceTo(lead.position(time));
    const near = others.filter((flight) => flight.visible && away(flight) < NEARBY);
    return near.reduce((nearest, flight) => (nearest === null || away(flight) < away(nearest) ? flight : nearest), null);
  }

  /** The direction over ground from a rival to the first flight, by time; where they come close, always that of their largest distance. */
  line(piece, rival) {
    const at = (time) => this.centre(time).sub(this.centre(time, rival)).setY(0);
    const count = Math.ceil((piece.to - piece.from) / INSTANT);
    const lines = Array.from({ length: count + 1 }, (_, i) => at(piece.from + ((piece.to - piece.from) * i) / count));
    const steady = lines.reduce((longest, line) => (line.length() > longest.length() ? line : longest));
    return lines.every((line) => line.length() > CLOSE_BY) ? at : () => steady.clone();
  }

  /** Shots that a piece may have, which may have a `rival` to be kept in sight: `{kind, taste, place(camera, time)}`. */
  candidates(piece, number) {
    const atGate = piece.passings.length > 0;
    const moment = atGate ? piece.passings[0] : 0.5 * (piece.from + piece.to);
    const { rival, company, again } = piece;
    const shots = [];
    const add = (kind, taste, place) => shots.push({ kind, taste, place });
    const liked = (kind) => (atGate ? 1 : kind === TURN[number % TURN.length] ? 0 : LIKED_IN_TURN);
    for (const { eye, price } of this.beside(moment, number)) {
      const kind = atGate ? "gate" : "beside";
      add(kind, (atGate ? 0 : liked(kind)) + price, (camera, time) => this.aim(camera, eye, time, LIKED[kind], company, again));
    }
    for (let turn = 0; turn < 8; turn += 1)
      for (const up of LOW) {
        const offset = new Vector3(Math.sin((turn * Math.PI) / 4) * OUT, up, Math.cos((turn * Math.PI) / 4) * OUT);
        const glare = offset.clone().normalize().dot(this.sun);
        const place = (camera, time) => this.aim(camera, this.centre(time).add(offset), time, LIKED.aerial, company, again);
        add("aerial", liked("aerial") - 0.3 * glare, place);
      }
    // In line with a rival both are seen also in an upright picture, one beyond the other.
    // Across that line a replay shows how the gap grows.
    const line = rival && this.line(piece, rival);
    for (const turn of rival ? [-BESIDE_RIVAL, BESIDE_RIVAL, ...(again ? ACROSS : [])] : [])
      for (const up of again ? [...LOW, HIGH] : LOW) {
        const place = (camera, time) => {
          const off = line(time).normalize().applyAxisAngle(UP, turn).multiplyScalar(OUT);
          this.aim(camera, this.centre(time).add(off.setY(up)), time, LIKED.aerial, company, again);
        };
        add("aerial", liked("aerial"), place);
      }
    add("wide", liked("wide"), (camera, time) => this.aim(camera, this.tower, time, LIKED.wide, company, again));
    add("chase", liked("chase"), (camera, time) => this.chase.follow(camera, time));
    return shots;
  }

  /** Places for a camera that stands beside the way at an instant: clear of all ways and of pylons, and with a price. */
  beside(time, number) {
    const [lead] = this.flights;
    const at = lead.position(time);
    const ahead = courseOf(lead, time).setY(0);
    if (ahead.lengthSq() < 1e-6) ahead.set(0, 0, -1);
    ahead.normalize();
    const right = ahead.clone().cross(UP);
    const found = [];
    for (const side of [-1, 1])
      for (const far of [20, 32, 48])
        for (const on of [-40, -12, 14, 34, 60])
          for (const up of HEIGHTS) {
            const eye = at.clone().setY(up).addScaledVector(right, side * far).addScaledVector(ahead, on);
            const clear = nearest(this.places, eye);
            const posts = nearest(this.posts, eye, 0);
            if (clear < CLEAR || posts < 1.5 * CLEAR) continue;
            const glare = eye.clone().sub(at).normalize().dot(this.sun);
            const price = Math.abs(clear - CLOSE) / CLOSE - 0.5 * glare + (on < 0 ? 0.35 : 0) + (up === HEIGHTS[number % 2] ? 0 : 0.4);
            found.push({ eye, price });
          }
    return found;
  }

  /** The price of a shot in a piece, and which share of the speed goes to the right at both of its ends. */
  priceOf(camera, shot, piece) {
    const [lead] = this.flights;
    const count = Math.max(Math.ceil((piece.to - piece.from) / INSTANT), 2);
    let [broken, hidden, distant, alone, apart, aligned] = [0, 0, 0, 0, 0, 0];
    const across = [];
    for (let i = 0; i <= count; i += 1) {
      const time = piece.from + ((piece.to - piece.from) * i) / count;
      shot.place(camera, time);
      const framing = framingOf(camera, lead, time, STRICT.edge);
      if (brokenRules(framing, STRICT).length) broken += 1;
      if (this.hidden(camera.position, lead.position(time)) || crowded(camera, piece.company, time)) hidden += 1;
      if (framing.size < DISTANT) distant += 1;
      if (piece.rival && !isSeen(piece.rival.position(time).project(camera), STRICT.edge)) alone += 1;
      if (piece.again) {
        const gap = piece.rival.position(time).sub(lead.position(time));
        const sight = lead.position(time).sub(camera.position).normalize();
        apart += gap.length();
        aligned += gap.length() - gap.cross(sight).length(); // what the picture does not show of the distance
      }
      across.push(framing.across);
    }
    broken += this.hiddenPassings(camera, shot, piece);
    const dull = (HIDDEN * hidden + SMALL * distant + piece.alone * alone) / (count + 1) + (apart && (ALIGNED * aligned) / apart);
    const price = shot.taste + dull + (broken ? BROKEN * (1 + broken) : 0);
    return { price, begins: across[0], ends: across.at(-1) };
  }

  /** At how many of its passings a shot shows a pylon before the aircraft. */
  hiddenPassings(camera, shot, piece) {
    const [lead] = this.flights;
    const steps = Math.round(PASSING / GLIMPSE) + 1;
    const passings = lead.passings.filter(({ time }) => time > piece.from - PASSING && time < piece.to + PASSING);
    return passings.filter((passing) => {
      for (let step = -steps; step <= steps; step += 1) {
        const time = passing.time + step * GLIMPSE;
        if (time < piece.from || time > piece.to) continue;
        shot.place(camera, time);
        if (this.hidden(camera.position, lead.position(time))) return true;
      }
      return false;
    }).length;
  }

  /** Whether a pylon stands between an eye and the aircraft. */
  hidden(eye, aircraft) {
    const sight = aircraft.clone().sub(eye);
    const length = Math.hypot(sight.x, sight.z);
    return this.posts.some((post) => {
      const off = post.clone().sub(eye);
      const along = (off.x * sight.x + off.z * sight.z) / length;
      const aside = Math.abs(off.x * sight.z - off.z * sight.x) / length;
      const height = eye.y + (sight.y * along) / length;
      return along > 0 && along < length && height < post.y + BULK && aside < BULK + radiusOf(height, post.y);
    });
  }

  /** A place that goes with a flight, the first one by default, on a way smoother than its own. */
  centre(time, flight = this.flights[0]) {
    const middle = [-1.2, -0.6, 0, 0.6, 1.2].map((shift) => flight.position(time + shift));
    return middle.reduce((sum, place) => sum.add(place), new Vector3()).divideScalar(middle.length).lerp(flight.position(time), 0.5);
  }

  /** Look from an eye so that the aircraft has its size, or `again` in favour of company the least one, company near to it is seen, and so is the horizon, as far as can be. */
  aim(camera, eye, time, liked, company, again = false) {
    const [lead] = this.flights;
    const from = eye.clone().setY(Math.max(eye.y, LOWEST));
    const sight = lead.position(time).sub(from);
    const distance = sight.length();
    const fieldOf = (size) => Math.atan(lead.aircraft.span / (2 * distance * size));
    const middle = sight.clone();
    let members = 1;
    for (const flight of company) {
      const off = flight.position(time).sub(from);
      const counts = flight.visible ? Math.min(Math.max((FAR - off.distanceTo(sight)) / (FAR - COMPANY), 0), 1) : 0;
      middle.addScaledVector(off, counts);
      members += counts;
    }
    middle.divideScalar(members);
    const elevation = Math.asin(sight.y / distance);
    const across = again ? Math.min(1, camera.aspect) : 1;
    const shared = Math.min((2.2 * sight.angleTo(middle)) / across, fieldOf(again ? STRICT.smallest : DISTANT));
    const wanted = Math.max(fieldOf(liked), Math.abs(elevation) / LEANING, shared);
    const half = Math.max(Math.min(wanted, fieldOf(1.15 * STRICT.smallest), WIDEST), fieldOf(0.8 * STRICT.largest));
    const apart = sight.angleTo(middle);
    const look = sight.clone().lerp(middle, apart > 0 ? Math.min(1, (ASIDE * half * Math.min(1, camera.aspect)) / apart) : 0);
    const level = Math.hypot(look.x, look.z);
    const pitch = Math.min(Math.max(Math.atan2(look.y, level), -LEVEL * half), LEVEL * half);
    camera.fov = (360 * half) / Math.PI;
    camera.position.copy(from);
    camera.up.copy(UP);
    camera.lookAt(look.setY(level * Math.tan(pitch)).add(from));
    camera.updateProjectionMatrix();
  }
}

/** The price of a cut from a shot to another. */
function cutPrice(before, after) {
  return (jumps(before.ends, after.begins) ? JUMP : 0) + (before.kind === after.kind && after.kind !== "gate" ? TWICE : 0);
}

/** What the director shows. */
export class Television {
  /** `pursuing` are directors for those who finish after the first flight, see `pursuitsOf`. */
  constructor(director, pursuing = []) {
    Object.assign(this, { name: "tv", director, pursuing, follows: true, onAir: true });
    this.camera = new PerspectiveCamera(40, 1, 1, 60000);
  }

  home() {}
  turn() {}
  move() {}
  zoom() {}

  place(width, height, time) {
    this.camera.aspect = width / height;
    this.shot(time, width / height).place(this.camera, time);
  }

  shot(time, aspect) {
    return this.directorAt(time).shot(time, aspect);
  }

  /** Who directs at an instant. */
  directorAt(time) {
    return this.pursuing.findLast(({ begin, flights: [flight] }) => begin < time && flight.visible) ?? this.director;
  }

  /** Nobody hangs in the air who has finished while others fly. */
  shows(flight, time) {
    return time <= flight.duration || this.directorAt(time).flights[0] === flight;
  }

  /** How a picture of the race keeps the rules: see `framingOf`; with those that it breaks, and whether a pylon hides the aircraft. */
  framing(width, height, time) {
    this.place(width, height, time);
    const director = this.directorAt(time);
    const [lead] = director.flights;
    const framing = framingOf(this.camera, lead, time);
    const hidden = director.hidden(this.camera.position, lead.position(time));
    return { ...framing, broken: brokenRules(framing), hidden, eye: this.camera.position.toArray() };
  }
}

/** The same of what is shown again, where the other flight begins the leg at the instant at which the first one does. */
export class Replay extends Television {
  constructor(director, swing, number) {
    super(director);
    Object.assign(this, { name: `replay ${number + 1}`, swing, shots: new Map() });
  }

  shows(flight, time) {
    const takesPart = flight.number === 0 || flight.number === this.swing.flight;
    return takesPart && time + this.shiftOf(flight) <= flight.duration + 1e-3;
  }

  shiftOf(flight) {
    return flight.number === this.swing.flight ? this.swing.shift : 0;
  }

  shot(_, aspect) {
    const key = aspect.toFixed(2);
    if (!this.shots.has(key)) this.shots.set(key, this.director.replay(this.swing, aspect));
    return this.shots.get(key);
  }
}

/** The least distance of places from one of them; with a height, in plan, as if all were that high. */
function nearest(places, to, height = null) {
  const from = height === null ? to : to.clone().setY(height);
  const off = (place) => (height === null ? place : place.clone().setY(height)).distanceToSquared(from);
  return Math.sqrt(places.reduce((least, place) => Math.min(least, off(place)), Infinity));
}

/** The direction of a flight over a moment around a time. */
function courseOf(flight, time, moment = 0.2) {
  const way = flight.position(time + moment).sub(flight.position(time - moment));
  return way.lengthSq() > 1e-9 ? way.normalize() : new Vector3(0, 0, -1);
}
