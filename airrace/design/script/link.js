// The link to the server: the state it has, and what it is asked to do. A link that is lost is tried again for ever;
// what comes back is the whole state, so that nothing depends on what was missed.

const RETRY_MS = 1000;

export class Link {
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
