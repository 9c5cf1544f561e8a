// The rows of a list. A row stays the same element while its subject is listed: what is pressed or has the focus is not
// replaced meanwhile, as by a reply of the server, or the click would be lost.

export class Rows {
  #rows = new Map(); // by key

  // `create(subject)` makes a row: { element, show(subject, index) }.
  constructor(list, create) {
    Object.assign(this, { list, create });
  }

  // Shows these subjects in this order; `key` of one is the same as long as it is the same subject.
  show(subjects) {
    const keys = new Set(subjects.map(({ key }) => key));
    for (const [key, { element }] of this.#rows) {
      if (keys.has(key)) continue;
      element.remove();
      this.#rows.delete(key);
    }
    subjects.forEach((subject, i) => {
      if (!this.#rows.has(subject.key)) this.#rows.set(subject.key, this.create(subject));
      const { element, show } = this.#rows.get(subject.key);
      if (this.list.children[i] !== element) this.list.insertBefore(element, this.list.children[i] ?? null);
      show(subject, i);
    });
  }
}
