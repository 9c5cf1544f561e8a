// The floor plan: zones are drawn, moved and mended here. Places are metres on the floor, pixels those of the picture.

import { crosses, distance } from "/drawing.js";
import { classes, pointOf, points, shape, unitOf } from "/shapes.js";

const HANDLE_PX = 6.5; // radii, on the screen
const MIDDLE_PX = 4.5;
const CLOSING_PX = 11; // a click this near to the first corner closes
const SAME_PX = 5; // and this near to the last one is the second of a double click
const SNAP_PX = 9; // to corners and edges of other zones
const STILL_PX = 3; // a press that moves less is a click
const STEP_M = 0.1; // arrow keys
const FINE_STEP_M = 0.01; // with Shift
const MOST_ZOOM = 12;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class Plan {
  #drag = null;
  #marker = null;

  // `finish` ends a draft, `hover` is told of the place under the pointer, `say` of what cannot be done.
  constructor(svg, drawing, { finish, hover, say }) {
    Object.assign(this, { svg, drawing, finish, hover, say });
    drawing.addEventListener("change", () => this.#redraw());
    new ResizeObserver(() => this.#redraw()).observe(svg);
    svg.addEventListener("pointerdown", (event) => this.#press(event));
    svg.addEventListener("pointermove", (event) => this.#move(event));
    svg.addEventListener("pointerup", (event) => this.#release(event));
    svg.addEventListener("pointercancel", (event) => this.#release(event));
    svg.addEventListener("pointerleave", () => this.#leave());
    svg.addEventListener("dblclick", () => this.drawing.draft && this.finish());
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

  // On the screen.
  #pxBetween(a, b) {
    return distance(this.pixel(a), this.pixel(b)) / unitOf(this.svg);
  }

  #press(event) {
    if (event.button !== 0 || !this.plan) return;
    const { drawing } = this;
    const floor = this.#floorOf(event);
    if (drawing.draft) {
      // The focus stays where drawing puts it: on the name of a zone that is closed now.
      event.preventDefault();
      return this.#draw(floor, event.altKey);
    }
    const { zone, corner, edge } = event.target.dataset;
    const id = zone === undefined ? null : Number(zone);
    this.#drag = { id, start: [event.clientX, event.clientY], from: floor, moves: false };
    if (corner !== undefined) {
      this.#drag.corner = Number(corner);
    } else if (edge !== undefined) {
      drawing.insertCorner(id, Number(edge) + 1, floor);
      Object.assign(this.#drag, { corner: Number(edge) + 1, moves: true });
    } else if (id !== null) {
      this.#drag.polygon = structuredClone(drawing.zone(id).polygon);
    }
    drawing.select(id, this.#drag.corner ?? null);
    this.svg.setPointerCapture(event.pointerId);
    event.preventDefault();
    this.#focusOnCorner();
  }

  #draw(floor, isFree) {
    const { corners } = this.drawing.draft;
    if (corners.length >= 3 && this.#pxBetween(floor, corners[0]) < CLOSING_PX) return this.finish();
    const last = corners.at(-1);
    if (!last || this.#pxBetween(floor, last) >= SAME_PX) this.drawing.addCorner(isFree ? floor : this.#snapped(floor, null));
  }

  #move(event) {
    const floor = this.#floorOf(event);
    if (!floor) return;
    const { drawing } = this;
    if (this.#drag) this.#dragTo(event, floor);
    if (drawing.draft) {
      drawing.draft.cursor = event.altKey ? floor : this.#snapped(floor, null);
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
      this.drawing.moveCorner(drag.id, drag.corner, event.altKey ? floor : this.#snapped(floor, drag.id));
    } else {
      const [x, y] = [floor[0] - drag.from[0], floor[1] - drag.from[1]];
      drag.polygon.forEach((p, i) => this.drawing.moveCorner(drag.id, i, [p[0] + x, p[1] + y]));
    }
  }

  // The nearest corner of another zone, or else the nearest place on an edge of one, where the pointer is near.
  #snapped(floor, own) {
    const others = this.drawing.zones.filter((zone) => zone.id !== own).map((zone) => zone.polygon);
    const nearest = (places) => places
      .map((place) => ({ place, px: this.#pxBetween(floor, place) }))
      .reduce((best, one) => (one.px < best.px ? one : best), { place: null, px: SNAP_PX }).place;
    const onEdge = (a, b) => {
      const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
      const share = ((floor[0] - a[0]) * dx + (floor[1] - a[1]) * dy) / (dx * dx + dy * dy || 1);
      const t = Math.min(Math.max(share, 0), 1);
      return [a[0] + t * dx, a[1] + t * dy];
    };
    const edges = others.flatMap((polygon) => polygon.map((a, i) => onEdge(a, polygon[(i + 1) % polygon.length])));
    return nearest(others.flat()) ?? nearest(edges) ?? floor;
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
    const { zone, corner } = target.dataset;
    if (corner === undefined || zone === undefined) return;
    const [id, index] = [Number(zone), Number(corner)];
    if (this.drawing.selected !== id || this.drawing.corner !== index) this.drawing.select(id, index);
  }

  #focusOnCorner() {
    const { selected, corner } = this.drawing;
    const handle = corner === null ? null : this.layer.querySelector(`[data-zone="${selected}"][data-corner="${corner}"]`);
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
        drawing.moveCorner(selected, corner, moved(drawing.zone(selected).polygon[corner]));
        this.hover(drawing.zone(selected).polygon[corner]);
      }
    } else if (event.key === " " && drawing.draft?.cursor) {
      this.#draw(drawing.draft.cursor);
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
    const chosen = drawing.zone(drawing.selected);
    // The selected one lies on top, so that its handles can be reached.
    const order = drawing.zones.filter((zone) => zone !== chosen).concat(chosen ?? []);
    const shapes = order.flatMap((zone) => this.#zoneShapes(zone, zone === chosen, unit));
    if (chosen && !drawing.draft) shapes.push(...this.#handles(chosen, unit));
    if (drawing.draft) shapes.push(...this.#draftShapes(drawing.draft, unit));
    if (this.#marker) {
      const [cx, cy] = this.pixel(this.#marker);
      shapes.push(shape("circle", { class: "marker", cx, cy, r: 4.5 * unit }));
    }
    this.layer.replaceChildren(...shapes);
    if (active?.corner !== undefined) this.#focusOnCorner();
  }

  #zoneShapes(zone, isSelected, unit) {
    const pixels = zone.polygon.map((p) => this.pixel(p));
    const [x, y] = [0, 1].map((axis) => pixels.reduce((sum, p) => sum + p[axis], 0) / pixels.length);
    return [
      shape("polygon", {
        class: classes({ zone: true, selected: isSelected, crossed: crosses(zone.polygon) }),
        points: points(pixels),
        fill: zone.color,
        stroke: zone.color,
        "data-zone": zone.id,
      }),
      shape("text", { x, y, "font-size": 14 * unit, "stroke-width": 3.5 * unit, fill: zone.color }, zone.name),
    ];
  }

  #handles({ id, name, polygon, color }, unit) {
    const pixels = polygon.map((p) => this.pixel(p));
    const middles = pixels.map(([x, y], i) => {
      const [u, v] = pixels[(i + 1) % pixels.length];
      return shape("circle", {
        class: "middle", cx: (x + u) / 2, cy: (y + v) / 2, r: MIDDLE_PX * unit, fill: color, "data-zone": id, "data-edge": i,
      });
    });
    const corners = pixels.map(([cx, cy], i) => shape("circle", {
      class: classes({ corner: true, chosen: i === this.drawing.corner }),
      cx, cy, r: HANDLE_PX * unit, stroke: color, tabindex: 0, role: "button",
      "aria-label": `Corner ${i + 1} of ${name}: x ${polygon[i][0].toFixed(2)} m, y ${polygon[i][1].toFixed(2)} m. Arrow keys move it, Delete removes it.`,
      "data-zone": id, "data-corner": i,
    }));
    return middles.concat(corners);
  }

  #draftShapes({ corners, cursor }, unit) {
    const color = getComputedStyle(document.documentElement).getPropertyValue("--draft").trim();
    const pixels = corners.map((p) => this.pixel(p));
    const line = cursor ? pixels.concat([this.pixel(cursor)]) : pixels;
    const isCrossed = crosses(cursor ? corners.concat([cursor]) : corners);
    const shapes = [shape("polyline", { class: classes({ draft: true, crossed: isCrossed }), points: points(line), stroke: color })];
    if (line.length >= 3) {
      shapes.push(shape("polyline", { class: "closing", points: points([line.at(-1), line[0]]), stroke: color }));
    }
    pixels.forEach(([cx, cy], i) => shapes.push(shape("circle", {
      class: classes({ corner: true, first: i === 0 }), cx, cy, r: (i === 0 ? HANDLE_PX + 1.5 : HANDLE_PX - 1.5) * unit, stroke: color,
    })));
    return shapes;
  }
}
