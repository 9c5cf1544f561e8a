// The scale: lengths between two clicked places, heights of cameras, calibration boards. The form shows one; a list all, where
// there are several.

import { Rows } from "/rows.js";

const byId = (id) => document.getElementById(id);

const kindOf = (table) => (table.board !== undefined ? "board" : table.height !== undefined ? "height" : "length");

// A table as it is saved; null while it is incomplete.
function complete({ camera, from, to, metres, height, board, square }) {
  if (from && to && metres > 0) return { camera, from, to, metres };
  if (height > 0) return { camera, height };
  if (board && square > 0) return { camera, board, square };
  return null;
}

const labels = {
  length: ({ camera, from, metres }) => (from ? `${metres ?? "?"} m in ${camera}` : "a length"),
  height: ({ camera, height }) => `${camera} is ${height ?? "?"} m high`,
  board: ({ camera, board, square }) => `board ${board || "?"} of ${square ?? "?"} m in ${camera}`,
};

export class ScaleForm {
  stated = [{}]; // what is stated, complete or not: at least one
  hasFile = false; // whether the file has a scale
  chosen = 0; // the one in the form
  ends = null; // of a length while it is clicked: { camera, pixels }
  #rows = new Rows(byId("scales"), ({ key }) => this.#row(key));

  // `before` is called before the scale changes, for the way back; `after` when it has, or when only its clicked ends have.
  constructor(before, after) {
    Object.assign(this, { before, after });
    for (const id of ["scale-kind", "scale-camera", "board", "square", "metres"]) byId(id).addEventListener("change", () => this.#read());
    byId("ends").addEventListener("click", () => {
      this.ends = this.ends ? null : { camera: null, pixels: [] };
      after(false);
    });
    byId("scale-add").addEventListener("click", () => {
      before();
      this.chosen = this.stated.push({}) - 1;
      this.#show();
      after(true);
    });
  }

  offer(cameras) {
    byId("scale-camera").replaceChildren(...cameras.map((name) => new Option(name, name)));
  }

  // Takes what the file has.
  load(tables) {
    this.hasFile = tables.length > 0;
    const known = tables.map((table) => Object.fromEntries(Object.entries(table).filter(([, value]) => value !== null)));
    this.restore(known.length > 0 ? known : [{}]);
  }

  // Goes back to what was stated before.
  restore(stated) {
    this.stated = stated;
    this.chosen = Math.min(this.chosen, this.stated.length - 1);
    this.ends = null;
    this.#show();
  }

  // The tables as they are saved; none leave the file's.
  whole() {
    return this.stated.map(complete).filter(Boolean);
  }

  // Whether one is incomplete beside others, or in place of the file's: it would be lost.
  isOpen() {
    return (this.stated.length > 1 || this.hasFile) && !this.stated.every(complete);
  }

  // One end of the length is clicked.
  setEnd(camera, place) {
    if (this.ends.camera !== camera) this.ends = { camera, pixels: [] };
    this.ends.pixels.push(place);
    if (this.ends.pixels.length < 2) return this.after(false);
    this.before();
    const [from, to] = this.ends.pixels;
    this.stated[this.chosen] = { camera, from, to, metres: Number(byId("metres").value) || null };
    this.ends = null;
    this.#show();
    byId("metres").focus();
    this.after(true);
  }

  // The lines of the lengths in a camera's picture.
  linesIn(camera) {
    const drawn = this.stated.filter((table, i) => table.from && table.camera === camera && !(this.ends && i === this.chosen));
    const lines = drawn.map(({ from, to }) => [from, to]);
    if (this.ends?.camera === camera) lines.push([this.ends.pixels[0], this.ends.pixels[0]]);
    return lines;
  }

  say() {
    const { from, camera } = this.stated[this.chosen];
    byId("ends").setAttribute("aria-pressed", this.ends !== null);
    byId("ends-said").value = this.ends ? `${this.ends.pixels.length} of 2` : from ? `in ${camera}` : "";
    this.#rows.show(this.stated.length > 1 ? this.stated.map((table, i) => ({ key: i, table })) : []);
    byId("scale-add").disabled = !this.stated.every(complete);
  }

  #row(index) {
    const element = document.createElement("li");
    const choose = element.appendChild(document.createElement("button"));
    choose.type = "button";
    choose.addEventListener("click", () => {
      this.chosen = index;
      this.ends = null;
      this.#show();
      this.after(false);
    });
    const remove = element.appendChild(document.createElement("button"));
    Object.assign(remove, { type: "button", textContent: "✕", title: `Remove scale ${index + 1}` });
    remove.setAttribute("aria-label", remove.title);
    remove.addEventListener("click", () => {
      this.before();
      this.stated.splice(index, 1);
      this.ends = null;
      if (index < this.chosen) this.chosen -= 1;
      this.chosen = Math.min(this.chosen, this.stated.length - 1);
      this.#show();
      this.after(true);
    });
    const show = ({ table }) => {
      const isChosen = index === this.chosen;
      element.classList.toggle("selected", isChosen);
      choose.textContent = labels[kindOf(table)](table);
      choose.setAttribute("aria-pressed", isChosen);
    };
    return { element, show };
  }

  #show() {
    const table = this.stated[this.chosen];
    const kind = kindOf(table);
    byId("scale-kind").value = kind;
    byId("metres").value = (kind === "height" ? table.height : table.metres) ?? "";
    byId("board").value = table.board ?? "";
    byId("square").value = table.square ?? "";
    if (table.camera) byId("scale-camera").value = table.camera;
    for (const part of document.querySelectorAll("[data-scale]")) part.hidden = !part.dataset.scale.split(" ").includes(kind);
  }

  #read() {
    this.before();
    const number = (id) => Number(byId(id).value) || null;
    const camera = byId("scale-camera").value;
    const { from, to, camera: of } = this.stated[this.chosen];
    const tables = {
      height: () => ({ camera, height: number("metres") }),
      board: () => ({ camera, board: byId("board").value, square: number("square") }),
      length: () => ({ ...(from && { camera: of, from, to }), metres: number("metres") }),
    };
    this.stated[this.chosen] = tables[byId("scale-kind").value]();
    this.#show();
    this.after(true);
  }
}
