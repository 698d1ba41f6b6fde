// The course from above with a flight in the colours of the time lost: a click moves the clock there, and the stretch that
// is shown is the part of the course that is seen.

const SVG = "http://www.w3.org/2000/svg";
const LETTERS = 11; // pixels of the screen, of names on the map
const DOT = 6; // pixels, of a flight
const AROUND = 1; // s, around a place that is clicked, within which the nearest one is sought
const LEAST = 120; // m, that are seen at least
const MARGIN = 0.12; // of what is seen, around it

export class LossMap {
  /**
   * @param figure holds the drawing; says which flight is coloured and which one is dashed, and where the drawing lies.
   * @param pairs by the numbers of the flights beside the first: their times at the places of the first, and back.
   */
  constructor(figure, flights, pairs, clock, stretch) {
    Object.assign(this, { flights, pairs, clock, stretch, svg: figure.querySelector("svg") });
    const { scale, margin, north, west, shown } = figure.dataset;
    Object.assign(this, { scale: Number(scale), margin: Number(margin), north: Number(north), west: Number(west) });
    this.shown = shown.split(" ").map(Number); // the flight in colours first
    const { width, height } = this.svg.viewBox.baseVal;
    this.whole = [0, 0, width, height];
    this.dots = this.shown.map((number) => this.dot(number));
    this.svg.addEventListener("click", (event) => this.click(event));
    stretch.watch(() => this.look());
    clock.watch(() => this.mark());
    new ResizeObserver(() => this.look()).observe(this.svg);
    this.look();
  }

  dot(number) {
    const dot = document.createElementNS(SVG, "circle");
    dot.setAttribute("class", number ? `dot ghost-${1 + ((number - 1) % 5)}` : "dot lead");
    this.svg.append(dot);
    return dot;
  }

  /** Where a flight is at a time, in the drawing. */
  place(flight, time) {
    const [x, y] = [flight.value("east", time) - this.west, this.north - flight.value("north", time)];
    return [this.margin + x * this.scale, this.margin + y * this.scale];
  }

  /** Move the clock to where the flight in colours is nearest to a click; of several laps, to the time nearest to now. */
  click(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    const [number] = this.shown;
    const flight = this.flights[number];
    const pair = this.pairs.get(number);
    const places = [];
    for (const time of flight.time) {
      const at = pair ? pair.back(time) : time;
      const [x, y] = this.place(flight, time);
      if (at >= this.stretch.from && at <= this.stretch.to) places.push([at, Math.hypot(x - point.x, y - point.y)]);
    }
    const nearest = Math.min(...places.map(([, away]) => away)) + DOT * this.pixel;
    const near = places.filter(([, away]) => away <= nearest).map(([at]) => at);
    if (!near.length) return;
    const now = this.clock.time;
    const begin = near.reduce((a, b) => (Math.abs(b - now) < Math.abs(a - now) ? b : a));
    // Of the places around that one, the nearest to the click.
    const around = places.filter(([at]) => Math.abs(at - begin) < AROUND);
    const [best] = around.reduce((a, b) => (b[1] < a[1] ? b : a));
    this.clock.stop();
    this.clock.set(best);
  }

  /** Show the part of the course on which the flights are in the stretch. */
  look() {
    const { from, to, kind } = this.stretch;
    let box = this.whole;
    if (kind !== "race") {
      const places = this.shown.flatMap((number) => {
        const times = this.flights[number].time.filter((time) => time >= from && time <= to);
        return Array.from(times, (time) => this.place(this.flights[number], time));
      });
      const [left, right] = [0, 1].map((end) => (end ? Math.max : Math.min)(...places.map(([x]) => x)));
      const [top, bottom] = [0, 1].map((end) => (end ? Math.max : Math.min)(...places.map(([, y]) => y)));
      const share = this.whole[3] / this.whole[2];
      const wide = Math.max(right - left, (bottom - top) / share, LEAST * this.scale) * (1 + 2 * MARGIN);
      const high = wide * share;
      box = [0.5 * (left + right - wide), 0.5 * (top + bottom - high), wide, high];
    }
    this.svg.setAttribute("viewBox", box.map((value) => value.toFixed(2)).join(" "));
    this.pixel = 1 / (this.svg.getScreenCTM()?.a || 1);
    this.svg.style.fontSize = `${LETTERS * this.pixel}px`;
    this.mark();
  }

  mark() {
    this.dots.forEach((dot, i) => {
      const [x, y] = this.place(this.flights[this.shown[i]], this.clock.time);
      dot.setAttribute("cx", x.toFixed(2));
      dot.setAttribute("cy", y.toFixed(2));
      dot.setAttribute("r", (DOT * this.pixel).toFixed(3));
    });
  }
}
