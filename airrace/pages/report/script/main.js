// The page comes to life: what it carries is read, its parts are linked by one clock, and it is printed.

import { Clock, Controls, linkFlights, linkStretch, linkTables, showReadings, Stretch, Transport, watchKeys } from "./controls.js";
import { Flight } from "./flight.js";
import { Film, Graphics } from "./graphics.js";
import { LossMap } from "./map.js";
import { RaceScene } from "./scene.js";
import { Strips } from "./strips.js";
import { differencesOf, watchTheme, written } from "./values.js";

const PICTURES = [
  ["above", 540, 390],
  ["orbit", 540, 390],
  ["side", 1080, 260],
];
const TOUCHED = 2500; // ms, for which buttons stay over the full screen after a touch
const WIDTH = 700; // pixels: what a page takes between its margins

/** Make the page ready before it is printed, and put it back afterwards. */
function watchPrinting(element, scene, controls, strips, clock, forceTheme) {
  window.addEventListener("beforeprint", () => {
    clock.stop();
    forceTheme("light");
    if (scene !== null)
      element.replaceChildren(...PICTURES.map((one) => pictured(scene, ...one, clock.time)), keyOf(controls));
    document.documentElement.classList.add("printing");
    strips.resize(WIDTH, 2);
  });
  window.addEventListener("afterprint", () => {
    document.documentElement.classList.remove("printing");
    element.replaceChildren();
    forceTheme(null);
    strips.resize();
    scene?.invalidate();
  });
}

function pictured(scene, name, width, height, time) {
  const figure = document.createElement("figure");
  const image = document.createElement("img");
  image.src = scene.picture(name, width, height);
  image.alt = "";
  const caption = document.createElement("figcaption");
  caption.textContent = `${name}, ${scene.scaleOf(name, width)}; the aircraft at ${written(time, 2)} s`;
  figure.className = name;
  figure.append(image, caption);
  return figure;
}

/** What the colours of the line mean. */
function keyOf(controls) {
  const key = document.createElement("p");
  const ramp = document.createElement("i");
  ramp.style.background = controls.ramp;
  key.className = "key";
  const [before, behind] = controls.legend;
  key.append(before, ramp, behind);
  return key;
}

function begin() {
  const contents = JSON.parse(document.getElementById("contents").textContent);
  const flights = contents.flights.map((one, number) => new Flight(one, number));
  const [lead] = flights;
  const clock = new Clock(Math.max(...flights.map((one) => one.duration)));
  const [sceneElement, stripsElement, transportElement] = ["scene", "strips", "transport"].map((id) =>
    document.getElementById(id),
  );
  const differences = differencesOf(contents.differences);
  const graphics = new Graphics(flights, document.title, contents.units, contents.broadcast, differences);
  const scene = sceneOrNone(sceneElement, contents, flights, clock, graphics);
  const stretch = new Stretch(clock, lead);
  const strips = new Strips(stripsElement, contents, flights, clock, stretch, differences);
  const pairs = new Map(differences.map((pair) => [pair.flight, pair]));
  const maps = [...document.querySelectorAll("figure.map")].map((one) => new LossMap(one, flights, pairs, clock, stretch));
  stretch.watch(() => scene?.focus(stretch.kind === "race" ? null : lead.places(stretch.from, stretch.to)));
  const transport = new Transport(transportElement, lead, clock);
  const controls = scene === null ? null : new Controls(sceneElement, scene, lead, contents.colours);
  showReadings(sceneElement, lead, clock);
  linkTables(document.getElementById("tables"), lead, clock);
  linkFlights(document, flights, () => {
    scene?.invalidate();
    strips.redraw();
  });
  linkStretch(document.querySelector(".strips-head"), stretch, strips);
  watchKeys(transport, controls?.buttons ?? []);
  const force = watchTheme(document.getElementById("theme"), () => {
    scene?.restyle();
    strips.redraw();
  });
  watchPrinting(document.getElementById("pictures"), scene, controls, strips, clock, force);
  const full = document.querySelector("[data-full]");
  const watch = full.closest(".watch");
  full.hidden = !document.fullscreenEnabled;
  full.addEventListener("click", () => (document.fullscreenElement ? document.exitFullscreen() : watch.requestFullscreen()));
  let leaving;
  for (const touch of ["pointermove", "pointerdown"])
    watch.addEventListener(touch, () => {
      watch.classList.add("touched");
      clearTimeout(leaving);
      leaving = setTimeout(() => watch.classList.remove("touched"), TOUCHED);
    });
  // For whoever looks into the page from its console, and for what takes films and cards of it.
  const film = scene === null ? null : new Film(scene, graphics, clock);
  window.airrace = { clock, flights, scene, strips, stretch, maps, graphics, film };
  document.documentElement.classList.add("ready");
}

/** The scene, or null where the browser has no WebGL: the drawing of the course then stands in its place. */
function sceneOrNone(element, contents, flights, clock, graphics) {
  try {
    return new RaceScene(element, contents.course, flights, clock, graphics, contents.units);
  } catch (reason) {
    console.info(`no picture in space: ${reason.message}`);
    document.documentElement.classList.add("flat");
    return null;
  }
}

begin();
