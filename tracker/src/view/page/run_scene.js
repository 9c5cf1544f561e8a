// What a run has in the room's 3-D view: zones, regions, lines, and the people of a frame with their trails.

import { colorOf, inkOn } from "/plan.js";
import { rgb } from "/solids.js";
import { styleColor } from "/space.js";

export class RunScene {
  #frame = null;
  #trails = new Map();

  load(room) {
    this.room = room;
  }

  take(frame, trails) {
    this.#frame = frame;
    this.#trails = trails;
  }

  get #people() {
    return this.#frame?.people ?? [];
  }

  marks(flat) {
    const { room } = this;
    for (const [areas, name] of [[room.zones, "zone"], [room.regions, "region"]]) {
      for (const { polygon } of areas) {
        flat.fill(polygon, 0.05, styleColor(name, 0.22));
        flat.ribbon([...polygon, polygon[0]], 0.035, 0.055, styleColor(name, 0.9));
      }
    }
    for (const { points } of room.lines) flat.ribbon(points, 0.06, 0.06, styleColor("tripwire", 0.95));
    for (const { id, x, y, sigma, radius } of this.#people) {
      const tint = rgb(colorOf(room, id));
      const trail = this.#trails.get(id) ?? [];
      flat.ribbon(trail, 0.05, 0.065, (i) => [...tint, 0.1 + (0.75 * i) / trail.length]);
      flat.disc([x, y], radius + 2 * sigma[0], radius + 2 * sigma[1], 0.06, [...tint, 0.3]);
    }
  }

  bodies() {
    return this.#people.map(({ id, x, y, radius, height, confidence }) => ({
      x, y, radius: Math.min(radius, 0.3), height, color: colorOf(this.room, id), opacity: Math.max(confidence, 0.4),
    }));
  }

  labels() {
    return this.#people.map(({ id, x, y, height }) => {
      const background = colorOf(this.room, id);
      return { text: id, place: [x, y, height + 0.2], background, ink: inkOn(background) };
    });
  }
}
