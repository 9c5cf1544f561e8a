// What is being drawn: the things on the floor, which one is selected, the one that is not closed yet, and the way back
// and forth. Places are metres on the floor, [x, y]. Whoever shows something listens to `change`; `edit` is told when
// the things themselves are about to change.

import { edges, rounded } from "/geometry.js";
import { KINDS, LAYERS, fromPlain, isNamed, kindOf, plain } from "/kinds.js";

const MOST_STEPS_BACK = 200;
const DUPLICATE_M = 0.3; // from a thing to its copy

export class Drawing extends EventTarget {
  items = []; // { id, type, name, points, color, and its kind's properties }
  walls = []; // [from, to], to snap to
  selected = null; // an item's id
  corner = null; // of the selected item
  draft = null; // { type, corners, cursor }; its type may be "measure"
  #past = [];
  #future = [];
  #saved = { ids: [], plain: {} }; // as it was loaded or last saved
  #ids = 0;

  load(drawing, walls) {
    this.items = [];
    for (const type of LAYERS) {
      for (const item of drawing[KINDS[type].list]) this.items.push(this.#numbered(fromPlain(type, item)));
    }
    this.walls = walls;
    this.#past = [];
    this.#future = [];
    this.draft = null;
    this.select(null);
    this.markSaved(this.snapshot());
  }

  #numbered(item) {
    const { colors } = KINDS[item.type];
    const color = colors[this.ofType(item.type).length % colors.length];
    return { ...item, id: this.#ids++, color };
  }

  ofType(type) {
    return this.items.filter((item) => item.type === type);
  }

  // As files have it, and which item is where in it.
  snapshot() {
    const each = (use) => Object.fromEntries(LAYERS.map((type) => [KINDS[type].list, this.ofType(type).map(use)]));
    return { plain: each(plain), ids: each(({ id }) => id) };
  }

  // The question to the server that saves a snapshot.
  savingOf(snapshot) {
    const edited = { ...snapshot.plain };
    for (const type of LAYERS.filter(isNamed)) {
      const { list } = KINDS[type];
      const origin = (id) => this.#saved.ids[list].indexOf(id);
      edited[list] = snapshot.plain[list].map((item, i) => {
        const index = origin(snapshot.ids[list][i]);
        return { item, origin: index < 0 ? null : index };
      });
    }
    return { base: this.#saved.plain, edited };
  }

  markSaved(snapshot) {
    this.#saved = structuredClone(snapshot);
    this.changed();
  }

  get isUnsaved() {
    return JSON.stringify(this.snapshot().plain) !== JSON.stringify(this.#saved.plain);
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }

  item(id) {
    return this.items.find((item) => item.id === id);
  }

  select(id, corner = null) {
    this.selected = id;
    this.corner = corner;
    this.changed();
  }

  // What the corners of an item, or of a draft, can snap to: those of all others, and the walls.
  targets(own = null) {
    const others = this.items.filter(({ id }) => id !== own);
    const lines = others.flatMap(({ points, type }) => edges(points, KINDS[type].isClosed));
    return { corners: others.flatMap(({ points }) => points).concat(this.walls.flat()), edges: lines.concat(this.walls) };
  }

  // Before a change that can be undone; several moves of one drag are one change.
  remember() {
    this.#past.push(structuredClone(this.items));
    this.#past.splice(0, this.#past.length - MOST_STEPS_BACK);
    this.#future = [];
    this.dispatchEvent(new Event("edit"));
  }

  get canUndo() {
    return this.draft ? this.draft.corners.length > 0 : this.#past.length > 0;
  }

  get canRedo() {
    return this.draft === null && this.#future.length > 0;
  }

  // Takes back the last change; of what is being drawn the last corner.
  undo() {
    if (!this.draft) return this.#step(this.#past, this.#future);
    this.draft.corners.pop();
    this.changed();
  }

  redo() {
    if (!this.draft) this.#step(this.#future, this.#past);
  }

  #step(from, to) {
    if (from.length === 0) return;
    to.push(structuredClone(this.items));
    this.items = from.pop();
    this.dispatchEvent(new Event("edit"));
    if (!this.item(this.selected)) this.selected = null;
    this.corner = null;
    this.changed();
  }

  set(id, values) {
    this.remember();
    Object.assign(this.item(id), values);
    this.changed();
  }

  remove(id) {
    this.remember();
    this.items = this.items.filter((item) => item.id !== id);
    if (this.selected === id) this.select(null);
    this.changed();
  }

  // A copy beside the original, selected.
  duplicate(id) {
    this.remember();
    const { id: _, color: __, ...values } = structuredClone(this.item(id));
    const points = values.points.map(([x, y]) => rounded([x + DUPLICATE_M, y - DUPLICATE_M]));
    return this.#add({ ...values, points, name: this.#freeName(values.type) });
  }

  #add(values) {
    const item = this.#numbered(values);
    this.items.push(item);
    this.select(item.id);
    return item;
  }

  moveCorner(id, index, place) {
    this.item(id).points[index] = rounded(place);
    this.changed();
  }

  // All corners, from where they were.
  moveBy(id, points, [x, y]) {
    this.item(id).points = points.map((p) => rounded([p[0] + x, p[1] + y]));
    this.changed();
  }

  insertCorner(id, index, place) {
    this.remember();
    this.item(id).points.splice(index, 0, rounded(place));
    this.select(id, index);
  }

  canRemoveCorner(id) {
    const { points, type } = this.item(id);
    return points.length > KINDS[type].least;
  }

  // False where too few corners would be left.
  removeCorner(id, index) {
    if (!this.canRemoveCorner(id)) return false;
    this.remember();
    this.item(id).points.splice(index, 1);
    this.select(id);
    return true;
  }

  begin(type) {
    this.draft = { type, corners: [], cursor: null };
    this.select(null);
  }

  cancel() {
    this.draft = null;
    this.changed();
  }

  addCorner(place) {
    const { draft } = this;
    // A third click with the ruler begins anew.
    if (draft.type === "measure" && draft.corners.length === 2) draft.corners = [];
    draft.corners.push(rounded(place));
    this.changed();
  }

  // The new item, or nothing while there are too few corners.
  finish() {
    const { type, corners } = this.draft;
    if (corners.length < kindOf(type).least) return null;
    this.remember();
    this.draft = null;
    return this.#add({ type, name: this.#freeName(type), points: corners, ...KINDS[type].properties });
  }

  // Files want names of their own for all zones, regions and lines together.
  #freeName(type) {
    if (!isNamed(type)) return "";
    const names = new Set(this.items.map(({ name }) => name));
    let number = 1;
    while (names.has(`${KINDS[type].word} ${number}`)) number += 1;
    return `${KINDS[type].word} ${number}`;
  }
}
