// The side of the page: race times, sliders, passings, distances, warnings, and the numbers of the chosen piece.

import { predicted } from "./plan.js";

const SLIDERS = [
  ["Wind, kt", ["environment.wind.speed_kt"], 0, 30, 0.5],
  ["Wind, m/s", ["environment.wind.speed_m_s"], 0, 15, 0.25],
  ["Wind from, °", ["environment.wind.from_deg"], 0, 360, 5],
  ["Load factor, g", ["rules.n_z_max"], 5, 12, 0.1],
  ["Roll rate, °/s", ["aircraft.point_mass.roll_rate_max_deg_s"], 90, 500, 5],
];
const SETTLE_MS = 150;

const element = (name, attributes = {}, ...children) => {
  const made = Object.assign(document.createElement(name), attributes);
  made.append(...children);
  return made;
};
const find = (name) => document.getElementById(name);
const seconds = (time) => `${time.toFixed(3)} s`;
const rows = (table, all) => table.replaceChildren(...all.map(([cells, name = ""]) =>
  element("tr", { className: name }, ...cells.map((cell) => element("td", { textContent: cell })))));

export function showSessions(state, pieces, held, ask) {
  const shown = state.sessions.map((session, index) => {
    const known = session.answered === state.request && !held;
    const time = known ? session.time : predicted(session, pieces);
    const text = typeof time === "number" ? `${known ? "" : "≈ "}${seconds(time)}` : "—";
    const told = element("div", { className: `time ${known ? "known" : "guess"}`, textContent: text });
    told.dataset.time = time ?? "";
    const difference = index && time && state.sessions[0].time ? time - state.sessions[0].time : null;
    const names = [...state.aircraft];
    const choice = element("select", { onchange: (event) => {
      const all = state.sessions.map((one) => one.aircraft);
      all[index] = event.target.value || null;
      ask("aircraft", { names: all });
    } }, ...["", ...names].map((name) => element("option", { value: name, textContent: name || "as the file says",
      selected: name === (session.aircraft ?? "") })));
    const range = session.n_z_range && session.holds ? `, n_z ${session.n_z_range[0]} to ${session.n_z_range[1]}` : "";
    const six = session.six_dof && element("div", { textContent: `six-dof: ${session.six_dof.time === null ? session.six_dof.message
      : seconds(session.six_dof.time)}, ${session.six_dof.status}${session.six_dof.answered === state.request ? "" : ", of an earlier layout"}` });
    return element("div", { className: `session ${index ? "second" : ""}` },
      element("div", { textContent: session.title ?? "" }), told,
      ...(difference === null ? [] : [element("div", { textContent: `${difference >= 0 ? "+" : ""}${difference.toFixed(3)} s` })]),
      element("div", { textContent: `${session.status ?? ""}${range}` }),
      ...(six ? [six] : []),
      element("div", { className: "problem", textContent: session.problem || (session.holds ? "" : session.message ?? "") }),
      element("div", { textContent: session.note ?? "" }),
      element("div", { className: "busy", textContent: session.busy ?? "" }),
      choice,
      element("button", { textContent: "Six degrees of freedom", onclick: () => ask("six-dof", { session: index }) }));
  });
  const first = state.sessions.map((one) => one.aircraft);
  const pair = state.sessions.length < 2
    ? element("button", { textContent: "A second aircraft", onclick: () => ask("aircraft", {
      names: [...first, state.aircraft.find((one) => one !== first[0])] }) })
    : element("button", { textContent: "One aircraft", onclick: () => ask("aircraft", { names: first.slice(0, 1) }) });
  if (!find("sessions").contains(document.activeElement) || document.activeElement.tagName !== "SELECT") {
    find("sessions").replaceChildren(...shown, pair);
  }
}

export function showTables(state) {
  const session = state.sessions[0];
  rows(find("splits"), (session.splits ?? []).map(([name, time, speed, load]) => [[name, time.toFixed(2), `${speed} kt`, `${load} g`]]));
  rows(find("distances"), (session.distances ?? []).map(([what, distance, required]) => [
    [what, `${distance} m`, `≥ ${required} m`], distance < required - 0.01 ? "missed" : distance < required + 0.05 ? "tight" : ""]));
  find("warnings").replaceChildren(...(session.warnings ?? []).map((text) => element("li", { textContent: text })));
}

