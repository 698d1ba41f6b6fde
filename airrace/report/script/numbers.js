// Numbers as the page carries them, and as people read them.

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

/** For every other flight its number, and a function from the first flight's time to the time lost until there, s. */
export function differencesOf(differences) {
  return differences.map(({ flight, time, difference }) => {
    const [times, lost] = [numbersOf(time), numbersOf(difference)];
    return { flight, at: (now) => interpolated(times, lost, now) };
  });
}

function interpolated(times, values, time) {
  const last = times.length - 1;
  if (time <= times[0]) return values[0];
  if (time >= times[last]) return values[last];
  const i = indexBefore(times, time);
  return values[i] + ((time - times[i]) / (times[i + 1] - times[i])) * (values[i + 1] - values[i]);
}
