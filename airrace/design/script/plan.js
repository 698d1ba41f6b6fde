// The course from above, north up, and the hand on it: where pieces and their turns are while it moves, before the server
// knows, and a picture or placemarks below, placed by two points.

import { element, keptClear, marginalia, points, windOf } from "./surroundings.js";

const key = (path) => path.join(".");

const middle = (spots) => ({
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
class Hand {
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

// How the race time follows by the sensitivities of a session's latest optimum; null where it has none.
export function predicted(session, pieces) {
  if (!session.slopes) return null;
  let time = session.slope_time;
  const add = (slope, change) => {
    if (slope) time += change * slope[change > 0 ? 0 : 1];
  };
  for (const piece of pieces) {
    for (const spot of piece.spots) {
      const [before, slopes] = [session.slope_places[key(spot.path)], session.slopes[key(spot.path)] ?? {}];
      if (!before) return null;
      add(slopes.north, spot.north - before[0]);
      add(slopes.east, spot.east - before[1]);
    }
    if (piece.turn && key(piece.path) in session.slope_turns) {
      const change = ((piece.turn[1] - session.slope_turns[key(piece.path)] + 540) % 360) - 180;
      add((session.slopes[key(piece.path)] ?? {}).turn, change);
    }
  }
  return time;
}

// Where a piece would make the race faster, ms per metre to the north and to the east.
function gain(session, piece) {
  const sum = { north: 0, east: 0 };
  for (const spot of piece.spots) {
    const slopes = session.slopes?.[key(spot.path)] ?? {};
    for (const axis of ["north", "east"]) {
      const [up, down] = slopes[axis] ?? [0, 0];
      // To either side only as far as both agree on it.
      sum[axis] -= up * down > 0 ? 500 * (up + down) : 0;
    }
  }
  return sum;
}

const REST_MS = 150;
const GRIP = 14, LABEL = 12, ARROW = 46, TURN = 44, SNAP = 12;  // pixels
const LEAST_GAIN = 0.5;  // ms per metre, below which no arrow is drawn
const COLOURS = 8;

// From blue, unloaded, to red.
const colour = (share) => `hsl(${(230 * (1 - share)).toFixed(0)} 75% 48%)`;

export class Plan {
  constructor(svg, { ask, changed, chosen, click, tell }) {
    Object.assign(this, { svg, ask, changed, chosen, click, tell });
    this.state = null;
    this.hands = [];  // the last one may be on a piece still; those before it wait until the state shows what they did
    this.choice = null;
    this.arrows = true;
    this.view = null;  // middle and metres per pixel
    svg.addEventListener("pointerdown", (event) => this.press(event));
    svg.addEventListener("pointermove", (event) => this.drag(event));
    for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, (event) => this.release(event));
    svg.addEventListener("wheel", (event) => this.zoom(event), { passive: false });
    new ResizeObserver(() => this.draw()).observe(svg);
  }

  get hand() {
    return this.hands.at(-1) ?? null;
  }

  show(state) {
    const restarted = this.state && this.state.designer !== state.designer;  // its revisions count from 0 again
    this.state = state;
    this.hands = this.hands.filter(({ sent = Infinity }) => sent === Infinity || (!restarted && state.revision < sent));
    if (!this.view && this.pieces().some((one) => one.spots.length)) this.fit();
    this.draw();
  }

  // All pieces as they stand, some perhaps in the hand.
  pieces() {
    const held = new Map(this.hands.flatMap((hand) => hand.all()).map((piece) => [key(piece.path), piece]));
    return this.state.pieces.map((one) => held.get(key(one.path)) ?? one);
  }

  chosenPiece() {
    return this.pieces().find((one) => key(one.path) === this.choice) ?? null;
  }

  choose(path) {
    this.choice = path && key(path);
    this.chosen(this.chosenPiece());
    this.draw();
  }

  fit() {
    const lines = this.state.sessions.flatMap((session) => session.line ?? []);
    const spots = this.pieces().flatMap((one) => one.spots.map((spot) => [spot.north, spot.east]));
    const [norths, easts] = [0, 1].map((index) => [...lines, ...spots].map((one) => one[index]));
    const [low, high] = [norths, easts].map((all) => [Math.min(...all), Math.max(...all)]);
    const box = this.svg.getBoundingClientRect();
    const scale = Math.max((low[1] - low[0]) / (box.height - 120), (high[1] - high[0]) / (box.width - 120), 0.2);
    this.view = { north: (low[0] + low[1]) / 2, east: (high[0] + high[1]) / 2, scale };
    this.draw();
  }

  at(event) {
    const box = this.svg.getBoundingClientRect();
    const { north, east, scale } = this.view;
    return {
      north: north - (event.clientY - box.top - box.height / 2) * scale,
      east: east + (event.clientX - box.left - box.width / 2) * scale,
    };
  }

  // The nearest place of a piece within some pixels, else where the hand is.
  snapped(at) {
    const spots = this.pieces().flatMap((one) => one.spots);
    const far = (one) => Math.hypot(one.north - at.north, one.east - at.east) / this.view.scale;
    const nearest = spots.sort((one, other) => far(one) - far(other))[0];
    return nearest && far(nearest) < SNAP ? nearest : at;
  }

  press(event) {
    if (!this.view || event.button !== 0) return;
    this.svg.focus();
    const at = this.at(event);
    if (this.click(at)) return;
    const target = event.target.closest("[data-piece]");
    this.svg.setPointerCapture(event.pointerId);
    if (!target) {
      this.pan = { x: event.clientX, y: event.clientY, ...this.view };
      return;
    }
    const piece = this.pieces().find((one) => key(one.path) === target.dataset.piece);
    const corner = event.target.dataset.corner;
    const spot = corner && piece.spots.find((one) => key(one.path) === corner);
    const hand = new Hand(piece, at, { corner: spot ? spot.path : null, turning: "turn" in event.target.dataset,
      others: together(piece, this.pieces()) });
    this.hands.push(hand);
    this.choose(piece.path);
  }

  drag(event) {
    if (this.pan) {
      const { x, y, north, east, scale } = this.pan;
      this.view = { north: north + (event.clientY - y) * scale, east: east - (event.clientX - x) * scale, scale };
      this.draw();
    } else if (this.hand && this.hand.sent === undefined) {
      this.hand.move(this.at(event));
      this.hand.dirty = true;
      clearTimeout(this.rest);
      this.rest = setTimeout(() => this.send(), REST_MS);
      this.draw();
      this.changed();
    }
  }

  async release() {
    this.pan = null;
    clearTimeout(this.rest);
    const hand = this.hand;
    if (!hand || hand.sent !== undefined) return;
    hand.sent = Infinity;
    this.send();
    const answer = await hand.sending;
    hand.sent = answer?.revision ?? -1;  // it is held until the state shows what it has done
    if (answer && !answer.done) this.tell(`${hand.piece.path.at(-1)} stays where it was: ${answer.error}`);
    this.show(this.state);
    this.changed();
  }

  send() {
    const { hand } = this;
    if (!hand?.dirty) return;
    hand.dirty = false;
    hand.sending = this.ask("move", hand.message());
  }

  zoom(event) {
    event.preventDefault();
    if (!this.view) return;
    const [before, factor] = [this.at(event), Math.exp(Math.sign(event.deltaY) * 0.15)];
    this.view.scale *= factor;
    const after = this.at(event);
    this.view.north += before.north - after.north;
    this.view.east += before.east - after.east;
    this.draw();
  }

  draw() {
    if (!this.view || !this.state) return;
    const box = this.svg.getBoundingClientRect();
    const { north, east, scale } = this.view;
    const [width, height] = [box.width * scale, box.height * scale];
    this.svg.setAttribute("viewBox", `${east - width / 2} ${-north - height / 2} ${width} ${height}`);
    const pieces = this.pieces();
    this.svg.replaceChildren(
      ...this.below(),
      ...pieces.filter((piece) => piece.spots.length).flatMap((piece) => keptClear(piece, scale)),
      ...this.state.sessions.flatMap((session, index) => this.line(session, index)),
      ...pieces.filter((one) => one.spots.length).map((one) => this.piece(one)),
      ...(this.arrows ? pieces.flatMap((one) => this.arrow(one)) : []),
      marginalia(this.view, box, windOf(this.state)),
    );
  }

  below() {
    const below = this.state.background;
    if (below?.file !== this.belowFile) Object.assign(this, { belowFile: below?.file, unplaced: null });
    if (!below) return [];
    const { north, east, scale } = this.view;
    if (!below.lines.length && !below.placed && !this.unplaced) {
      this.unplaced = [scale, 0, north + 300 * scale, east - 400 * scale];
    }
    const [a, b, n, e] = below.placed ?? this.unplaced;
    const transform = `matrix(${a} ${b} ${-b} ${a} ${e} ${-n})`;
    this.placed = [a, b, n, e];
    if (!below.lines.length) {
      return [element("image", { href: `picture?${encodeURIComponent(below.file)}`, transform, opacity: 0.7 })];
    }
    const marks = below.lines.flatMap(([name, line]) => [
      element("polyline", { class: "mark", points: points(line.length > 1 ? line : [line[0], line[0]]),
        "stroke-width": line.length > 1 ? 1 : 6, "stroke-linecap": "round" }),
      this.label(name, line[0][0], line[0][1], "mark"),
    ]);
    return [element("g", { transform }, ...marks)];
  }

  line(session, index) {
    const lines = [];
    if (session.six_dof?.line?.length) {
      lines.push(element("g", { class: "six" }, element("polyline", { class: "line", points: points(session.six_dof.line) })));
    }
    if (!session.line) return lines;
    const old = session.answered !== undefined && !session.holds;
    const group = element("g", { class: `${old ? "old" : ""} ${index ? "second" : ""}`, "data-line": index });
    const [low, high] = session.n_z_range;
    const shade = (row) => Math.round((COLOURS * (row[2] - low)) / Math.max(high - low, 1e-9));
    for (let begin = 0; begin < session.line.length - 1; ) {
      let end = begin + 1;
      while (end < session.line.length - 1 && shade(session.line[end]) === shade(session.line[begin])) end += 1;
      const stroke = colour(shade(session.line[begin]) / COLOURS);
      group.append(element("polyline", { class: "line", points: points(session.line.slice(begin, end + 1)), stroke }));
      begin = end;
    }
    return [...lines, group];
  }

  piece(piece) {
    const { scale } = this.view;
    const chosen = key(piece.path) === this.choice;
    const names = ["piece", piece.kind.split(" ")[0], chosen ? "chosen" : ""];
    const group = element("g", { class: names.join(" "), "data-piece": key(piece.path) });
    const corners = piece.spots.map((one) => [one.north, one.east]);
    if (piece.closed) group.append(element("polygon", { class: "area", points: points(corners) }));
    else if (corners.length > 1 && piece.path[0] !== "gates") {
      group.append(element("polyline", { class: "stroke", points: points(corners) }));
      group.append(element("polyline", { class: "stroke", points: points(corners), style: "stroke:transparent;stroke-width:14" }));
    }
    for (const stroke of piece.strokes) {
      if (stroke.length > 1) group.append(element("polyline", { class: "stroke", points: points(stroke) }));
      else group.append(element("circle", { class: "post", cx: stroke[0][1], cy: -stroke[0][0], r: Math.max(2.5 * scale, 1) }));
    }
    const centre = middle(piece.spots);
    if (piece.path[0] !== "gates" && corners.length === 1) {
      group.append(element("circle", { class: "post", cx: centre.east, cy: -centre.north, r: 2.5 * scale }));
    }
    if (!piece.closed) {
      group.append(element("circle", { class: "grip", cx: centre.east, cy: -centre.north, r: GRIP * scale }));
    }
    const height = piece.path[0] === "obstacles" ? ` ${piece.entry.height_m} m` : "";
    group.append(this.label(`${piece.path.at(-1)}${height}`, centre.north, centre.east));
    if (chosen) this.handles(piece, group, centre);
    return group;
  }

  handles(piece, group, centre) {
    const { scale } = this.view;
    if (piece.spots.length > 1) {
      for (const one of piece.spots) {
        group.append(element("circle", { class: "handle", cx: one.east, cy: -one.north, r: 6 * scale,
          "data-corner": key(one.path) }));
      }
    }
    if (piece.turn || piece.spots.length > 1) {
      const angle = ((piece.turn?.[1] ?? 0) * Math.PI) / 180;
      const [x, y] = [centre.east + TURN * scale * Math.sin(angle), -centre.north - TURN * scale * Math.cos(angle)];
      group.append(element("line", { class: "stroke", x1: centre.east, y1: -centre.north, x2: x, y2: y }));
      group.append(element("circle", { class: "handle", cx: x, cy: y, r: 7 * scale, "data-turn": "" }));
    }
  }

  arrow(piece) {
    const session = this.state.sessions[0];
    if (piece.path[0] !== "gates" || !piece.spots.length || !session.holds) return [];
    const { north, east } = gain(session, piece);
    const size = Math.hypot(north, east);
    if (size < LEAST_GAIN) return [];
    const { scale } = this.view;
    const [un, ue, from] = [north / size, east / size, middle(piece.spots)];
    const at = (along, across) => [
      from.north + scale * (along * un - across * ue),
      from.east + scale * (along * ue + across * un),
    ];
    const head = points([at(ARROW, 0), at(ARROW - 9, 5), at(ARROW - 9, -5)]);
    const tip = at(ARROW + 6, 0);
    return [
      element("polyline", { class: "arrow", points: points([at(GRIP, 0), at(ARROW - 9, 0)]) }),
      element("polygon", { class: "arrow", points: head }),
      this.label(`${size.toFixed(size < 10 ? 1 : 0)} ms/m`, tip[0], tip[1], "slope"),
    ];
  }

  label(text, north, east, name = "") {
    const { scale } = this.view;
    const place = { x: east + 7 * scale, y: -north - 7 * scale, "font-size": LABEL * scale, class: name };
    return element("text", place, text);
  }
}

const find = (name) => document.getElementById(name);
const STEPS = [
  "Click a point of the picture whose place you know.",
  "Click where it belongs (a gate near by is taken exactly).",
  "Click a second point of the picture, far from the first.",
  "Click where that belongs.",
];

export class Placing {
  constructor(plan, ask) {
    Object.assign(this, { plan, ask });
    this.clicks = null;
    find("place").onclick = () => this.begin();
    find("background").onsubmit = (event) => {
      event.preventDefault();
      ask("background", { file: find("picture").value });
    };
  }

  begin() {
    this.clicks = this.plan.state?.background ? [] : null;
    this.tell();
  }

  tell() {
    find("placing").textContent = this.clicks ? STEPS[this.clicks.length] : "";
    find("plan").classList.toggle("placing", Boolean(this.clicks));
  }

  click(at) {
    if (!this.clicks) return false;
    this.clicks.push(this.clicks.length % 2 ? this.plan.snapped(at) : at);
    if (this.clicks.length === 4) {
      const placed = this.placed();
      this.clicks = null;
      if (placed) this.ask("background", { file: this.plan.state.background.file, placed });
    }
    this.tell();
    return true;
  }

  // The similarity by which both points come to their places: a turn and a scale after that by which they were shown.
  placed() {
    const [p, P, q, Q] = this.clicks.map(({ north, east }) => ({ re: east, im: north }));
    const less = (one, other) => ({ re: one.re - other.re, im: one.im - other.im });
    const times = (one, other) => ({ re: one.re * other.re - one.im * other.im, im: one.re * other.im + one.im * other.re });
    const [from, to] = [less(q, p), less(Q, P)];
    const size = from.re ** 2 + from.im ** 2;
    if (!size || !(to.re ** 2 + to.im ** 2)) return null;
    const turn = times(to, { re: from.re / size, im: -from.im / size });
    const [a, b, north, east] = this.plan.placed;
    const shown = times(turn, { re: a, im: -b });
    const origin = times(turn, less({ re: east, im: north }, p));
    return [shown.re, -shown.im, origin.im + P.im, origin.re + P.re];
  }
}
