// What the editor has in the room's 3-D view: the things that are drawn on the floor, and the place that is pointed at.

import { arrow, middle } from "/geometry.js";
import { KINDS, LAYERS, kindOf } from "/kinds.js";
import { rgb } from "/solids.js";
import { styleColor } from "/space.js";

// Of each kind: the inside's opacity, and the width of its rim, metres.
const LOOKS = { floor: [0.08, 0.03], region: [0.18, 0.035], zone: [0.25, 0.035], line: [0, 0.06] };
const ARROW_M = 0.04;
const DRAFT_M = 0.045;
const PLACE_M = 0.07;
const LOWEST_M = 0.045; // above the floor, so that layers lie one on the other
const LAYER_M = 0.004;

export class DrawnScene {
  place = null; // of the floor, that is pointed at

  constructor(drawing) {
    this.drawing = drawing;
  }

  marks(flat) {
    const { draft, selected } = this.drawing;
    LAYERS.forEach((type, layer) => {
      const [inside, width] = LOOKS[type];
      const z = LOWEST_M + LAYER_M * layer;
      for (const { id, points, color } of this.drawing.ofType(type)) {
        const [tint, isSelected] = [rgb(color), id === selected];
        const { isClosed } = KINDS[type];
        if (isClosed) flat.fill(points, z, [...tint, isSelected ? inside + 0.15 : inside]);
        flat.ribbon(isClosed ? [...points, points[0]] : points, isSelected ? 1.8 * width : width, z, [...tint, 0.9]);
        if (type === "line") drawArrow(flat, points, z, [...tint, 0.9]);
      }
    });
    const top = LOWEST_M + LAYER_M * LAYERS.length;
    if (draft) {
      const { type, corners, cursor } = draft;
      const isMeasured = type === "measure" && corners.length === 2;
      const line = cursor && !isMeasured ? [...corners, cursor] : corners;
      const tint = styleColor("draft", 0.95);
      flat.ribbon(line, DRAFT_M, top, tint);
      if (type === "line") drawArrow(flat, line, top, tint);
      for (const corner of kindOf(type).isClosed ? corners.slice(0, 1) : []) flat.disc(corner, PLACE_M, PLACE_M, top, tint);
    }
    if (this.place) flat.disc(this.place, PLACE_M, PLACE_M, top, [...rgb("#ffd54a"), 1]);
  }

  bodies() {
    return [];
  }

  labels() {
    return this.drawing.items.filter(({ name }) => name).map(({ name, type, points, color }) => {
      const [x, y] = (type === "line" && arrow(points)?.label) || middle(points);
      return { text: name, place: [x, y, 0.1], background: color, ink: "#ffffff" };
    });
  }
}

function drawArrow(flat, points, z, color) {
  const found = arrow(points);
  if (!found) return;
  flat.ribbon([found.tail, found.head], ARROW_M, z, color);
  flat.ribbon([found.barbs[0], found.head, found.barbs[1]], ARROW_M, z, color);
}
