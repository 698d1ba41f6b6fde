// Numbers of the present instant over the scene, and the tables: a leg is jumped to by its button, flights are hidden.

import { written } from "./numbers.js";

/** Let the tables follow the clock and lead it. */
export function linkTables(element, flight, clock) {
  const rows = [...element.querySelectorAll("tr[data-passing]")];
  for (const button of element.querySelectorAll("button[data-time]"))
    button.addEventListener("click", () => {
      clock.stop();
      clock.set(Number(button.dataset.time));
    });
  const mark = (time) => {
    const leg = flight.leg(time);
    for (const row of rows) {
      const here = Number(row.dataset.passing) === leg;
      if (here) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
  };
  clock.watch(mark);
  mark(clock.time);
}

/** Boxes that show and hide flights. */
export function linkFlights(element, flights, changed) {
  for (const box of element.querySelectorAll("input[data-flight]"))
    box.addEventListener("change", () => {
      flights[Number(box.dataset.flight)].visible = box.checked;
      changed();
    });
}

/** Fill every element with `data-history` whenever the clock moves. */
export function showReadings(element, flight, clock) {
  const cells = [...element.querySelectorAll("[data-history]")];
  for (const cell of cells) cell.closest("div").hidden = !flight.history(cell.dataset.history);
  const show = (time) => {
    for (const cell of cells) {
      const { history, digits, wraps } = cell.dataset;
      cell.textContent = written(flight.value(history, time, Number(wraps ?? 0)), Number(digits ?? 0));
    }
  };
  clock.watch(show);
  show(clock.time);
}
