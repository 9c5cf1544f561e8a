// The scale: a length between two clicked places, a camera's height, or a calibration board.

const byId = (id) => document.getElementById(id);

export class ScaleForm {
  stated = null; // what the form says, whole or not
  ends = null; // of a length while it is clicked: { camera, pixels }

  // `before` is called before the scale changes, for the way back; `after` when it has, or when only its clicked ends have.
  constructor(before, after) {
    Object.assign(this, { before, after });
    for (const id of ["scale-kind", "scale-camera", "board", "square", "metres"]) byId(id).addEventListener("change", () => this.#read());
    byId("ends").addEventListener("click", () => {
      this.ends = this.ends ? null : { camera: null, pixels: [] };
      after(false);
    });
  }

  offer(cameras) {
    byId("scale-camera").replaceChildren(...cameras.map((name) => new Option(name, name)));
  }

  load(stated) {
    this.stated = stated && Object.fromEntries(Object.entries(stated).filter(([, value]) => value !== null));
    this.ends = null;
    this.#show();
  }

  // The scale as it is saved; null while it is not whole, which leaves the file's.
  whole() {
    if (!this.stated) return null;
    const { camera, from, to, metres, height, board, square } = this.stated;
    if (from && to && metres > 0) return { camera, from, to, metres };
    if (height > 0) return { camera, height };
    if (board && square > 0) return { camera, board, square };
    return null;
  }

  // One end of the length is clicked.
  setEnd(camera, place) {
    if (this.ends.camera !== camera) this.ends = { camera, pixels: [] };
    this.ends.pixels.push(place);
    if (this.ends.pixels.length < 2) return this.after(false);
    this.before();
    const [from, to] = this.ends.pixels;
    this.stated = { camera, from, to, metres: Number(byId("metres").value) || null };
    this.ends = null;
    this.#show();
    byId("metres").focus();
    this.after(true);
  }

  // The line of the length in a camera's picture.
  lineIn(camera) {
    if (this.ends) return this.ends.camera === camera ? [this.ends.pixels[0], this.ends.pixels[0]] : null;
    return this.stated?.from && this.stated.camera === camera ? [this.stated.from, this.stated.to] : null;
  }

  say() {
    byId("ends").setAttribute("aria-pressed", this.ends !== null);
    byId("ends-said").value = this.ends ? `${this.ends.pixels.length} of 2` : this.stated?.from ? `in ${this.stated.camera}` : "";
  }

  #show() {
    const { stated } = this;
    const kind = stated?.board !== undefined ? "board" : stated?.height !== undefined ? "height" : "length";
    byId("scale-kind").value = kind;
    byId("metres").value = (kind === "height" ? stated.height : stated?.metres) ?? "";
    byId("board").value = stated?.board ?? "";
    byId("square").value = stated?.square ?? "";
    if (stated?.camera) byId("scale-camera").value = stated.camera;
    for (const part of document.querySelectorAll("[data-scale]")) part.hidden = !part.dataset.scale.split(" ").includes(kind);
  }

  #read() {
    this.before();
    const number = (id) => Number(byId(id).value) || null;
    const camera = byId("scale-camera").value;
    const { stated } = this;
    const kinds = {
      height: () => ({ camera, height: number("metres") }),
      board: () => ({ camera, board: byId("board").value, square: number("square") }),
      length: () => (stated?.from ? { camera: stated.camera, from: stated.from, to: stated.to } : {}),
    };
    const kind = byId("scale-kind").value;
    this.stated = kinds[kind]();
    if (kind === "length") this.stated.metres = number("metres");
    this.#show();
    this.after(true);
  }
}
