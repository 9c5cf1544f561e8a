// The rows of a list. A row stays the same element as long as its subject is listed: a button that is pressed, or has the focus,
// must not be replaced, as when the server's reply comes meanwhile, or the click is lost.

export class Rows {
  #rows = new Map(); // by key

  // `create(subject)` makes a row: { element, show(subject, index) }, and whatever its owner wants of it.
  constructor(list, create) {
    Object.assign(this, { list, create });
  }

  // The row of a subject, if it is listed.
  row(key) {
    return this.#rows.get(key);
  }

  // Shows these subjects in this order. The `key` of a subject is its own as long as it is listed.
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
