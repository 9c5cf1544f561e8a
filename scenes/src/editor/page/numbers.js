// The corners of the selected item as numbers, metres.

import { distance, edges } from "/geometry.js";
import { KINDS } from "/kinds.js";

const AXES = ["x", "y"];

export class Numbers {
  #rows = [];
  #shown = null;

  constructor(section, drawing) {
    Object.assign(this, { section, drawing });
    this.title = section.querySelector("h2");
    this.body = section.querySelector("tbody");
    drawing.addEventListener("change", () => this.#update());
  }

  #update() {
    const { drawing } = this;
    const item = drawing.draft ? null : drawing.item(drawing.selected);
    this.section.hidden = !item;
    if (!item) return;
    const { word, isClosed } = KINDS[item.type];
    this.title.textContent = `Corners of ${item.name || `this ${word}`}`;
    if (this.#shown !== item.id || this.#rows.length !== item.points.length) {
      this.#shown = item.id;
      this.#rows = item.points.map((_, i) => this.#row(item.id, i));
      this.body.replaceChildren(...this.#rows.map(({ row }) => row));
    }
    const lengths = edges(item.points, isClosed).map(([a, b]) => `${distance(a, b).toFixed(2)} m`);
    this.#rows.forEach(({ row, inputs, length, remove }, i) => {
      inputs.forEach((input, axis) => {
        if (document.activeElement !== input) input.value = item.points[i][axis].toFixed(3).replace(/\.?0+$/, "");
      });
      row.classList.toggle("chosen", i === drawing.corner);
      length.value = lengths[i] ?? "";
      remove.disabled = !drawing.canRemoveCorner(item.id);
    });
  }

  #row(id, index) {
    const row = document.createElement("tr");
    row.innerHTML = `<th scope="row">${index + 1}</th>${'<td><input type="number" step="0.01" inputmode="decimal" required></td>'.repeat(2)}
      <td><output></output></td><td><button type="button" title="Remove this corner" aria-label="Remove corner ${index + 1}">✕</button></td>`;
    const inputs = [...row.querySelectorAll("input")];
    const remove = row.querySelector("button");
    inputs.forEach((input, axis) => {
      input.setAttribute("aria-label", `${AXES[axis]} of corner ${index + 1}, metres`);
      input.addEventListener("change", () => this.#set(id, index, axis, input));
      input.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === "Escape") input.blur();
      });
      input.addEventListener("focus", () => this.drawing.selected === id && this.drawing.select(id, index));
    });
    remove.addEventListener("click", () => this.drawing.removeCorner(id, index));
    return { row, inputs, remove, length: row.querySelector("output") };
  }

  #set(id, index, axis, input) {
    const { drawing } = this;
    const value = Number(input.value);
    if (input.value === "" || !Number.isFinite(value)) {
      input.blur();
      return drawing.changed();
    }
    const place = [...drawing.item(id).points[index]];
    place[axis] = value;
    drawing.remember();
    drawing.moveCorner(id, index, place);
  }
}
