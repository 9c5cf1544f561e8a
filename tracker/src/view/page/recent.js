// The newest frames of the run, as long as they are kept, and the one that is shown: the newest, or the one at which the
// page is paused. `change` tells that another one is shown, `events` that something happened.

const MOST_FRAMES = 600;
const MOST_EVENTS = 200;

// An event and the one that takes it back say the same of these.
const SAME = ["time", "where", "id", "direction", "state"];

export class Recent extends EventTarget {
  frames = [];
  events = []; // the newest first
  #shown = null; // index of the frame at which the page is paused

  get isPaused() {
    return this.#shown !== null;
  }

  get index() {
    return this.#shown ?? this.frames.length - 1;
  }

  get frame() {
    return this.frames[this.index] ?? null;
  }

  // Forgets everything: the frames that come are another run's.
  clear() {
    this.frames = [];
    this.events = [];
    this.#shown = null;
  }

  add(frames, events) {
    const isLive = !this.isPaused;
    this.frames.push(...frames);
    const excess = Math.max(this.frames.length - MOST_FRAMES, 0);
    this.frames.splice(0, excess);
    // A page that is paused for long shows the oldest frame that is kept.
    if (this.isPaused) this.#shown = Math.max(this.#shown - excess, 0);
    for (const event of events) this.#happened(event);
    if (events.length > 0) this.dispatchEvent(new Event("events"));
    if (frames.length > 0 && (isLive || excess > 0)) this.#changed();
  }

  #happened(event) {
    if (event.kind === "revoke") {
      const taken = this.events.find((e) => e.kind === event.revoked && SAME.every((key) => e[key] === event[key]));
      if (taken) taken.isRevoked = true;
      return;
    }
    // An event is dated back to when it happened.
    const place = this.events.findIndex((e) => e.time <= event.time);
    this.events.splice(place < 0 ? this.events.length : place, 0, event);
    this.events.splice(MOST_EVENTS);
  }

  pause() {
    if (this.frames.length === 0) return;
    this.#shown = this.index;
    this.#changed();
  }

  resume() {
    this.#shown = null;
    this.#changed();
  }

  // Pauses at a frame.
  show(index) {
    if (this.frames.length === 0) return;
    this.#shown = Math.min(Math.max(index, 0), this.frames.length - 1);
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }

  // The places at which each person of the shown frame was in the last seconds, the oldest first.
  trails(seconds) {
    const now = this.frame;
    const trails = new Map(now?.people.map(({ id }) => [id, []]) ?? []);
    for (let i = this.index; i >= 0 && this.frames[i].time >= now.time - seconds; i -= 1) {
      for (const { id, x, y } of this.frames[i].people) trails.get(id)?.unshift([x, y]);
    }
    return trails;
  }
}
