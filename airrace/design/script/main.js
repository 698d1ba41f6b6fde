// The page of the designer: a view of the state that the server has, and the link to it.

import { showPiece, showRace, showSessions, showSliders, showTables } from "./panels.js";
import { Placing, Plan } from "./plan.js";

const RETRY_MS = 1000;

// A link that is lost is tried again for ever; what comes back is the whole state, so that nothing depends on what was
// missed. Changes wait in a queue until they are answered: those made without a link are handed back when it returns,
// to a designer that was started anew, too.
class Link {
  constructor({ show, status, tell }) {
    Object.assign(this, { show, status, tell });
    this.state = null;
    this.revision = -1;
    this.pending = [];  // the first one may be under way
    this.sending = false;
    this.lost = true;  // until the first state has come
    this.poll = null;
    this.listen();
  }

  async listen() {
    let version = "";
    for (;;) {
      this.poll = new AbortController();
      try {
        let state = await this.fetchState(`?since=${version}`, this.poll.signal);
        const changed = String(state.version) !== version || this.lost;
        version = String(state.version);
        if (this.state && (this.lost || state.designer !== this.state.designer)) state = await this.handBack(state);
        if (changed) this.take(state);
        this.lost = false;
        this.status("");
        this.send();
      } catch (error) {
        version = "";
        this.lost = true;
        const count = this.pending.length;
        const kept = count ? `; ${count} change${count > 1 ? "s" : ""} kept in this page until it is back` : "";
        this.status(`no link to airrace design (${error.message}); it is tried again${kept}`);
        await new Promise((done) => setTimeout(done, RETRY_MS));
      }
    }
  }

  async fetchState(query = "", signal = undefined) {
    const answer = await fetch(`state${query}`, { cache: "no-store", signal });
    if (!answer.ok) throw new Error((await answer.json()).error);
    return answer.json();
  }

  // Make what this page has and the designer may lack known to it, but for the queue; return the state after that.
  async handBack(state) {
    const before = this.state;
    if (state.designer !== before.designer) {
      this.revision = state.revision;
      // Where another program has written the file meanwhile, who edits decides what becomes of the offer.
      if (state.digest_of_file === before.digest_of_file) {
        if (state.offer) await this.post("take");
        if (before.text !== null) await this.post("restore", { text: before.text });
        state = await this.fetchState();
      }
    }
    const [first] = this.pending;
    // One whose answer was lost was done if the text has changed; a place may be put twice.
    if (first?.sent && !this.sending && first.action !== "move" && state.digest !== first.digest) {
      this.pending.shift().resolve({ done: true, revision: state.revision });
    }
    return state;
  }

  take(state) {
    if (this.state?.designer !== state.designer) this.revision = state.revision;
    this.state = state;
    if (state.revision < this.revision) return;
    Object.assign(this, { revision: state.revision, digest: state.digest });
    this.show(state);
  }

  // Ask for something; one request after another, each on the revision that the one before has left. Returns whether
  // it was done, the answer of one that was refused otherwise.
  ask(action, message = {}) {
    return new Promise((resolve) => {
      this.pending.push({ action, message, resolve, sent: false });
      this.send();
    });
  }

  async send() {
    if (this.sending) return;
    this.sending = true;
    try {
      while (this.pending.length && !this.lost) {
        const [first] = this.pending;
        Object.assign(first, { sent: true, digest: first.digest ?? this.digest });
        const result = await this.post(first.action, first.message);
        this.pending.shift();
        first.resolve(result);
      }
    } catch (error) {
      this.lost = true;
      this.poll.abort(error);  // so that the link is looked for at once
    } finally {
      this.sending = false;
    }
  }

  // Send one message; an error is that of the link.
  async post(action, message = {}) {
    const answer = await fetch(`do/${action}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ revision: this.revision, ...message }),
    });
    const content = await answer.json();
    if (answer.ok) {
      Object.assign(this, { revision: content.revision, digest: content.digest });
      this.tell("");
      return { done: true, revision: content.revision };
    }
    if (answer.status !== 409 || !content.digest) this.tell(content.error);
    if (answer.status === 409) this.revision = -1;  // the state that comes next says which one counts
    this.take(await this.fetchState());
    return { done: false, ...content };
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
  showOffer(state.offer);
  find("files").replaceChildren(...state.files.map((name) => new Option(name)));
  Object.assign(find("problem"), { textContent: state.problem, hidden: !state.problem });
  plan.show(state);
  showSessions(state, plan.pieces(), plan.hand, ask);
  showTables(state);
  showSliders(state, ask);
  showPiece(plan.chosenPiece(), ask);
  showRace(state, ask);
  showScene(state.sessions[0]);
}

// What an earlier designer has left unsaved, and in which lines it differs from the file.
function showOffer(offer) {
  find("offer").hidden = !offer;
  if (!offer) return;
  find("offer").querySelector("p").textContent = `${offer.file} holds work that was not saved.`;
  find("offer").querySelector("pre").textContent = offer.differences.join("\n");
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
  const answer = await ask("save", {});
  if (answer.done || !answer.digest) return;
  if (confirm(`${answer.error}\n\nOK: overwrite it with what is shown here.\nCancel: go on to the next question.`)) {
    await ask("save", { overwrite: answer.digest });
  } else if (confirm("Take what lies on the disk? (It can be undone.)")) {
    await ask("reload", {});
  }
}

const remove = () => plan.chosenPiece() && ask("remove", { path: plan.chosenPiece().path });

const plan = new Plan(find("plan"), {
  ask,
  click,
  tell,
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

// Put a file of the user's beside the track file, and below the course.
async function upload(file) {
  if (!file) return;
  try {
    const answer = await fetch(`file?name=${encodeURIComponent(file.name)}`, {
      method: "POST",
      headers: { "Content-Type": "application/octet-stream" },
      body: file,
    });
    tell(answer.ok ? "" : (await answer.json()).error);
  } catch (error) {
    tell(`${file.name} has not come to airrace design: ${error.message}`);
  }
}

find("upload").onchange = (event) => {
  upload(event.target.files[0]);
  event.target.value = "";  // so that the same file can be chosen again
};
find("plan").ondragover = (event) => event.preventDefault();
find("plan").ondrop = (event) => {
  event.preventDefault();
  upload(event.dataTransfer.files[0]);
};
find("take").onclick = () => ask("take");
find("discard").onclick = () => confirm("Remove this work for good?") && ask("discard");
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
addEventListener("beforeunload", (event) => {
  const kept = link.pending.length || (link.lost && link.state?.text);
  if (kept) event.preventDefault();
});
window.designer = { plan, link };
