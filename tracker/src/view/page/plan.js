// The plan with the people in it, as SVG. One unit is a centimetre.

const TRAIL_S = 5;
const TRAIL_PARTS = 5;
const HEADING_S = 0.7; // a person's arrow leads to where they will be then
const LEAST_SPEED = 0.25; // m/s, below which nobody has a heading
const CONE_M = 0.9;

export function shape(name, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

// Black or white, whichever reads better on a colour (WCAG).
export function inkOn(hex) {
  const [r, g, b] = [1, 3, 5].map((i) => (parseInt(hex.slice(i, i + 2), 16) / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.179 ? "#21252c" : "#ffffff";
}

export const colorOf = (room, id) => room.colors[id % room.colors.length];

export const middleOf = (polygon) => [0, 1].map((axis) => polygon.reduce((sum, p) => sum + p[axis], 0) / polygon.length);

// Middle of a line's longest piece, and the direction in which it is crossed inwards there: to the right.
export function gateOf(points) {
  let best = null;
  for (let i = 1; i < points.length; i += 1) {
    const [a, b] = [points[i - 1], points[i]];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (!best || length > best.length) {
      best = { length, middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], inward: [(b[1] - a[1]) / length, (a[0] - b[0]) / length] };
    }
  }
  return best;
}

export class Plan {
  #frame = null;
  #trails = new Map();

  constructor(svg) {
    this.svg = svg;
    new ResizeObserver(() => this.#redraw()).observe(svg);
  }

  load(room) {
    this.room = room;
    const [low, high] = room.plan;
    const [width, height] = [100 * (high[0] - low[0]), 100 * (high[1] - low[1])];
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const image = shape("image", { width, height, href: "/plan.jpg", preserveAspectRatio: "none" });
    this.marks = shape("g", {});
    this.people = shape("g", {});
    this.svg.replaceChildren(image, this.marks, this.people);
    this.#redraw();
  }

  show(frame, trails) {
    this.#frame = frame;
    this.#trails = trails;
    this.#drawPeople();
  }

  #at([x, y]) {
    const [low, high] = this.room.plan;
    return [100 * (x - low[0]), 100 * (high[1] - y)];
  }

  #line(places) {
    return places.map((p) => this.#at(p).map((u) => u.toFixed(1)).join(",")).join(" ");
  }

  // The size of a pixel of the screen.
  get #px() {
    const matrix = this.svg.getScreenCTM();
    return matrix && matrix.a > 0 ? 1 / matrix.a : 1;
  }

  #redraw() {
    if (!this.room || this.svg.clientWidth === 0) return;
    const { room } = this;
    const px = this.#px;
    const areas = (all, kind) => all.map(({ polygon }) => shape("polygon", { class: `area ${kind}`, points: this.#line(polygon) }));
    const shapes = room.floor.map((polygon) => shape("polygon", { class: "floor", points: this.#line(polygon) }));
    shapes.push(...areas(room.zones, "zone"), ...areas(room.regions, "region"));
    for (const { points } of room.lines) shapes.push(...this.#tripwire(points, px));
    shapes.push(...room.cameras.flatMap((camera) => this.#camera(camera, px)));
    this.names = new Map();
    const width = Number(this.svg.getAttribute("viewBox").split(" ")[2]);
    const height = Number(this.svg.getAttribute("viewBox").split(" ")[3]);
    // A whole name in any case, also beside the plan's edge.
    const name = (text, kind, [u, y]) => {
      const rim = Math.min(4 * text.length * px + 4 * px, width / 2);
      const x = Math.min(Math.max(u, rim), width - rim);
      const label = shape("text", { class: kind, x, y, "font-size": 13 * px, "stroke-width": 3.5 * px }, text);
      this.names.set(`${kind} ${text}`, label);
      shapes.push(label);
    };
    room.zones.forEach((zone) => name(zone.name, "zone", this.#at(middleOf(zone.polygon))));
    room.regions.forEach((region) => name(region.name, "region", this.#at(middleOf(region.polygon))));
    for (const line of room.lines) {
      const { middle, inward } = gateOf(line.points);
      const [x, y] = this.#at(middle);
      name(line.name, "tripwire", [x - inward[0] * 30 * px, y + inward[1] * 30 * px]);
    }
    for (const camera of room.cameras) {
      const [x, y] = this.#at(camera.center);
      name(camera.name, "camera", [x, y + (y + 20 * px > height ? -16 : 16) * px]);
    }
    this.marks.replaceChildren(...shapes);
    this.#drawPeople();
  }

  #tripwire(points, px) {
    const { middle, inward } = gateOf(points);
    const [[x, y], [dx, dy]] = [this.#at(middle), [inward[0] * px, -inward[1] * px]];
    const [tipX, tipY] = [x + 17 * dx, y + 17 * dy];
    const head = [[tipX, tipY], [tipX - 7 * dx - 5 * dy, tipY - 7 * dy + 5 * dx], [tipX - 7 * dx + 5 * dy, tipY - 7 * dy - 5 * dx]];
    return [
      shape("polyline", { class: "tripwire", points: this.#line(points) }),
      shape("path", { class: "tripwire", d: `M${x - 12 * dx} ${y - 12 * dy}L${tipX} ${tipY}M${head[1]}L${head[0]}L${head[2]}` }),
    ];
  }

  #camera({ center, frustum }, px) {
    const [cx, cy] = this.#at(center);
    const lens = shape("circle", { class: "lens", cx, cy, r: 5 * px });
    const sides = frustum.map((p) => [p[0] - center[0], p[1] - center[1]]);
    if (sides.length < 4) return [lens];
    // The middles of the image's left and right edge.
    const edges = [[0, 3], [1, 2]].map(([i, k]) => [0, 1].map((axis) => sides[i][axis] + sides[k][axis]));
    if (edges.some(([x, y]) => Math.hypot(x, y) < 0.05)) return [lens];
    const ends = edges.map(([x, y]) => [0, 1].map((axis) => center[axis] + (CONE_M * [x, y][axis]) / Math.hypot(x, y)));
    return [shape("polygon", { class: "cone", points: this.#line([center, ...ends]) }), lens];
  }

  #drawPeople() {
    if (!this.#frame || !this.room || this.svg.clientWidth === 0) return;
    const px = this.#px;
    const { people, health } = this.#frame;
    this.room.cameras.forEach(({ name }, i) => this.names.get(`camera ${name}`)?.classList.toggle("faulty", Boolean(health[i])));
    const trails = people.flatMap(({ id }) => this.#trail(this.#trails.get(id) ?? [], colorOf(this.room, id)));
    this.people.replaceChildren(...trails, ...people.flatMap((person) => this.#person(person, px)));
  }

  // Older parts are fainter.
  #trail(places, stroke) {
    const size = Math.ceil((places.length - 1) / TRAIL_PARTS);
    const parts = [];
    for (let i = 0; size > 0 && i < places.length - 1; i += size) {
      const opacity = 0.15 + (0.65 * (i + size)) / places.length;
      parts.push(shape("polyline", {
        class: "trail", points: this.#line(places.slice(i, i + size + 1)), stroke, "stroke-opacity": Math.min(opacity, 0.8).toFixed(2),
      }));
    }
    return parts;
  }

  #person({ id, x, y, radius, height, vx, vy, sigma, confidence }, px) {
    const color = colorOf(this.room, id);
    const [cx, cy] = this.#at([x, y]);
    const group = shape("g", { class: "person", "data-id": id, opacity: Math.max(confidence, 0.3).toFixed(2) });
    const r = 9.5 * px;
    group.append(
      shape("circle", { class: "body", cx, cy, r: 100 * radius, fill: color, stroke: color }),
      shape("ellipse", { class: "sigma", cx, cy, rx: Math.max(200 * sigma[0], r), ry: Math.max(200 * sigma[1], r), stroke: color }),
    );
    if (Math.hypot(vx, vy) > LEAST_SPEED) {
      const [x2, y2] = this.#at([x + vx * HEADING_S, y + vy * HEADING_S]);
      group.append(shape("line", { class: "heading", x1: cx, y1: cy, x2, y2, stroke: color }));
    }
    const width = (13 + 7 * String(id).length) * px;
    group.append(
      shape("rect", { class: "plate", x: cx - width / 2, y: cy - r, width, height: 2 * r, rx: r, fill: color }),
      shape("text", { class: "id", x: cx, y: cy, "font-size": 12.5 * px, fill: inkOn(color) }, id),
      shape("text", { class: "height", x: cx, y: cy + 18 * px, "font-size": 11 * px, "stroke-width": 3 * px }, `${height.toFixed(2)} m`),
      shape("title", {}, `Person ${id}: x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, ± ${sigma.map((s) => s.toFixed(2)).join(" and ")} m, height ${height.toFixed(2)} m, ${(100 * confidence).toFixed(0)} % certain`),
    );
    return [group];
  }
}

export { TRAIL_S };
