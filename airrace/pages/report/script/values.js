// Values as the page carries them and as people see them: numbers, and the colours of theme and scales.

import { Color } from "three";

/** 32-bit floats, least significant byte first, written as base64: a Float32Array. */
export function numbersOf(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i += 1) bytes[i] = letters.charCodeAt(i);
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true));
}

/** A number with so many digits behind the point; a dash where there is none, and no negative zero. */
export function written(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** A difference, always with its sign. */
export function signed(value, digits) {
  const text = written(value, digits);
  return value > 0 && Number(value.toFixed(digits)) > 0 ? `+${text}` : text;
}

/** The least and the largest of the finite numbers; null where there are none. */
export function extent(values) {
  let least = Infinity;
  let largest = -Infinity;
  for (const value of values) {
    if (value < least) least = value;
    if (value > largest) largest = value;
  }
  return least <= largest ? [least, largest] : null;
}

/** The largest of 1, 2 and 5 times a power of ten that is not larger than a number. */
export function roundStep(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((one) => one * power).find((step) => step <= value * (1 + 1e-9));
}

/** The index of the last of rising numbers that is not larger than one, but never the very last. */
export function indexBefore(numbers, value) {
  let low = 0;
  let high = numbers.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= value) low = middle;
    else high = middle;
  }
  return low;
}

/**
 * For every other flight its number, and functions from the first flight's time: to the time lost until there, to the time
 * at which the other one is there, and from that one back, s.
 */
export function differencesOf(differences) {
  return differences.map(({ flight, time, difference, legs, common }) => {
    const [times, lost] = [numbersOf(time), numbersOf(difference)];
    const others = times.map((value, i) => value + lost[i]);
    const at = (now) => interpolated(times, lost, now);
    return { flight, legs, common, at, there: (now) => now + at(now), back: (then) => interpolated(others, times, then) };
  });
}

const [BEFORE, BEHIND] = [0.8, 0.6]; // s, that are shown again before a leg and behind it
const [SLOW, LONG] = [0.4, 12]; // of real time, in which that is, but faster where it would take longer than so many s
const [COSTLY, BACK] = [0.01, 0.3]; // s, from which on a leg is shown again, and one that wins back what another costs

/**
 * The legs on which the gap between the first flight and another one changes most: one, and of the same two flights another one
 * that changes it most the other way, in the order of the race.
 *
 * @returns `[{flight, loser, lost, reasons, leg, from, to, seconds, shift}]`: numbers of the other flight and of the one that
 *   loses, how much (s) and why; the `leg` as `{before, after}`, passings of the first flight; from and to which instant it is
 *   shown again, and for how long; how much later (s) the other flight begins the leg, by which it is shown earlier.
 */
export function swingsOf(differences, flights) {
  const legs = differences.flatMap(({ flight, legs }) => legs.map((leg) => ({ flight, ...leg })));
  const largest = (swings) => swings.reduce((most, leg) => (Math.abs(leg.lost) > Math.abs(most?.lost ?? 0) ? leg : most), null);
  const first = largest(legs);
  if (first === null || Math.abs(first.lost) < COSTLY) return [];
  const second = largest(legs.filter(({ flight, lost }) => flight === first.flight && lost * first.lost < 0));
  const shown = second !== null && Math.abs(second.lost) >= BACK ? [first, second] : [first];
  return shown.sort((a, b) => a.passing - b.passing).map(({ flight, passing, lost, reasons }) => {
    const [lead, other] = [flights[0], flights[flight]].map((one) => [passing - 1, passing].map((number) => one.passing(number)));
    const shift = other[0].time - lead[0].time;
    const from = Math.max(lead[0].time - BEFORE, 0);
    const made = Math.max(lead[1].time, other[1].time - shift);
    const end = Math.max(flights[0].duration, flights[flight].duration - shift); // beyond which neither is known
    const to = Math.max(Math.min(made + BEHIND, end), made);
    const seconds = Math.max(Math.min((to - from) / SLOW, LONG), to - from);
    const leg = { before: lead[0], after: lead[1] };
    return { flight, loser: lost > 0 ? flight : 0, lost: Math.abs(lost), reasons, leg, from, to, seconds, shift };
  });
}

