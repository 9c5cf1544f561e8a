// The floor plan: items are drawn, moved and mended here. Places are metres on the floor, pixels those of the picture.

import { distance, snapped } from "/geometry.js";
import { LAYERS, kindOf } from "/kinds.js";
import { draftShapes, handleShapes, itemShapes, wallShapes } from "/plan_shapes.js";
import { DoublePress, pointOf, shape, unitOf } from "/shapes.js";

const CLOSING_PX = 11; // a click this near to the first corner closes
const SAME_PX = 5; // and this near to the last one sets no other
const SNAP_PX = 9; // to corners, edges and walls
const STILL_PX = 3; // a press that moves less is a click
const STEP_M = 0.1; // arrow keys
const FINE_STEP_M = 0.01; // with Shift
const MOST_ZOOM = 12;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class Plan {
  #drag = null;
  #marker = null;
  #presses = new DoublePress();

  // `finish` ends a draft, `hover` is told of the place under the pointer.
  constructor(svg, drawing, { finish, hover }) {
    Object.assign(this, { svg, drawing, finish, hover });
    drawing.addEventListener("change", () => this.#redraw());
    new ResizeObserver(() => this.#redraw()).observe(svg);
    svg.addEventListener("pointerdown", (event) => this.#press(event));
    svg.addEventListener("pointermove", (event) => this.#move(event));
    svg.addEventListener("pointerup", (event) => this.#release(event));
    svg.addEventListener("pointercancel", (event) => this.#release(event));
    svg.addEventListener("pointerleave", () => this.#leave());
    svg.addEventListener("keydown", (event) => this.#key(event));
    svg.addEventListener("focusin", (event) => this.#focus(event.target));
    svg.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  load(plan, version) {
    this.plan = plan;
    this.box = [-0.5, -0.5, plan.width, plan.height];
    const { width, height } = plan;
    const href = `/plan.png?${version}`;
    this.image = shape("image", { x: -0.5, y: -0.5, width, height, href });
    this.layer = shape("g", {});
    this.svg.replaceChildren(this.image, this.layer);
    this.#redraw();
  }

  pixel([x, y]) {
    const { low, high, px_per_m, corner_px } = this.plan;
    return [corner_px[0] + (x - low[0]) * px_per_m, corner_px[1] + (high[1] - y) * px_per_m];
  }

  floor([u, v]) {
    const { low, high, px_per_m, corner_px } = this.plan;
    return [low[0] + (u - corner_px[0]) / px_per_m, high[1] - (v - corner_px[1]) / px_per_m];
  }

  // Shows a place, from wherever it is known; null shows none.
  mark(floor) {
    this.#marker = floor;
    this.#redraw();
  }

  // The place in the middle of what is shown.
  middle() {
    const [x, y, width, height] = this.box;
    return this.floor([x + width / 2, y + height / 2]);
  }

  zoom(factor, around = null) {
    const { width, height } = this.plan;
    const [x, y, w] = this.box;
    const [u, v] = around ?? [x + w / 2, y + this.box[3] / 2];
    const shown = Math.min(Math.max(w / factor, width / MOST_ZOOM), width);
    const scale = shown / w;
    this.#showBox(u - (u - x) * scale, v - (v - y) * scale, shown, shown * (height / width));
  }

  #wheel(event) {
    event.preventDefault();
    if (this.plan) this.zoom(Math.exp(-event.deltaY * 0.0015), pointOf(this.svg, event));
  }

  // A part of the picture, moved onto it where it hangs over.
  #showBox(x, y, width, height) {
    const within = (value, size, whole) => Math.min(Math.max(value, -0.5), -0.5 + whole - size);
    this.box = [within(x, width, this.plan.width), within(y, height, this.plan.height), width, height];
    this.#redraw();
  }

  #pan([u, v]) {
    const [x, y, width, height] = this.box;
    this.#showBox(x - u, y - v, width, height);
  }

  #floorOf(event) {
    const point = this.plan && pointOf(this.svg, event);
    return point && this.floor(point);
  }

  // Metres of some pixels of the screen.
  #metres(px) {
    return (px * unitOf(this.svg)) / this.plan.px_per_m;
  }

  #snapped(floor, event, own = null) {
    return event.altKey ? floor : snapped(floor, this.#metres(SNAP_PX), this.drawing.targets(own));
  }

  #press(event) {
    if (event.button !== 0 || !this.plan) return;
    const { drawing } = this;
    const floor = this.#floorOf(event);
    const isSecond = this.#presses.isSecond(event);
    if (drawing.draft) {
      // The focus stays where drawing puts it: on the name of an item that is closed now.
      event.preventDefault();
      return isSecond ? this.finish() : this.#draw(floor, event);
    }
    const { item, corner, edge } = event.target.dataset;
    const id = item === undefined ? null : Number(item);
    this.#drag = { id, start: [event.clientX, event.clientY], from: floor, moves: false };
    if (corner !== undefined) {
      this.#drag.corner = Number(corner);
    } else if (edge !== undefined) {
      drawing.insertCorner(id, Number(edge) + 1, floor);
      Object.assign(this.#drag, { corner: Number(edge) + 1, moves: true });
    } else if (id !== null) {
      this.#drag.points = structuredClone(drawing.item(id).points);
    }
    drawing.select(id, this.#drag.corner ?? null);
    this.svg.setPointerCapture(event.pointerId);
    event.preventDefault();
    this.#focusOnCorner();
  }

  #draw(floor, event) {
    const { type, corners } = this.drawing.draft;
    const { isClosed } = kindOf(type);
    if (isClosed && corners.length >= 3 && distance(floor, corners[0]) < this.#metres(CLOSING_PX)) return this.finish();
    const last = corners.at(-1);
    if (!last || distance(floor, last) >= this.#metres(SAME_PX)) this.drawing.addCorner(this.#snapped(floor, event));
  }

  #move(event) {
    const floor = this.#floorOf(event);
    if (!floor) return;
    const { drawing } = this;
    if (this.#drag) this.#dragTo(event, floor);
    if (drawing.draft) {
      drawing.draft.cursor = this.#snapped(floor, event);
      drawing.changed();
    }
    this.hover(drawing.draft?.cursor ?? floor);
  }

  #dragTo(event, floor) {
    const drag = this.#drag;
    const [dx, dy] = [event.clientX - drag.start[0], event.clientY - drag.start[1]];
    if (!drag.moves) {
      if (Math.hypot(dx, dy) < STILL_PX) return;
      drag.moves = true;
      if (drag.id !== null) this.drawing.remember();
    }
    if (drag.id === null) {
      const unit = unitOf(this.svg);
      this.#pan([(event.clientX - (drag.last ?? drag.start)[0]) * unit, (event.clientY - (drag.last ?? drag.start)[1]) * unit]);
      drag.last = [event.clientX, event.clientY];
    } else if (drag.corner !== undefined) {
      this.drawing.moveCorner(drag.id, drag.corner, this.#snapped(floor, event, drag.id));
    } else {
      this.drawing.moveBy(drag.id, drag.points, [floor[0] - drag.from[0], floor[1] - drag.from[1]]);
    }
  }

  #release(event) {
    // The last movement may not have been told by an event of its own.
    const floor = event.type === "pointerup" && this.#drag && this.#floorOf(event);
    if (floor) this.#dragTo(event, floor);
    this.#drag = null;
  }

  #leave() {
    if (this.drawing.draft) {
      this.drawing.draft.cursor = null;
      this.drawing.changed();
    }
    this.hover(null);
  }

  #focus(target) {
    const { item, corner } = target.dataset;
    if (corner === undefined || item === undefined) return;
    const [id, index] = [Number(item), Number(corner)];
    if (this.drawing.selected !== id || this.drawing.corner !== index) this.drawing.select(id, index);
  }

  #focusOnCorner() {
    const { selected, corner } = this.drawing;
    const handle = corner === null ? null : this.layer.querySelector(`[data-item="${selected}"][data-corner="${corner}"]`);
    (handle ?? this.svg).focus({ preventScroll: true });
  }

  #key(event) {
    const { drawing } = this;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = ARROWS[event.key];
    if (arrow && (drawing.draft || drawing.corner !== null)) {
      const step = event.shiftKey ? FINE_STEP_M : STEP_M;
      const moved = ([x, y]) => [x + arrow[0] * step, y + arrow[1] * step];
      if (drawing.draft) {
        drawing.draft.cursor = moved(drawing.draft.cursor ?? drawing.draft.corners.at(-1) ?? this.middle());
        drawing.changed();
        this.hover(drawing.draft.cursor);
      } else {
        const { selected, corner } = drawing;
        drawing.remember();
        drawing.moveCorner(selected, corner, moved(drawing.item(selected).points[corner]));
        this.hover(drawing.item(selected).points[corner]);
      }
    } else if (event.key === " " && drawing.draft?.cursor) {
      this.#draw(drawing.draft.cursor, { altKey: true });
    } else {
      return;
    }
    event.preventDefault();
  }

  #redraw() {
    if (!this.plan) return;
    const { drawing, svg } = this;
    const active = this.layer.contains(document.activeElement) ? { ...document.activeElement.dataset } : null;
    svg.setAttribute("viewBox", this.box.join(" "));
    svg.classList.toggle("drawing", drawing.draft !== null);
    const unit = unitOf(svg);
    const toPixel = (place) => this.pixel(place);
    const chosen = drawing.item(drawing.selected);
    // The selected one lies on top, so that its handles can be reached; but the floor's polygons stay below.
    const layers = LAYERS.flatMap((type) => drawing.ofType(type));
    const order = chosen && chosen.type !== "floor" ? layers.filter((item) => item !== chosen).concat(chosen) : layers;
    const shapes = drawing.draft || this.#drag?.corner !== undefined ? wallShapes(drawing.walls, toPixel) : [];
    shapes.push(...order.flatMap((item) => itemShapes(item, item === chosen, unit, toPixel)));
    if (chosen && !drawing.draft) shapes.push(...handleShapes(chosen, drawing.corner, unit, toPixel));
    if (drawing.draft) shapes.push(...draftShapes(drawing.draft, unit, toPixel));
    if (this.#marker) {
      const [cx, cy] = this.pixel(this.#marker);
      shapes.push(shape("circle", { class: "marker", cx, cy, r: 4.5 * unit }));
    }
    this.layer.replaceChildren(...shapes);
    if (active?.corner !== undefined) this.#focusOnCorner();
  }
}
