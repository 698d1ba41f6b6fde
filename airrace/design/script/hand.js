// What the hand does with a piece: where its places and its turn are while it moves, before the server knows.

export const key = (path) => path.join(".");

export const middle = (spots) => ({
  north: spots.reduce((sum, one) => sum + one.north, 0) / spots.length,
  east: spots.reduce((sum, one) => sum + one.east, 0) / spots.length,
});

const turned = (one, about, radians) => {
  const [north, east] = [one.north - about.north, one.east - about.east];
  const [cos, sin] = [Math.cos(radians), Math.sin(radians)];
  return { ...one, north: about.north + north * cos - east * sin, east: about.east + north * sin + east * cos };
};

const SAME = 0.01; // m

// The pieces that stand where one stands: gates of two names that are one pylon move together.
export const together = (piece, pieces) => pieces.filter((one) => one.path[0] === "gates" && piece.path[0] === "gates"
  && one.spots.length === 1 && piece.spots.length === 1 && key(one.path) !== key(piece.path)
  && Math.hypot(one.spots[0].north - piece.spots[0].north, one.spots[0].east - piece.spots[0].east) < SAME);

// A movement of one piece: shifted, turned about its middle, or one corner of it moved. Others go along with a shift.
export class Hand {
  constructor(piece, at, { corner = null, turning = false, others = [] }) {
    Object.assign(this, { piece, from: at, corner, turning, others: turning ? [] : others });
    this.gesture = crypto.randomUUID();
    this.about = middle(piece.spots);
    this.shift = { north: 0, east: 0 };
    this.radians = 0;
  }

  move(at) {
    if (this.turning) {
      const angle = (one) => Math.atan2(one.east - this.about.east, one.north - this.about.north);
      this.radians = angle(at) - angle(this.from);
    } else {
      this.shift = { north: at.north - this.from.north, east: at.east - this.from.east };
    }
  }

  spot(one) {
    if (this.corner !== null && key(this.corner) !== key(one.path)) return one;
    const there = turned(one, this.about, this.radians);
    return { ...there, north: there.north + this.shift.north, east: there.east + this.shift.east };
  }

  // The pieces as they stand in the hand.
  all() {
    return [this.piece, ...this.others].map((one) => this.moved(one));
  }

  moved(piece = this.piece) {
    const whole = this.corner === null;
    const point = ([north, east]) => {
      const there = whole ? this.spot({ north, east }) : { north, east };
      return [there.north, there.east];
    };
    const degrees = (this.radians * 180) / Math.PI;
    return {
      ...piece,
      spots: piece.spots.map((one) => this.spot(one)),
      strokes: piece.strokes.map((stroke) => stroke.map(point)),
      turn: piece.turn && [piece.turn[0], (((piece.turn[1] + degrees) % 360) + 360) % 360],
    };
  }

  message() {
    const now = this.moved();
    const places = this.turning && now.spots.length === 1 ? [] : this.all().flatMap((one) => one.spots);
    const turns = this.turning && now.turn ? [{ path: now.path, degrees: now.turn[1] }] : [];
    return { gesture: this.gesture, places, turns };
  }
}

// How the race time follows by the sensitivities of a lane's latest optimum; null where it has none.
export function predicted(lane, pieces) {
  if (!lane.slopes) return null;
  let time = lane.slope_time;
  const add = (slope, change) => {
    if (slope) time += change * slope[change > 0 ? 0 : 1];
  };
  for (const piece of pieces) {
    for (const spot of piece.spots) {
      const [before, slopes] = [lane.slope_places[key(spot.path)], lane.slopes[key(spot.path)] ?? {}];
      if (!before) return null;
      add(slopes.north, spot.north - before[0]);
      add(slopes.east, spot.east - before[1]);
    }
    if (piece.turn && key(piece.path) in lane.slope_turns) {
      const change = ((piece.turn[1] - lane.slope_turns[key(piece.path)] + 540) % 360) - 180;
      add((lane.slopes[key(piece.path)] ?? {}).turn, change);
    }
  }
  return time;
}

// Where a piece would make the race faster, ms per metre to the north and to the east.
export function gain(lane, piece) {
  const sum = { north: 0, east: 0 };
  for (const spot of piece.spots) {
    const slopes = lane.slopes?.[key(spot.path)] ?? {};
    for (const axis of ["north", "east"]) {
      const [up, down] = slopes[axis] ?? [0, 0];
      // To either side only as far as both agree on it.
      sum[axis] -= up * down > 0 ? 500 * (up + down) : 0;
    }
  }
  return sum;
}
