// The numbers of the present instant over the scene.

import { written } from "./numbers.js";

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
