// The list of zones: name, kind, area, and a button that removes one.

import { area } from "/drawing.js";

const KINDS = ["both", "entry", "exit"];

export class List {
  #rows = new Map();

  constructor(list, none, drawing) {
    Object.assign(this, { list, none, drawing });
    drawing.addEventListener("change", () => this.#update());
  }

  // For the name of a zone that was just drawn.
  focusName(id) {
    const name = this.#rows.get(id)?.name;
    name?.focus();
    name?.select();
  }

  #update() {
    const { zones, selected } = this.drawing;
    for (const [id, row] of this.#rows) {
      if (!zones.some((zone) => zone.id === id)) {
        row.item.remove();
        this.#rows.delete(id);
      }
    }
    zones.forEach((zone, i) => {
      const row = this.#rows.get(zone.id) ?? this.#row(zone);
      if (this.list.children[i] !== row.item) this.list.insertBefore(row.item, this.list.children[i] ?? null);
      if (document.activeElement !== row.name) row.name.value = zone.name;
      row.name.setCustomValidity(zone.name.trim() ? "" : "A zone needs a name.");
      row.kind.value = zone.kind;
      row.area.value = `${area(zone.polygon).toFixed(2)} m²`;
      row.item.classList.toggle("selected", zone.id === selected);
      row.name.setAttribute("aria-label", `Name of zone ${i + 1}`);
      row.kind.setAttribute("aria-label", `Kind of zone ${zone.name}`);
      row.remove.setAttribute("aria-label", `Remove zone ${zone.name}`);
    });
    this.none.hidden = zones.length > 0;
  }

  #row({ id, color }) {
    const item = document.createElement("li");
    item.innerHTML = `<svg class="swatch" viewBox="0 0 14 14" aria-hidden="true"><rect width="14" height="14" rx="4"/></svg>
      <input maxlength="80" autocomplete="off" spellcheck="false"><select></select><output></output>
      <button type="button" title="Remove">✕</button>`;
    const [swatch, name, kind, shownArea, remove] = item.children;
    swatch.firstElementChild.setAttribute("fill", color);
    for (const value of KINDS) kind.add(new Option(value, value));
    kind.title = "Which way people pass: they enter, they leave, or both";
    name.addEventListener("change", () => this.drawing.set(id, { name: name.value.trim() }));
    name.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === "Escape") name.blur();
    });
    kind.addEventListener("change", () => this.drawing.set(id, { kind: kind.value }));
    remove.addEventListener("click", () => this.drawing.remove(id));
    item.addEventListener("focusin", () => this.#select(id));
    item.addEventListener("click", (event) => event.target !== remove && this.#select(id));
    const row = { item, name, kind, area: shownArea, remove };
    this.#rows.set(id, row);
    return row;
  }

  #select(id) {
    if (this.drawing.selected !== id && this.drawing.zone(id)) this.drawing.select(id);
  }
}
