// How far a flight is ahead or behind another, place by place along the course.

import { numbersOf } from "./numbers.js";

/** For every other flight its number, and a function from the first flight's time to the time lost until there, s. */
export function differencesOf(told) {
  return told.map(({ flight, time, difference }) => {
    const [times, lost] = [numbersOf(time), numbersOf(difference)];
    return { flight, at: (now) => interpolated(times, lost, now) };
  });
}

function interpolated(times, values, time) {
  const last = times.length - 1;
  if (time <= times[0]) return values[0];
  if (time >= times[last]) return values[last];
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return values[low] + ((time - times[low]) / (times[high] - times[low])) * (values[high] - values[low]);
}
