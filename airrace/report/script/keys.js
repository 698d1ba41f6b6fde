// Keys of the whole page: those of the transport, and a digit for every view.

/** Watch the keyboard; what is typed into a field, and what the browser itself does with a key, is left alone. */
export function watchKeys(transport, viewButtons) {
  // A button that a finger or the mouse has pressed does not keep the keys: the space bar plays, and presses it no more.
  document.addEventListener("click", (event) => {
    if (event.detail > 0) event.target.closest("button")?.blur();
  });
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.defaultPrevented) return;
    const { target } = event;
    const typing = target.matches("select, textarea, input:not([type=range]):not([type=checkbox])");
    const pressed = event.key === " " && target.matches("button, summary, input[type=checkbox]");
    if (typing || pressed) return;
    // Up and down move the page unless the scene or the slider has been chosen.
    const vertical = event.key === "ArrowUp" || event.key === "ArrowDown";
    if (vertical && !target.matches("canvas, input[type=range]")) return;
    const view = viewButtons[Number(event.key) - 1];
    if (view) view.click();
    else if (!transport.key(event)) return;
    event.preventDefault();
  });
}
