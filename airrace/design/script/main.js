// The page of the designer: a view of the state that the server has, and the link to it.

import { showSessions, showPiece, showSliders, showTables } from "./panels.js";
import { Placing, Plan } from "./plan.js";

const RETRY_MS = 1000;

// A link that is lost is tried again for ever; what comes back is the whole state, so that nothing depends on what was
// missed.
class Link {
  constructor({ show, status, tell }) {
    Object.assign(this, { show, status, tell });
    this.state = null;
    this.revision = -1;
    this.waiting = Promise.resolve();
    this.version = "";
    this.listen();
  }

  async listen() {
    for (;;) {
      try {
        const answer = await fetch(`state?since=${this.version}`, { cache: "no-store" });
        if (!answer.ok) throw new Error((await answer.json()).error);
        const state = await answer.json();
        const changed = String(state.version) !== this.version;
        this.version = String(state.version);
        this.status("");
        if (changed) this.take(state);
      } catch (error) {
        this.version = "";
        this.status(`no link to airrace design (${error.message}); it is tried again`);
        await new Promise((done) => setTimeout(done, RETRY_MS));
      }
    }
  }

  take(state) {
    this.state = state;
    this.revision = Math.max(this.revision, state.revision);
    if (state.revision >= this.revision) this.show(state);
  }

  // Ask for something; one request after another, each on the revision that the one before has left. Returns whether
  // it was done, the answer of one that was refused otherwise.
  ask(what, message = {}) {
    const asked = this.waiting.then(() => this.send(what, message));
    this.waiting = asked.catch(() => {});
    return asked;
  }

  async send(what, message) {
    try {
      const answer = await fetch(`do/${what}`, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ revision: this.revision, ...message }),
      });
      const said = await answer.json();
      if (answer.ok) {
        this.revision = said.revision;
        this.tell("");
        return { done: true, revision: said.revision };
      }
      if (answer.status !== 409 || !said.digest) this.tell(said.error);
      if (answer.status === 409) this.revision = -1;  // the state that comes next says which one counts
      const state = await fetch("state", { cache: "no-store" });
      if (state.ok) this.take(await state.json());
      return { done: false, ...said };
    } catch (error) {
      this.tell(`not done: ${error.message}`);
      return { done: false, error: error.message };
    }
  }
}

const find = (name) => document.getElementById(name);
const tell = (text) => Object.assign(find("told"), { textContent: text, hidden: !text });
const ask = (what, message) => link.ask(what, message);

function show(state) {
  document.title = `${state.unsaved ? "• " : ""}${state.name} – airrace design`;
  find("name").textContent = state.name;
  find("file").textContent = `${state.file}${state.unsaved ? ", not saved" : ""}`;
  find("undo").disabled = !state.undo;
  find("redo").disabled = !state.redo;
  find("save").disabled = !state.unsaved;
  if (find("kind").options.length === 1) find("kind").append(...state.kinds.map((one) => new Option(one, one)));
  plan.show(state);
  showSessions(state, plan.pieces(), plan.hand, ask);
  showTables(state);
  showSliders(state, ask);
  showPiece(plan.chosenPiece(), ask);
  showScene(state.sessions[0]);
}

// The scene of the last answer, drawn anew as soon as the answer is complete and no hand moves.
function showScene(session) {
  const scene = find("scene");
  scene.hidden = !find("beside").checked;
  const key = `scene?flight=${session.time}-${session.answered}`;
  const complete = session.holds && session.slope_time === session.time && !plan.hand;
  if (!scene.hidden && complete && scene.dataset.key !== key) {
    scene.dataset.key = key;
    scene.contentWindow.location.replace(key); // no step of its own to go back to
  }
}

function click(at) {
  if (placing.click(at)) return true;
  const kind = find("kind").value;
  if (!kind) return false;
  find("kind").value = "";
  find("plan").classList.remove("adding");
  ask("add", { kind, north: at.north, east: at.east });
  return true;
}

async function save() {
  const said = await ask("save", {});
  if (said.done || !said.digest) return;
  if (confirm(`${said.error}\n\nOK: overwrite it with what is shown here.\nCancel: go on to the next question.`)) {
    await ask("save", { overwrite: said.digest });
  } else if (confirm("Take what lies on the disk? (It can be undone.)")) {
    await ask("reload", {});
  }
}

const remove = () => plan.chosenPiece() && ask("remove", { path: plan.chosenPiece().path });

const plan = new Plan(find("plan"), {
  ask,
  click,
  changed: () => showSessions(plan.state, plan.pieces(), plan.hand, ask),
  chosen: (piece) => showPiece(piece, ask),
});
const placing = new Placing(plan, ask);
const link = new Link({
  show,
  tell,
  status: (text) => {
    find("link").textContent = text;
    find("link").className = text ? "lost" : "";
  },
});

find("undo").onclick = () => ask("undo");
find("redo").onclick = () => ask("redo");
find("save").onclick = save;
find("remove").onclick = remove;
find("fit").onclick = () => plan.fit();
find("arrows").onchange = (event) => {
  plan.arrows = event.target.checked;
  plan.draw();
};
find("beside").onchange = () => link.state && showScene(link.state.sessions[0]);
find("kind").onchange = () => find("plan").classList.toggle("adding", Boolean(find("kind").value));
document.addEventListener("keydown", (event) => {
  const typing = ["INPUT", "SELECT"].includes(document.activeElement?.tagName);
  const control = event.ctrlKey || event.metaKey;
  const actions = { z: () => ask(event.shiftKey ? "redo" : "undo"), y: () => ask("redo"), s: save };
  const action = control && (!typing || event.key === "s") ? actions[event.key.toLowerCase()] : null;
  if (action) {
    event.preventDefault();
    action();
  } else if (event.key === "Delete" && !typing) remove();
});
window.designer = { plan, link };
