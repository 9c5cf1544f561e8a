// One reference picture: what is marked in it, zoom by the wheel, a magnifier under the pointer.

import { classes, isCoarse, pointOf, points, shape, unitOf } from "/shapes.js";
import { magnify } from "/magnified.js";

const REACH_PX = isCoarse ? 22 : 11; // of a pick for the pointer, on the screen
const STILL_PX = isCoarse ? 8 : 3; // a press that moves less is a click
const LENS_PX = 168; // the magnifier
const CLOSEST = 40; // times

export class Picture {
  #view = null; // [x, y, width, height] in pixels of the picture
  #drag = null;
  #marks = { picks: [], proposals: [], line: null, lengths: [] };

  // `pick` sets a pixel, `move` moves a pick, `hover` is told the pixel under the pointer, `choose` another camera.
  constructor(figure, { pick, grab, move, hover, choose }) {
    Object.assign(this, { figure, pick, grab, move, hover, camera: null, image: null });
    const caption = figure.appendChild(document.createElement("figcaption"));
    this.select = caption.appendChild(document.createElement("select"));
    this.select.setAttribute("aria-label", "Camera");
    this.select.addEventListener("change", () => choose(this.select.value));
    this.svg = figure.appendChild(shape("svg", { preserveAspectRatio: "xMidYMid meet", tabindex: 0 }));
    this.picture = this.svg.appendChild(shape("image", { x: -0.5, y: -0.5 }));
    this.shapes = this.svg.appendChild(shape("g", {}));
    this.lens = figure.appendChild(document.createElement("canvas"));
    this.lens.className = "lens";
    this.lens.width = this.lens.height = 2 * LENS_PX;
    this.lens.hidden = true;
    const { svg } = this;
    svg.addEventListener("pointerdown", (event) => this.#press(event));
    svg.addEventListener("pointermove", (event) => this.#moved(event));
    svg.addEventListener("pointerup", (event) => this.#release(event));
    svg.addEventListener("pointercancel", () => { this.#drag = null; });
    svg.addEventListener("pointerleave", () => { this.lens.hidden = true; this.hover(this, null); });
    svg.addEventListener("wheel", (event) => this.#zoom(event), { passive: false });
    new ResizeObserver(() => this.#redraw()).observe(svg);
  }

  offer(cameras) {
    this.select.replaceChildren(...cameras.map((name) => new Option(name, name)));
  }

  show(camera, image, [width, height]) {
    if (this.camera === camera && this.image === image) return;
    Object.assign(this, { camera, image, width, height });
    this.select.value = camera;
    this.svg.dataset.camera = camera;
    this.svg.setAttribute("aria-label", `What ${camera} sees`);
    for (const [key, value] of Object.entries({ href: image.src, width, height })) this.picture.setAttribute(key, value);
    this.#look([-0.5, -0.5, width, height]);
  }

  mark(marks) {
    this.#marks = marks;
    this.#redraw();
  }

  #look(view) {
    this.#view = view;
    this.svg.setAttribute("viewBox", view.join(" "));
    this.#redraw();
  }

  #inside([x, y]) {
    return x >= -0.5 && y >= -0.5 && x <= this.width - 0.5 && y <= this.height - 0.5;
  }

  #pixel(event) {
    const place = this.image && pointOf(this.svg, event);
    return place && this.#inside(place) ? place : null;
  }

  #zoom(event) {
    const place = this.image && pointOf(this.svg, event);
    if (!place) return;
    event.preventDefault();
    const [x, y, width, height] = this.#view;
    const least = this.width / CLOSEST;
    const factor = Math.min(Math.max(1.0018 ** event.deltaY, least / width), this.width / width);
    const keep = (low, size, at, most) => {
      const next = at - (at - low) * factor;
      return Math.min(Math.max(next, -0.5), most - 0.5 - size * factor);
    };
    this.#look([keep(x, width, place[0], this.width), keep(y, height, place[1], this.height), width * factor, height * factor]);
  }

  #press(event) {
    const pixel = this.#pixel(event);
    if (event.button !== 0 || !pixel) return;
    document.activeElement?.blur();
    const id = event.target.dataset.pick;
    this.#drag = { start: [event.clientX, event.clientY], place: pixel, view: this.#view, id, moves: false };
    if (id !== undefined) {
      const old = this.#marks.picks.find((pick) => pick.id === Number(id)).pixel;
      this.#drag.offset = [old[0] - pixel[0], old[1] - pixel[1]];
    }
    this.svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  }

  #moved(event) {
    const pixel = this.#pixel(event);
    this.#magnify(pixel);
    this.hover(this, pixel);
    const drag = this.#drag;
    if (!drag) return;
    const [dx, dy] = [event.clientX - drag.start[0], event.clientY - drag.start[1]];
    if (!drag.moves && Math.hypot(dx, dy) >= STILL_PX) {
      drag.moves = true;
      if (drag.id !== undefined) this.grab(Number(drag.id));
    }
    if (!drag.moves) return;
    if (drag.id !== undefined) {
      if (pixel) this.move(Number(drag.id), this.camera, [pixel[0] + drag.offset[0], pixel[1] + drag.offset[1]]);
      return;
    }
    const unit = unitOf(this.svg);
    const [x, y, width, height] = drag.view;
    const keep = (low, most) => Math.min(Math.max(low, -0.5), most);
    this.#look([keep(x - dx * unit, this.width - 0.5 - width), keep(y - dy * unit, this.height - 0.5 - height), width, height]);
  }

  #release(event) {
    const [drag, pixel] = [this.#drag, this.#pixel(event)];
    this.#drag = null;
    if (drag && !drag.moves && pixel) this.pick(this.camera, pixel, drag.id === undefined ? null : Number(drag.id), event.shiftKey);
  }

  #magnify(pixel) {
    this.lens.hidden = !pixel;
    if (!pixel) return;
    // Not under the pointer.
    this.lens.classList.toggle("left", pixel[0] - this.#view[0] > 0.5 * this.#view[2]);
    magnify(this.lens, this.image, pixel);
  }

  #redraw() {
    if (!this.image) return;
    const unit = unitOf(this.svg);
    const all = [];
    const { picks, proposals, line, lengths } = this.#marks;
    if (line?.line.length > 1) all.push(shape("polyline", { class: "epipolar", points: points(line.line) }));
    const ring = (kind, [cx, cy], r) => shape("circle", { class: kind, cx, cy, r: r * unit });
    if (line?.guess) all.push(ring("guess", line.guess, 10));
    for (const [[x1, y1], [x2, y2]] of lengths) {
      all.push(shape("line", { class: "length", x1, y1, x2, y2 }));
    }
    for (const pixel of proposals) all.push(ring("proposal", pixel, 8));
    for (const { id, label, pixel, state, isSelected } of picks) {
      all.push(ring("halo", pixel, 8), ring(classes({ pick: true, [state]: state !== "", selected: isSelected }), pixel, 8));
      const [x, y] = pixel;
      for (const [dx, dy] of [[1, 0], [0, 1]]) {
        all.push(shape("line", { class: "cross", x1: x - 3 * dx * unit, y1: y - 3 * dy * unit, x2: x + 3 * dx * unit, y2: y + 3 * dy * unit }));
      }
      all.push(shape("text", { x: x + 11 * unit, y: y - 7 * unit, "font-size": 13 * unit, "stroke-width": 3 * unit }, label));
      all.push(shape("circle", { class: "grip", cx: x, cy: y, r: REACH_PX * unit, "data-pick": id }));
    }
    this.shapes.replaceChildren(...all);
  }
}
