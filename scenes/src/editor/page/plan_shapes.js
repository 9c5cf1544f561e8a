// SVG shapes of the floor plan: items, handles, what is being drawn, walls. `toPixel` maps metres to the plan's pixels,
// `unit` is the size of a pixel of the screen in these.

import { arrow, between, crosses, distance, edges, middle } from "/geometry.js";
import { KINDS, kindOf } from "/kinds.js";
import { classes, isCoarse, points, shape } from "/shapes.js";

const HANDLE_PX = isCoarse ? 10 : 6.5; // radii, on the screen
const MIDDLE_PX = isCoarse ? 7.5 : 4.5;

function text(content, [x, y], color, unit) {
  return shape("text", { x, y, "font-size": 14 * unit, "stroke-width": 3.5 * unit, fill: color }, content);
}

function arrowShapes(line, color, toPixel, item) {
  const found = arrow(line);
  if (!found) return [];
  const { tail, head, barbs } = found;
  return [[tail, head], [barbs[0], head, barbs[1]]].map((part) => shape("polyline", {
    class: "arrow", points: points(part.map(toPixel)), stroke: color, "data-item": item,
  }));
}

export function itemShapes({ id, type, name, points: places, color }, isSelected, unit, toPixel) {
  const { isClosed } = KINDS[type];
  const outline = points(places.map(toPixel));
  const isCrossed = crosses(places, isClosed);
  const form = isClosed ? "polygon" : "polyline";
  const shapes = [shape(form, {
    class: classes({ item: true, [type]: true, selected: isSelected, crossed: isCrossed }),
    points: outline, fill: isClosed ? color : "none", stroke: color, "data-item": id,
  })];
  // What has no inside is taken by a wider line that is not seen.
  if (type === "floor" || type === "line") shapes.push(shape(form, { class: "grip", points: outline, "data-item": id }));
  if (type === "line") shapes.push(...arrowShapes(places, color, toPixel, id));
  const label = type === "line" ? arrow(places)?.label : middle(places);
  if (name && label) shapes.push(text(name, toPixel(label), color, unit));
  return shapes;
}

export function handleShapes({ id, type, name, points: places, color }, chosen, unit, toPixel) {
  const { isClosed, word } = KINDS[type];
  const middles = edges(places, isClosed).map(([a, b], i) => {
    const [cx, cy] = toPixel(between(a, b, 0.5));
    return shape("circle", { class: "middle", cx, cy, r: MIDDLE_PX * unit, fill: color, "data-item": id, "data-edge": i });
  });
  const corners = places.map((place, i) => {
    const [cx, cy] = toPixel(place);
    return shape("circle", {
      class: classes({ corner: true, chosen: i === chosen }), cx, cy, r: HANDLE_PX * unit, stroke: color, tabindex: 0, role: "button",
      "aria-label": `Corner ${i + 1} of ${name || word}: x ${place[0].toFixed(2)} m, y ${place[1].toFixed(2)} m. Arrow keys move it, Delete removes it.`,
      "data-item": id, "data-corner": i,
    });
  });
  return middles.concat(corners);
}

export function draftShapes({ type, corners, cursor }, unit, toPixel) {
  const color = getComputedStyle(document.documentElement).getPropertyValue("--draft").trim();
  const { isClosed } = kindOf(type);
  const isMeasured = type === "measure" && corners.length === 2;
  const line = cursor && !isMeasured ? corners.concat([cursor]) : corners;
  const isCrossed = crosses(line, isClosed);
  const shapes = [shape("polyline", { class: classes({ draft: true, crossed: isCrossed }), points: points(line.map(toPixel)), stroke: color })];
  if (isClosed && line.length >= 3) {
    shapes.push(shape("polyline", { class: "closing", points: points([line.at(-1), line[0]].map(toPixel)), stroke: color }));
  }
  if (type === "line" && line.length >= 2) shapes.push(...arrowShapes(line, color, toPixel));
  corners.forEach((place, i) => {
    const [cx, cy] = toPixel(place);
    const isFirst = isClosed && i === 0;
    shapes.push(shape("circle", { class: classes({ corner: true, first: isFirst }), cx, cy, r: (isFirst ? HANDLE_PX + 1.5 : HANDLE_PX - 1.5) * unit, stroke: color }));
  });
  if (type === "measure" && line.length === 2) {
    const [x, y] = toPixel(between(line[0], line[1], 0.5));
    shapes.push(text(`${distance(line[0], line[1]).toFixed(2)} m`, [x, y - 14 * unit], color, unit));
  }
  return shapes;
}

export function wallShapes(walls, toPixel) {
  return walls.map((wall) => shape("polyline", { class: "wall", points: points(wall.map(toPixel)) }));
}
