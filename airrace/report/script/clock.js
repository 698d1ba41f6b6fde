// The one clock of the page: what time it is in the race, whether it runs, and who wants to know.

export class Clock {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.rate = 1;
    this.running = false;
    this.listeners = [];
    this.last = 0;
  }

  /** Call back whenever the time, the rate or whether it runs has changed. */
  watch(listener) {
    this.listeners.push(listener);
  }

  set(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    if (this.time >= this.duration) this.running = false;
    this.tell();
  }

  setRate(rate) {
    this.rate = rate;
    this.tell();
  }

  toggle() {
    if (this.running) {
      this.running = false;
      this.tell();
      return;
    }
    if (this.time >= this.duration) this.time = 0;
    this.running = true;
    this.last = performance.now();
    requestAnimationFrame((now) => this.step(now));
    this.tell();
  }

  stop() {
    this.running = false;
    this.tell();
  }

  step(now) {
    if (!this.running) return;
    // A frame that came late (a hidden tab, say) must not make the aircraft jump.
    const elapsed = Math.min(Math.max(now - this.last, 0) / 1000, 0.25);
    this.last = now;
    this.set(this.time + elapsed * this.rate);
    if (this.running) requestAnimationFrame((later) => this.step(later));
  }

  tell() {
    for (const listener of this.listeners) listener(this.time);
  }
}
