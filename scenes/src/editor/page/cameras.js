// The cameras' images with what the server says of each zone's outline. Corners can be set and moved here, too.

import { classes, pointOf, points, shape, unitOf } from "/shapes.js";

const HANDLE_PX = 5.5; // on the screen

export class Cameras {
  #frames = new Map();
  #drag = null;

  // `look` asks which place of the floor a pixel shows, and does with it what it is told to; `leave` ends that.
  constructor(container, drawing, { look, leave, add, settle, finish }) {
    Object.assign(this, { container, drawing, look, leave, add, settle, finish });
  }

  load(cameras, version) {
    this.#frames.clear();
    this.container.replaceChildren(...cameras.map((camera) => this.#figure(camera, version)));
  }

  // What the server says of the given zones (the draft is the last of them).
  show(reply, zones) {
    for (const { camera, outlines } of reply) {
      const frame = this.#frames.get(camera);
      if (!frame) continue;
      frame.shapes = () => outlines.flatMap((outline, i) => this.#outline(frame, outline, zones[i]));
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
    svg.addEventListener("dblclick", () => this.drawing.draft && this.finish());
    svg.addEventListener("pointercancel", () => { this.#drag = null; });
    svg.addEventListener("pointerleave", () => this.leave());
    return figure;
  }

  #press(event, { name, svg }) {
    const pixel = pointOf(svg, event);
    if (event.button !== 0 || !pixel) return;
    // Keys go to the zones from here on, not to a name that was being typed.
    document.activeElement?.blur();
    if (this.drawing.draft) {
      event.preventDefault();
      if (event.target.dataset.first !== undefined && this.drawing.draft.corners.length >= 3) return this.finish();
      // The second click of a double click sets no corner.
      return event.detail > 1 ? undefined : this.add(name, pixel);
    }
    const { zone, corner } = event.target.dataset;
    if (corner === undefined) return;
    this.#drag = { id: Number(zone), corner: Number(corner), moves: false };
    this.drawing.select(this.#drag.id, this.#drag.corner);
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  }

  #release(event, { name, svg }) {
    const [drag, pixel] = [this.#drag, pointOf(svg, event)];
    this.#drag = null;
    // Answers about earlier places of the drag may still be on their way, and are not used.
    if (drag?.moves && pixel) this.settle(name, pixel, drag);
  }

  #move(event, { name, svg }) {
    const pixel = pointOf(svg, event);
    if (!pixel) return;
    const drag = this.#drag;
    this.look(name, pixel, (floor) => {
      if (!drag || drag !== this.#drag || !floor) return;
      if (!drag.moves) this.drawing.remember();
      drag.moves = true;
      this.drawing.moveCorner(drag.id, drag.corner, floor);
    });
  }

  #outline({ svg, width, height }, { corners, visible, hidden }, zone) {
    if (!zone) return [];
    const unit = unitOf(svg);
    const lines = (all, kind, behind) => all.map((line) => shape("polyline", {
      class: classes({ [kind]: true, behind, selected: zone.selected }),
      points: points(line),
      stroke: kind === "line" ? zone.color : null,
      "data-outline": zone.name,
    }));
    const shapes = [
      ...lines(hidden, "casing", true), ...lines(visible, "casing", false),
      ...lines(hidden, "line", true), ...lines(visible, "line", false),
    ];
    const isInside = (p) => p && p[0] >= 0 && p[1] >= 0 && p[0] < width && p[1] < height;
    const inside = corners.filter(isInside);
    if (inside.length > 0 && zone.id !== null) {
      // Where the corners are that are seen; a whole name in any case.
      const [u, v] = [0, 1].map((axis) => inside.reduce((sum, p) => sum + p[axis], 0) / inside.length);
      const [rimX, rimY] = [Math.min(zone.name.length * 4 * unit, width / 2), 10 * unit];
      const [x, y] = [Math.min(Math.max(u, rimX), width - rimX), Math.min(Math.max(v, rimY), height - rimY)];
      shapes.push(shape("text", { x, y, "font-size": 12.5 * unit, "stroke-width": 3 * unit, fill: zone.color }, zone.name));
    }
    if (zone.selected || zone.id === null) {
      corners.forEach((p, i) => p && shapes.push(shape("circle", {
        class: "corner", cx: p[0], cy: p[1], r: HANDLE_PX * unit, stroke: zone.color,
        "data-zone": zone.id ?? undefined, "data-corner": zone.id === null ? undefined : i, "data-first": zone.id === null && i === 0 ? "" : undefined,
      })));
    }
    return shapes;
  }
}
