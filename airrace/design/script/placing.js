// A picture or placemarks below the course, placed by two points: what is clicked on it, and where that belongs.

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
      plan.unplaced = null;
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
