// The lists of what is drawn, one for each kind: name, property, size, and buttons that double and remove one.

import { area, length } from "/geometry.js";
import { KINDS, LAYERS, isNamed } from "/kinds.js";

const COPY = `<svg class="icon" viewBox="0 0 14 14" aria-hidden="true"><rect x="1" y="1" width="8" height="8" rx="1.5"/>
  <rect x="5" y="5" width="8" height="8" rx="1.5"/></svg>`;
const DIRECTIONS = ["both", "entry", "exit"];

export class List {
  #rows = new Map();
  #parts = new Map();

  constructor(container, drawing) {
    Object.assign(this, { drawing });
    for (const type of [...LAYERS].reverse()) this.#parts.set(type, container.appendChild(this.#part(type)));
    drawing.addEventListener("change", () => this.#update());
  }

  // For the name of an item that was just drawn.
  focusName(id) {
    const row = this.#rows.get(id);
    if (!row) return;
    if (!row.name.matches("input")) return row.item.scrollIntoView({ block: "nearest" });
    row.name.focus();
    row.name.select();
  }

  #part(type) {
    const { title, list, about } = KINDS[type];
    const part = document.createElement("div");
    part.className = "part";
    part.innerHTML = `<h2 title="${about}">${title}</h2><ul id="${list}"></ul>`;
    return part;
  }

  #update() {
    const { items, selected } = this.drawing;
    for (const [id, row] of this.#rows) {
      if (!items.some((item) => item.id === id)) {
        row.item.remove();
        this.#rows.delete(id);
      }
    }
    for (const [type, part] of this.#parts) {
      const ofType = this.drawing.ofType(type);
      part.hidden = ofType.length === 0;
      ofType.forEach((item, i) => this.#show(item, i, part.lastElementChild, item.id === selected));
    }
  }

  #show(item, i, list, isSelected) {
    const { word, isClosed } = KINDS[item.type];
    const row = this.#rows.get(item.id) ?? this.#row(item);
    if (list.children[i] !== row.item) list.insertBefore(row.item, list.children[i] ?? null);
    const shown = isNamed(item.type) ? item.name : `floor ${i + 1}`;
    if (document.activeElement !== row.name) row.name.value = shown;
    if (isNamed(item.type)) row.name.setCustomValidity(item.name.trim() ? "" : `A ${word} needs a name.`);
    row.show(item);
    const size = isClosed ? area(item.points) : length(item.points);
    row.size.value = `${size.toFixed(size < 99.995 ? 2 : 1)} ${isClosed ? "m²" : "m"}`;
    row.item.classList.toggle("selected", isSelected);
    row.name.setAttribute("aria-label", `Name of ${word} ${i + 1}`);
    row.double.setAttribute("aria-label", `Duplicate ${word} ${item.name || i + 1}`);
    row.remove.setAttribute("aria-label", `Remove ${word} ${item.name || i + 1}`);
  }

  #row(item) {
    const { id, type, color } = item;
    const row = document.createElement("li");
    row.innerHTML = `<svg class="swatch ${type}" viewBox="0 0 14 14" aria-hidden="true"><rect x="1" y="1" width="12" height="12" rx="3"/></svg>
      ${isNamed(type) ? '<input maxlength="80" autocomplete="off" spellcheck="false">' : "<output></output>"}
      <span class="property"></span><output class="size"></output>
      <button type="button" title="Duplicate (D)">${COPY}</button><button type="button" title="Remove">✕</button>`;
    const [swatch, name, property, size, double, remove] = row.children;
    swatch.firstElementChild.setAttribute("fill", color);
    swatch.firstElementChild.setAttribute("stroke", color);
    const show = this.#property(item, property);
    if (isNamed(type)) {
      name.addEventListener("change", () => this.drawing.set(id, { name: name.value.trim() }));
      name.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === "Escape") name.blur();
      });
    }
    double.addEventListener("click", () => this.focusName(this.drawing.duplicate(id).id));
    remove.addEventListener("click", () => this.drawing.remove(id));
    row.addEventListener("focusin", () => this.#select(id));
    row.addEventListener("click", (event) => !event.target.closest("button") && this.#select(id));
    const parts = { item: row, name, size, double, remove, show };
    this.#rows.set(id, parts);
    return parts;
  }

  // The element of a kind's property, and what shows an item's value in it.
  #property({ id, type }, parent) {
    if (type === "zone") {
      const kind = parent.appendChild(document.createElement("select"));
      for (const value of DIRECTIONS) kind.add(new Option(value, value));
      kind.title = "Which way people pass: they enter, they leave, or both";
      kind.addEventListener("change", () => this.drawing.set(id, { kind: kind.value }));
      return (item) => {
        kind.value = item.kind;
        kind.setAttribute("aria-label", `Kind of zone ${item.name}`);
      };
    }
    if (type === "region") {
      parent.innerHTML = '<label><input type="number" min="0" step="any" inputmode="decimal" placeholder="–"> s</label>';
      const seconds = parent.querySelector("input");
      parent.title = "A stay longer than this is an event of its own";
      seconds.addEventListener("change", () => {
        const isUsable = seconds.value === "" || Number(seconds.value) > 0;
        if (isUsable) this.drawing.set(id, { dwell_s: seconds.value === "" ? null : Number(seconds.value) });
        else this.drawing.changed();
      });
      return (item) => {
        if (document.activeElement !== seconds) seconds.value = item.dwell_s ?? "";
        seconds.setAttribute("aria-label", `Dwell seconds of region ${item.name}`);
      };
    }
    if (type === "line") {
      const turn = parent.appendChild(document.createElement("button"));
      Object.assign(turn, { type: "button", textContent: "⇄", title: "Swap in and out" });
      turn.addEventListener("click", () => this.drawing.set(id, { points: this.drawing.item(id).points.toReversed() }));
      return (item) => turn.setAttribute("aria-label", `Swap in and out of line ${item.name}`);
    }
    return () => {};
  }

  #select(id) {
    if (this.drawing.selected !== id && this.drawing.item(id)) this.drawing.select(id);
  }
}
