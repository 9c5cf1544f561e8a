// What is being drawn: the zones, which one is selected, the one that is not closed yet, and the way back and forth.
// Places are metres on the floor, [x, y]. Whoever shows something listens to `change`; `edit` is told when the
// zones themselves are about to change.

const COLORS = ["#00868b", "#c2500a", "#6f4bb8", "#1f6fc4", "#b0246b", "#4d7c0f"];
const MOST_STEPS_BACK = 200;
const DUPLICATE_M = 0.3; // from a zone to its copy

// To the millimetre: finer than anybody draws.
export const rounded = ([x, y]) => [Math.round(x * 1000) / 1000, Math.round(y * 1000) / 1000];

export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

export function area(polygon) {
  const twice = polygon.reduce((sum, [x, y], i) => {
    const [u, v] = polygon[(i + 1) % polygon.length];
    return sum + x * v - u * y;
  }, 0);
  return Math.abs(twice) / 2;
}

const turn = (a, b, c) => Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));

// Whether two edges of an outline cross that are no neighbours, as in a bow tie.
export function crosses(polygon) {
  const edges = polygon.map((p, i) => [p, polygon[(i + 1) % polygon.length]]);
  const meet = ([a, b], [c, d]) => turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0;
  return edges.some((edge, i) => edges.slice(i + 2).some((other) => meet(edge, other)));
}

export class Drawing extends EventTarget {
  zones = [];
  selected = null; // a zone's id
  corner = null; // of the selected zone
  draft = null; // { corners, cursor }
  #past = [];
  #future = [];
  #saved = "[]";
  #ids = 0;

  load(zones) {
    this.zones = zones.map((zone) => this.#numbered(zone));
    this.#past = [];
    this.#future = [];
    this.draft = null;
    this.select(null);
    this.markSaved(this.plain());
  }

  #numbered(zone) {
    const id = this.#ids++;
    return { ...zone, id, color: COLORS[id % COLORS.length] };
  }

  // As files and the server have them.
  plain() {
    return this.zones.map(({ name, polygon, kind }) => ({ name, polygon, kind }));
  }

  markSaved(plain) {
    this.#saved = JSON.stringify(plain);
    this.changed();
  }

  get isUnsaved() {
    return JSON.stringify(this.plain()) !== this.#saved;
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }

  zone(id) {
    return this.zones.find((zone) => zone.id === id);
  }

  select(id, corner = null) {
    this.selected = id;
    this.corner = corner;
    this.changed();
  }

  // Before a change that can be undone; several moves of one drag are one change.
  remember() {
    this.#past.push(structuredClone(this.zones));
    this.#past.splice(0, this.#past.length - MOST_STEPS_BACK);
    this.#future = [];
    this.dispatchEvent(new Event("edit"));
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }

  undo() {
    this.#step(this.#past, this.#future);
  }

  redo() {
    this.#step(this.#future, this.#past);
  }

  #step(from, to) {
    if (from.length === 0) return;
    to.push(structuredClone(this.zones));
    this.zones = from.pop();
    this.dispatchEvent(new Event("edit"));
    if (!this.zone(this.selected)) this.selected = null;
    this.corner = null;
    this.changed();
  }

  set(id, values) {
    this.remember();
    Object.assign(this.zone(id), values);
    this.changed();
  }

  remove(id) {
    this.remember();
    this.zones = this.zones.filter((zone) => zone.id !== id);
    if (this.selected === id) this.select(null);
    this.changed();
  }

  // A copy beside the original, selected.
  duplicate(id) {
    this.remember();
    const { polygon, kind } = this.zone(id);
    const moved = polygon.map(([x, y]) => rounded([x + DUPLICATE_M, y - DUPLICATE_M]));
    const zone = this.#numbered({ name: this.#freeName(), kind, polygon: moved });
    this.zones.push(zone);
    this.select(zone.id);
    return zone;
  }

  moveCorner(id, index, place) {
    this.zone(id).polygon[index] = rounded(place);
    this.changed();
  }

  insertCorner(id, index, place) {
    this.remember();
    this.zone(id).polygon.splice(index, 0, rounded(place));
    this.select(id, index);
  }

  // False where too few corners would be left.
  removeCorner(id, index) {
    if (this.zone(id).polygon.length <= 3) return false;
    this.remember();
    this.zone(id).polygon.splice(index, 1);
    this.select(id);
    return true;
  }

  begin(cursor = null) {
    this.draft = { corners: [], cursor };
    this.select(null);
  }

  cancel() {
    this.draft = null;
    this.changed();
  }

  addCorner(place) {
    this.draft.corners.push(rounded(place));
    this.changed();
  }

  // The new zone, or nothing while there are too few corners.
  finish() {
    const { corners } = this.draft;
    if (corners.length < 3) return null;
    this.remember();
    const zone = this.#numbered({ name: this.#freeName(), kind: "both", polygon: corners });
    this.zones.push(zone);
    this.draft = null;
    this.select(zone.id);
    return zone;
  }

  #freeName() {
    const names = new Set(this.zones.map((zone) => zone.name));
    let number = 1;
    while (names.has(`zone ${number}`)) number += 1;
    return `zone ${number}`;
  }
}
