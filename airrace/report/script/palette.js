// Colours: the theme, light or dark as the system has it until it is chosen, and the scales of a flight.

import { Color } from "three";

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