export const SHORTEST = 2.5; // s of a shot
const [LATEST, BRIEF] = [12, 1]; // s, that others are followed at most, and at least, for the last picture is held

/**
 * Whom television follows when the first flight has finished: `[{flight, from, to}]`, those that finish later in their order. Of
 * finishes that come too soon after each other for a shot only the last one is followed.
 */
export function pursuitsOf(differences, flights) {
  const [lead] = flights;
  const others = differences.map(({ flight }) => flights[flight]);
  const late = others.filter(({ raceTime, duration }) => raceTime !== null && duration > lead.duration);
  const pursuits = [];
  for (const flight of late.sort((a, b) => a.duration - b.duration)) {
    const to = Math.min(flight.duration, lead.duration + LATEST);
    const before = pursuits.at(-1);
    let from = before?.to ?? lead.duration;
    if (before && Math.min(to - before.to, before.to - before.from) < SHORTEST) ({ from } = pursuits.pop());
    if (to - from >= BRIEF) pursuits.push({ flight, from, to });
  }
  return pursuits;
}

function interpolated(times, values, time) {
  const last = times.length - 1;
  if (time <= times[0]) return values[0];
  if (time >= times[last]) return values[last];
  const i = indexBefore(times, time);
  return values[i] + ((time - times[i]) / (times[i + 1] - times[i])) * (values[i + 1] - values[i]);
}

// Every colour stands out from pale and from dark ground alike, and lightness rises along the scale.
const SEQUENTIAL = ["#3b2f8f", "#7a2a9a", "#b82b86", "#e04760", "#f2743c", "#f5a623"];
const DIVERGING = ["#1f5fbf", "#5a8fd0", "#93a4ad", "#d9776a", "#c22f2f"];
const DARK = window.matchMedia("(prefers-color-scheme: dark)");
const BRIGHT = ["#3fe0d0", "#ffc24d", "#e79bff", "#a8e66f", "#ff8fb3"]; // the same, in the scene
const GHOSTS = 5; // colours for flights beside the first, in the style sheet

/** A colour of the style sheet, by the name of its variable. */
export function themed(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** The name of the colour of the flights beside the first. */
export function ghostName(number) {
  return `ghost-${1 + ((number - 1) % GHOSTS)}`;
}

/** The colour of the flights beside the first. */
export function ghostColour(number) {
  return themed(ghostName(number));
}

/** The colour of a flight in the scene, which stands out from water and land by day and by night; the first is white. */
export function tagColour(number) {
  return number === 0 ? "#ffffff" : BRIGHT[(number - 1) % GHOSTS];
}

/** The colours of a scale from its low to its high end. */
export function stops(scale) {
  return scale.signed ? DIVERGING : SEQUENTIAL;
}

/** The range of a scale over a flight: its own extent, and symmetric where it is signed. */
export function rangeOf(scale, extent) {
  if (!extent) return [0, 1];
  const [least, largest] = extent;
  if (!scale.signed) return least < largest ? [least, largest] : [least - 0.5, largest + 0.5];
  const reach = Math.max(Math.abs(least), Math.abs(largest)) || 1;
  return [-reach, reach];
}

/** A function from a value to its colour, as red, green and blue in the renderer's linear space. */
export function colourOf(scale, range) {
  const colours = stops(scale).map((one) => new Color(one));
  const mixed = new Color();
  return (value) => {
    const share = Number.isFinite(value) ? (value - range[0]) / (range[1] - range[0]) : 0;
    const place = Math.min(Math.max(share, 0), 1) * (colours.length - 1);
    const i = Math.min(Math.floor(place), colours.length - 2);
    return mixed.copy(colours[i]).lerp(colours[i + 1], place - i);
  };
}

/** Let a button change the theme; `restyle` is called whenever colours are others. Returns a function that forces one. */
export function watchTheme(button, restyle) {
  let chosen = null;
  const apply = (forced = null) => {
    document.documentElement.dataset.theme = forced ?? chosen ?? (DARK.matches ? "dark" : "light");
    restyle();
  };
  DARK.addEventListener("change", () => apply());
  button.addEventListener("click", () => {
    chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    apply();
  });
  apply();
  return apply;
}
