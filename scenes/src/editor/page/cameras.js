// The cameras' images with what the server says of each item's outline. Items are drawn and moved here, too.

import { snapped } from "/geometry.js";
import { kindOf } from "/kinds.js";
import { DoublePress, classes, isCoarse, pointOf, points, shape, unitOf } from "/shapes.js";

const HANDLE_PX = isCoarse ? 9 : 5.5; // on the screen
const STILL_PX = isCoarse ? 8 : 3; // a press that moves less is a click
const SNAP_M = 0.1; // on the floor: a pixel far away is wide

export class Cameras {
  #frames = new Map();
  #drag = null;
  #tap = null;
  #presses = new DoublePress();

  // `look` asks which place of the floor a pixel shows, and uses what it is told, unless a later question comes first;
  // `place` waits for it. `add` sets a corner of the draft, `leave` ends pointing.
  constructor(container, drawing, { look, place, leave, add, finish, later }) {
    Object.assign(this, { container, drawing, look, place, leave, add, finish, later });
  }

  load(cameras, version) {
    this.#frames.clear();
    this.container.replaceChildren(...cameras.map((camera) => this.#figure(camera, version)));
  }

  // What the server says of the given items (the draft is the last of them).
  show(reply, items) {
    for (const { camera, outlines } of reply) {
      const frame = this.#frames.get(camera);
      if (!frame) continue;
      frame.shapes = () => outlines.flatMap((outline, i) => this.#outline(frame, outline, items[i]));
      this.#redraw(frame);
    }
  }

  // A place in every image: what the server says of it, or nothing.
  mark(pixels) {
    for (const [name, frame] of this.#frames) {
      const seen = pixels.find(({ camera }) => camera === name);
      frame.marks = () => {
        if (!seen?.pixel) return [];
        const [cx, cy] = seen.pixel;
        return [shape("circle", { class: classes({ marker: true, behind: seen.hidden }), cx, cy, r: 4.5 * unitOf(frame.svg) })];
      };
      frame.marker.replaceChildren(...frame.marks());
    }
  }

  #redraw(frame) {
    frame.element.classList.toggle("drawing", this.drawing.draft !== null);
    frame.outlines.replaceChildren(...frame.shapes());
    frame.marker.replaceChildren(...frame.marks());
  }

  #figure({ name, width, height }, version) {
    const figure = document.createElement("figure");
    const caption = figure.appendChild(document.createElement("figcaption"));
    caption.textContent = name;
    const element = figure.appendChild(document.createElement("div"));
    element.className = "frame";
    element.style.aspectRatio = `${width} / ${height}`;
    const image = element.appendChild(new Image(width, height));
    image.src = `/camera/${encodeURIComponent(name)}?${version}`;
    image.alt = `What ${name} sees`;
    image.draggable = false;
    // A pixel's number is its middle's place.
    const svg = element.appendChild(shape("svg", { viewBox: `-0.5 -0.5 ${width} ${height}`, "data-camera": name }));
    const [outlines, marker] = [svg.appendChild(shape("g", {})), svg.appendChild(shape("g", {}))];
    const frame = { name, width, height, element, svg, outlines, marker, shapes: () => [], marks: () => [] };
    this.#frames.set(name, frame);
    new ResizeObserver(() => this.#redraw(frame)).observe(element);
    svg.addEventListener("pointerdown", (event) => this.#press(event, frame));
    svg.addEventListener("pointermove", (event) => this.#move(event, frame));
    svg.addEventListener("pointerup", (event) => this.#release(event, frame));
    svg.addEventListener("pointercancel", () => { this.#drag = this.#tap = null; });
    svg.addEventListener("pointerleave", () => this.leave());
    // A finger moves an item that it is put on, and scrolls the page elsewhere.
    svg.addEventListener("touchstart", (event) => {
      if (!this.drawing.draft && event.target.dataset.item !== undefined) event.preventDefault();
    }, { passive: false });
    return figure;
  }

  #press(event, { name, svg }) {
    const pixel = pointOf(svg, event);
    if (event.button !== 0 || !pixel) return;
    // Keys go to the items from here on, not to a name that was being typed.
    document.activeElement?.blur();
    this.#drag = this.#tap = null;
    if (this.drawing.draft) {
      event.preventDefault();
      const { type, corners } = this.drawing.draft;
      const isClosing = event.target.dataset.first !== undefined && kindOf(type).isClosed && corners.length >= 3;
      // Set when it is let go: a finger that scrolls sets none.
      this.#tap = { start: [event.clientX, event.clientY], ends: this.#presses.isSecond(event) || isClosing };
      return;
    }
    const { item, corner } = event.target.dataset;
    if (item === undefined) return;
    const id = Number(item);
    const index = corner === undefined ? null : Number(corner);
    const start = [event.clientX, event.clientY];
    this.#drag = { id, corner: index, start, moves: false, points: structuredClone(this.drawing.item(id).points) };
    if (index === null) this.#drag.from = this.place(name, pixel);
    this.drawing.select(id, index);
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  }

  #move(event, { name, svg }) {
    const pixel = pointOf(svg, event);
    if (!pixel) return;
    const drag = this.#drag;
    if (drag) this.#begins(drag, event);
    this.look(name, pixel, async (floor) => {
      if (!drag?.moves || !floor) return;
      const from = await drag.from;
      if (drag === this.#drag) this.#drop(drag, from, floor, event.altKey);
    });
  }

  // Whether a drag has left the place where it was pressed. The way back is remembered as it does.
  #begins(drag, { clientX, clientY }) {
    if (!drag.moves && Math.hypot(clientX - drag.start[0], clientY - drag.start[1]) >= STILL_PX) {
      drag.moves = true;
      this.drawing.remember();
    }
    return drag.moves;
  }

  #release(event, { name, svg }) {
    const [drag, tap, pixel] = [this.#drag, this.#tap, pointOf(svg, event)];
    this.#drag = this.#tap = null;
    if (tap && this.drawing.draft) {
      const [dx, dy] = [event.clientX - tap.start[0], event.clientY - tap.start[1]];
      if (tap.ends) return this.finish();
      if (pixel && Math.hypot(dx, dy) < Math.max(STILL_PX, 6)) this.add(name, pixel, event.altKey);
      return;
    }
    if (!drag || !pixel || !this.#begins(drag, event)) return;
    // Answers about earlier places of the drag may still be on their way, and are not used.
    this.later(async () => {
      const [from, floor] = await Promise.all([drag.from, this.place(name, pixel)]);
      if (floor) this.#drop(drag, from, floor, event.altKey);
    });
  }

  // Moves what is dragged to a place of the floor.
  #drop({ id, corner, points: before }, from, floor, isFree) {
    const { drawing } = this;
    const item = drawing.item(id);
    if (!item || item.points.length !== before.length) return;
    if (corner !== null) {
      drawing.moveCorner(id, corner, isFree ? floor : snapped(floor, SNAP_M, drawing.targets(id)));
    } else if (from) {
      drawing.moveBy(id, before, [floor[0] - from[0], floor[1] - from[1]]);
    }
  }

  #outline({ svg, width, height }, { corners, visible, hidden }, item) {
    if (!item) return [];
    const unit = unitOf(svg);
    const { id, name, color, selected, type } = item;
    const lines = (all, kind, behind) => all.map((line) => shape("polyline", {
      class: classes({ [kind]: true, behind, selected, [type]: true }),
      points: points(line),
      stroke: kind === "stroke" ? color : null,
      "data-outline": kind === "stroke" ? name : null,
      "data-item": kind === "grip" ? id : null,
    }));
    const shapes = [
      ...lines(hidden, "casing", true), ...lines(visible, "casing", false),
      ...lines(hidden, "stroke", true), ...lines(visible, "stroke", false),
    ];
    if (id !== null) shapes.push(...lines(hidden.concat(visible), "grip", false));
    if (item.isArrow) return shapes;
    const isInside = (p) => p && p[0] >= 0 && p[1] >= 0 && p[0] < width && p[1] < height;
    const inside = corners.filter(isInside);
    if (inside.length > 0 && name) {
      // Where the corners are that are seen; a whole name in any case.
      const [u, v] = [0, 1].map((axis) => inside.reduce((sum, p) => sum + p[axis], 0) / inside.length);
      const [rimX, rimY] = [Math.min(name.length * 4 * unit, width / 2), 10 * unit];
      const [x, y] = [Math.min(Math.max(u, rimX), width - rimX), Math.min(Math.max(v, rimY), height - rimY)];
      shapes.push(shape("text", { x, y, "font-size": 12.5 * unit, "stroke-width": 3 * unit, fill: color }, name));
    }
    if (selected) {
      corners.forEach((p, i) => p && shapes.push(shape("circle", {
        class: "corner", cx: p[0], cy: p[1], r: HANDLE_PX * unit, stroke: color,
        "data-item": id, "data-corner": id === null ? null : i, "data-first": id === null && i === 0 ? "" : null,
      })));
    }
    return shapes;
  }
}
