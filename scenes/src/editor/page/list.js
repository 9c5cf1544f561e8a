// The lists of what is drawn, one for each kind: name, property, size, and buttons that double and remove one.

import { area, length } from "/geometry.js";
import { KINDS, LAYERS, isNamed } from "/kinds.js";
import { Rows } from "/rows.js";

const COPY = `<svg class="icon" viewBox="0 0 14 14" aria-hidden="true"><rect x="1" y="1" width="8" height="8" rx="1.5"/>
  <rect x="5" y="5" width="8" height="8" rx="1.5"/></svg>`;
const DIRECTIONS = ["both", "entry", "exit"];

export class List {
  #parts = new Map(); // by type: { part, rows }

  constructor(container, drawing) {
    Object.assign(this, { drawing });
    for (const type of [...LAYERS].reverse()) this.#parts.set(type, this.#part(type, container));
    drawing.addEventListener("change", () => this.#update());
  }

  // For the name of an item that was just drawn.
  focusName(id) {
    const row = this.#parts.get(this.drawing.item(id)?.type)?.rows.row(id);
    if (!row) return;
    if (!row.name.matches("input")) return row.element.scrollIntoView({ block: "nearest" });
    row.name.focus();
    row.name.select();
  }

  #part(type, container) {
    const { title, list, about } = KINDS[type];
    const part = container.appendChild(document.createElement("div"));
    part.className = "part";
    part.innerHTML = `<h2 title="${about}">${title}</h2><ul id="${list}"></ul>`;
    return { part, rows: new Rows(part.lastElementChild, ({ item }) => this.#row(item)) };
  }

  #update() {
    for (const [type, { part, rows }] of this.#parts) {
      const ofType = this.drawing.ofType(type);
      part.hidden = ofType.length === 0;
      rows.show(ofType.map((item) => ({ key: item.id, item })));
    }
  }

  #show(row, item, i) {
    const { word, isClosed } = KINDS[item.type];
    const shown = isNamed(item.type) ? item.name : `floor ${i + 1}`;
    if (document.activeElement !== row.name) row.name.value = shown;
    if (isNamed(item.type)) row.name.setCustomValidity(item.name.trim() ? "" : `A ${word} needs a name.`);
    row.showProperty(item);
    const size = isClosed ? area(item.points) : length(item.points);
    row.size.value = `${size.toFixed(size < 99.995 ? 2 : 1)} ${isClosed ? "m²" : "m"}`;
    row.element.classList.toggle("selected", item.id === this.drawing.selected);
    row.name.setAttribute("aria-label", `Name of ${word} ${i + 1}`);
    row.double.setAttribute("aria-label", `Duplicate ${word} ${item.name || i + 1}`);
    row.remove.setAttribute("aria-label", `Remove ${word} ${item.name || i + 1}`);
  }

  #row(item) {
    const { id, type, color } = item;
    const element = document.createElement("li");
    element.innerHTML = `<svg class="swatch ${type}" viewBox="0 0 14 14" aria-hidden="true"><rect x="1" y="1" width="12" height="12" rx="3"/></svg>
      ${isNamed(type) ? '<input maxlength="80" autocomplete="off" spellcheck="false">' : "<output></output>"}
      <span class="property"></span><output class="size"></output>
      <button type="button" title="Duplicate (D)">${COPY}</button><button type="button" title="Remove">✕</button>`;
    const [swatch, name, property, size, double, remove] = element.children;
    swatch.firstElementChild.setAttribute("fill", color);
    swatch.firstElementChild.setAttribute("stroke", color);
    const showProperty = this.#property(item, property);
    if (isNamed(type)) {
      name.addEventListener("change", () => this.drawing.set(id, { name: name.value.trim() }));
      name.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === "Escape") name.blur();
      });
    }
    double.addEventListener("click", () => this.focusName(this.drawing.duplicate(id).id));
    remove.addEventListener("click", () => this.drawing.remove(id));
    element.addEventListener("focusin", () => this.#select(id));
    element.addEventListener("click", (event) => !event.target.closest("button") && this.#select(id));
    const row = { element, name, size, double, remove, showProperty };
    return Object.assign(row, { show: (subject, i) => this.#show(row, subject.item, i) });
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
