// What lies around the course on the plan: areas that must be kept clear, forbidden sides, and scale, north and wind.

const BAND = 22, EDGE = 14, BAR_MAX = 140, ARROW = 40, TEXT = 12, LINE = 18;  // pixels
const SPACE = "http://www.w3.org/2000/svg";

export const element = (name, attributes = {}, ...children) => {
  const node = document.createElementNS(SPACE, name);
  for (const [attribute, value] of Object.entries(attributes)) node.setAttribute(attribute, value);
  node.append(...children);
  return node;
};
export const points = (line) => line.map(([north, east]) => `${east.toFixed(2)},${(-north).toFixed(2)}`).join(" ");

// Where no wing may be: all within the distance of a crowd or an obstacle, as its outline drawn so broad.
function clearArea(piece) {
  const outlines = piece.path[0] === "crowd" ? [piece.spots.map((spot) => [spot.north, spot.east])] : piece.strokes;
  const attributes = { "stroke-width": 2 * piece.distance, style: "vector-effect: none" };
  return outlines.map((line) => (piece.closed || piece.path[0] === "obstacles"
    ? element("polygon", { class: "clear", points: points(line), ...attributes })
    : element("polyline", { class: "clear line-only", points: points(line.length > 1 ? line : [line[0], line[0]]), ...attributes })));
}

// The side of a safety line on which no flight may be, and the margin before it.
function forbiddenSide(piece, scale) {
  const [from, to] = piece.spots;
  const [north, east] = [to.north - from.north, to.east - from.east];
  const length = Math.hypot(north, east);
  if (!length) return [];
  const side = piece.entry.keep === "right" ? -1 : 1;  // to the right of the line, where the left is to be kept
  const at = (spot, across) => [spot.north - (side * across * east) / length, spot.east + (side * across * north) / length];
  const [near, far] = [-piece.distance, BAND * scale];
  return [element("polygon", { class: "clear line-only", points: points([at(from, near), at(to, near), at(to, far), at(from, far)]) })];
}

export function keptClear(piece, scale) {
  if (piece.path[0] === "safety_lines") return forbiddenSide(piece, scale);
  return piece.distance > 0 ? clearArea(piece) : [];
}

// The length of a scale that is at most so long: 1, 2 or 5 by a power of ten, m.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].find((digit) => digit * power <= most) * power;
}

// An arrow about a place of the screen, to an azimuth.
function arrow(x, y, scale, degrees, name) {
  const half = (ARROW / 2) * scale;
  const head = `0,${-half} ${-5 * scale},${-half + 10 * scale} ${5 * scale},${-half + 10 * scale}`;
  return element("g", { class: name, transform: `translate(${x} ${y}) rotate(${degrees})` },
    element("line", { x1: 0, y1: half, x2: 0, y2: -half + 8 * scale }), element("polygon", { points: head }));
}

// Scale, north and wind in the corners of the plan; `wind` is its speed with unit and where it comes from, degrees.
export function marginalia({ north, east, scale }, box, wind) {
  const [left, top] = [east - (box.width / 2 - EDGE) * scale, -north - (box.height / 2 - EDGE) * scale];
  const bottom = -north + (box.height / 2 - EDGE) * scale;
  const text = (content, x, y, anchor = "start") => element("text", { x, y, "font-size": TEXT * scale, "text-anchor": anchor }, content);
  const length = roundLength(BAR_MAX * scale);
  const tick = 4 * scale;
  const bar = `${left},${bottom - tick} ${left},${bottom} ${left + length},${bottom} ${left + length},${bottom - tick}`;
  const name = length >= 1000 ? `${length / 1000} km` : `${length} m`;
  const middle = top + (ARROW / 2) * scale;
  const marks = [
    element("polyline", { class: "scale", points: bar }),
    text(name, left + length + 6 * scale, bottom),
    arrow(left + 8 * scale, middle, scale, 0, "north"),
    text("N", left + 8 * scale, top + (ARROW + LINE) * scale, "middle"),
  ];
  if (wind) {
    const x = left + 60 * scale;
    marks.push(arrow(x, middle, scale, wind.from + 180, "wind"),
      text(`${wind.speed} from ${String(Math.round(wind.from)).padStart(3, "0")}°`, x + 28 * scale, middle + 4 * scale));
  }
  return element("g", { class: "marginalia" }, ...marks);
}

// The wind of a session, what-ifs before the file; null where there is none.
export function windOf(state) {
  const all = { ...(state.sessions[0].limits ?? {}), ...state.values };
  const [key, unit] = "environment.wind.speed_m_s" in all ? ["environment.wind.speed_m_s", "m/s"] : ["environment.wind.speed_kt", "kt"];
  return all[key] > 0 ? { speed: `${+all[key].toFixed(1)} ${unit}`, from: all["environment.wind.from_deg"] ?? 0 } : null;
}