export function showSliders(state, ask) {
  const form = find("sliders");
  const limits = state.sessions[0].limits ?? {};
  if (!form.children.length) {
    for (const [text, [name], min, max, step] of SLIDERS) {
      const input = element("input", { type: "range", name, min, max, step });
      let rest = 0;
      input.addEventListener("input", () => {
        input.nextElementSibling.textContent = input.value;
        clearTimeout(rest);
        rest = setTimeout(() => ask("values", { values: { [name]: Number(input.value) } }), SETTLE_MS);
      });
      form.append(element("label", {}, text, input, element("output")));
    }
    const reset = element("button", { type: "button", textContent: "As the file says" });
    reset.onclick = () => ask("values", { values: Object.fromEntries(SLIDERS.map(([, [name]]) => [name, null])) });
    form.append(reset, element("p", { id: "whatif" }));
  }
  const metric = "environment.wind.speed_m_s" in limits;
  for (const input of form.querySelectorAll("input")) {
    const hidden = input.name.includes(metric ? "speed_kt" : "speed_m_s");
    input.parentElement.hidden = hidden;
    input.parentElement.style.display = hidden ? "none" : "";
    if (input === document.activeElement && !Object.keys(state.values).length === false) continue;
    input.value = state.values[input.name] ?? limits[input.name] ?? 0;
    input.nextElementSibling.textContent = Number(input.value);
  }
  const changed = Object.keys(state.values).length > 0;
  form.querySelector("#whatif").textContent = changed ? "A what-if: the file stays as it is." : "";
}

const DEEP_MAX = 2;  // longer lists, as the corners of an area, are dragged on the plan

// The values of an entry with their paths, as deep as they lie in short lists, such as the pylons of a gate.
function leaves(entry, path = []) {
  if (typeof entry !== "object" || entry === null) return [[path, entry]];
  if (Array.isArray(entry) && entry.length > DEEP_MAX) return [];
  return Object.entries(entry).flatMap(([name, value]) => leaves(value, [...path, Array.isArray(entry) ? Number(name) : name]));
}

const choice = (texts, value) => texts.map((text) => element("option", { value: text, textContent: text || "as by default", selected: text === value }));

// An input of a value of the file; what is refused stands as before. An empty one takes the value out of the file.
function fileInput(value, { number, choices = [], optional = false }, set) {
  const before = value ?? "";
  const input = choices.length ? element("select", {}, ...choice(["", ...choices], before))
    : element("input", { value: before, type: number ? "number" : "text", step: "any" });
  input.onchange = async () => {
    const empty = optional && input.value === "";
    if (number && !empty && (input.value === "" || !Number.isFinite(Number(input.value)))) input.value = before;
    else {
      const answer = await set(empty ? null : number ? Number(input.value) : input.value);
      if (!answer.done) input.value = before;
    }
    input.blur();
  };
  return input;
}

export function showPiece(piece, ask) {
  const box = find("piece");
  box.hidden = !piece;
  if (!piece || box.contains(document.activeElement)) return;
  box.querySelector("h2").textContent = `${piece.path.at(-1)}: ${piece.kind}`;
  const inputs = leaves(piece.entry).filter(([path]) => path[0] !== "type").map(([path, value]) => {
    const input = fileInput(value, { number: typeof value === "number" },
      (entered) => ask("set", { path: [...piece.path, ...path], value: entered }));
    input.name = path.join(".");
    const text = path.map((part) => (typeof part === "number" ? part + 1 : part)).join(" ");
    return element("label", {}, text, input);
  });
  box.querySelector("form").replaceChildren(...inputs);
  box.querySelector("form").onsubmit = (event) => event.preventDefault();
}

// Laps, limits and pilot as the file gives them, and the order of the passings.
export function showRace(state, ask) {
  const form = find("race");
  if (!form.contains(document.activeElement)) {
    form.replaceChildren(...state.form.map(({ path, text, value, choices }) => {
      const input = fileInput(value, { number: !choices.length, choices, optional: true }, (entered) => ask("set", { path, value: entered }));
      input.name = path.join(".");
      return element("label", { title: text }, path[1], input);
    }));
    form.onsubmit = (event) => event.preventDefault();
  }
  const table = find("order");
  if (table.contains(document.activeElement) && document.activeElement.tagName === "SELECT") return;
  table.replaceChildren(...state.passings.map(({ path, gate, direction }) => {
    const move = (text, later) => element("button", { type: "button", textContent: text, title: later ? "later" : "earlier",
      onclick: () => ask("passing", { path, later }), disabled: typeof path.at(-1) !== "number" });
    const select = element("select", { onchange: (event) => ask("passing", { path, direction: event.target.value }) },
      ...choice(["", ...state.directions], direction));
    const cells = [gate, select, element("span", {}, move("↑", false), move("↓", true))];
    return element("tr", {}, ...cells.map((cell) => element("td", {}, cell)));
  }));
}
