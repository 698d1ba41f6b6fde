// Light or dark: as the system has it, until it is chosen.

const dark = window.matchMedia("(prefers-color-scheme: dark)");

/** Let a button change the theme; `restyle` is called whenever colours are others. Returns a function that forces one. */
export function watchTheme(button, restyle) {
  let chosen = null;
  const apply = (forced = null) => {
    document.documentElement.dataset.theme = forced ?? chosen ?? (dark.matches ? "dark" : "light");
    restyle();
  };
  dark.addEventListener("change", () => apply());
  button.addEventListener("click", () => {
    chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    apply();
  });
  apply();
  return apply;
}
