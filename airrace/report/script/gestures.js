// Fingers, mouse and wheel over the scene, as three wishes: turn, move, zoom.

const WHEEL = 0.0012; // of the distance per unit of a wheel
const TAP = 6; // pixels within which a press is no drag

/**
 * Watch an element.
 *
 * @param wishes `turn(dx, dy)` and `move(dx, dy)` in pixels, `zoom(factor, x, y)`; one finger turns, two move and zoom.
 */
export function watchGestures(element, wishes) {
  const fingers = new Map();
  let spread = 0;
  let travelled = 0;

  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    spread = distance(fingers);
    travelled = 0;
  });

  element.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const step = [event.clientX - before[0], event.clientY - before[1]];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    travelled += Math.hypot(...step);
    if (travelled < TAP) return;
    if (fingers.size === 1) {
      const moves = event.shiftKey || (event.buttons & 6) !== 0;
      if (moves) wishes.move(...step);
      else wishes.turn(...step);
      return;
    }
    const now = distance(fingers);
    if (spread > 0 && now > 0) wishes.zoom(spread / now, event.clientX, event.clientY);
    spread = now;
    wishes.move(step[0] / fingers.size, step[1] / fingers.size);
  });

  for (const end of ["pointerup", "pointercancel"])
    element.addEventListener(end, (event) => {
      fingers.delete(event.pointerId);
      spread = distance(fingers);
    });

  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener(
    "wheel",
    (event) => {
      // Without a key the page scrolls, as everywhere; a trackpad's pinch comes with the key down.
      if (!event.ctrlKey && !event.metaKey && !element.matches(":focus")) return;
      event.preventDefault();
      const units = event.deltaMode === 1 ? 30 * event.deltaY : event.deltaY;
      wishes.zoom(Math.exp(units * WHEEL * (event.ctrlKey ? 5 : 1)), event.clientX, event.clientY);
    },
    { passive: false },
  );
}

function distance(fingers) {
  if (fingers.size < 2) return 0;
  const [a, b] = [...fingers.values()];
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
