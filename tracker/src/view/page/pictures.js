// The cameras' pictures, and how the cameras are.

export class Pictures {
  #cameras = []; // name, image, number of the picture
  #paused = false;

  constructor(container) {
    this.container = container;
    new ResizeObserver(() => this.#arrange()).observe(container);
  }

  hang(names) {
    if (JSON.stringify(names) === JSON.stringify(this.#cameras.map((camera) => camera.name))) return;
    this.#cameras = names.map((name) => {
      const figure = document.createElement("figure");
      const caption = figure.appendChild(document.createElement("figcaption"));
      caption.appendChild(document.createElement("span")).textContent = name;
      const health = caption.appendChild(document.createElement("span"));
      health.hidden = true;
      const image = figure.appendChild(new Image());
      return { name, figure, health, image, picture: null };
    });
    this.container.replaceChildren(...this.#cameras.map((camera) => camera.figure));
    this.#arrange();
  }

  // Pictures stay as they are while the page is paused.
  set paused(isPaused) {
    this.#paused = isPaused;
    this.container.classList.toggle("paused", isPaused);
  }

  health(states) {
    this.#cameras.forEach(({ health }, i) => {
      health.hidden = i >= states.length;
      health.textContent = states[i] ?? "works";
      health.className = states[i] ? "health faulty" : "health";
    });
  }

  // Shows pictures by their numbers when they are there as a whole.
  async show(numbers) {
    if (this.#paused) return;
    const fresh = this.#cameras.map((camera, i) => [i, camera, numbers[i]]);
    const wanted = fresh.filter(([, camera, picture]) => picture !== null && picture !== camera.picture);
    await Promise.all(wanted.map((one) => this.#replace(...one)));
  }

  // The numbers of another run are others.
  forget() {
    for (const camera of this.#cameras) camera.picture = null;
  }

  async #replace(index, camera, picture) {
    const image = new Image();
    image.alt = `What ${camera.name} sees, and beside it the simulated view`;
    image.src = `/camera/${index}.jpg?${picture}`;
    await image.decode();
    const isFirst = camera.picture === null;
    camera.image.replaceWith(image);
    Object.assign(camera, { image, picture });
    if (isFirst) this.#arrange();
  }

  // Two columns or more where each picture keeps a width at which it can be read.
  #arrange() {
    const shown = this.#cameras.map((camera) => camera.image).find((image) => image.naturalWidth > 0);
    const least = shown && shown.naturalWidth > 1.8 * shown.naturalHeight ? 520 : 330;
    const columns = Math.max(1, Math.min(this.#cameras.length, Math.floor(this.container.clientWidth / least)));
    this.container.style.setProperty("--columns", columns);
  }
}
