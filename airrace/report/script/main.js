// The page comes to life: what it carries is read, and its parts are linked by one clock.

import { Clock, linkFlights, linkTables, showReadings, Transport, watchKeys } from "./clock.js";
import { Controls } from "./controls.js";
import { Flight } from "./flight.js";
import { watchTheme } from "./palette.js";
import { watchPrinting } from "./printing.js";
import { RaceScene } from "./scene.js";
import { Strips } from "./strips.js";

function begin() {
  const contents = JSON.parse(document.getElementById("contents").textContent);
  const flights = contents.flights.map((one, number) => new Flight(one, number));
  const [lead] = flights;
  const clock = new Clock(Math.max(...flights.map((one) => one.duration)));
  const [sceneElement, stripsElement, transportElement] = ["scene", "strips", "transport"].map((id) =>
    document.getElementById(id),
  );
  const scene = sceneOrNone(sceneElement, contents, flights, clock);
  const strips = new Strips(stripsElement, contents.strips, flights, clock, contents.differences);
  const transport = new Transport(transportElement, lead, clock);
  const controls = scene === null ? null : new Controls(sceneElement, scene, lead, contents.colours);
  showReadings(sceneElement, lead, clock);
  linkTables(document.getElementById("tables"), lead, clock);
  linkFlights(document, flights, () => {
    scene?.invalidate();
    strips.redraw();
  });
  const stretch = document.querySelector("[data-window]");
  stretch.addEventListener("change", () => strips.showWhole(stretch.value === "race"));
  watchKeys(transport, controls?.buttons ?? []);
  const force = watchTheme(document.getElementById("theme"), () => {
    scene?.restyle();
    strips.redraw();
  });
  watchPrinting(document.getElementById("pictures"), scene, controls, strips, clock, force);
  // For whoever looks into the page from its console.
  window.airrace = { clock, flights, scene, strips };
  document.documentElement.classList.add("ready");
}

/** The scene, or null where the browser has no WebGL: the drawing of the course then stands in its place. */
function sceneOrNone(element, contents, flights, clock) {
  try {
    return new RaceScene(element, contents.course, flights, clock);
  } catch (reason) {
    console.info(`no picture in space: ${reason.message}`);
    document.documentElement.classList.add("flat");
    return null;
  }
}

begin();
