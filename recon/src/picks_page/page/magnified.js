// Pictures magnified around a pixel, with a cross on it.

const REACH_PX = 10; // from the cross to the rim, pixels of the picture

// Draws the surroundings of a pixel; a pixel's number is its middle's place.
export function magnify(canvas, image, [x, y], reach = REACH_PX) {
  const side = canvas.width;
  const context = canvas.getContext("2d");
  const scale = side / (2 * reach);
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.fillStyle = "#15181d";
  context.fillRect(0, 0, side, side);
  context.imageSmoothingEnabled = false;
  context.setTransform(scale, 0, 0, scale, scale * (reach - x - 0.5), scale * (reach - y - 0.5));
  context.drawImage(image, 0, 0);
  context.setTransform(1, 0, 0, 1, 0, 0);
  const middle = side / 2;
  for (const [width, color] of [[7, "#000a"], [3, "#ffd54a"]]) {
    context.lineWidth = width;
    context.strokeStyle = color;
    context.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(middle + 0.12 * side * dx, middle + 0.12 * side * dy);
      context.lineTo(middle + 0.46 * side * dx, middle + 0.46 * side * dy);
    }
    context.stroke();
  }
}

// The same point in two or more pictures, side by side.
export class MagnifiedPair {
  element = Object.assign(document.createElement("span"), { className: "pairs" });
  #shown = "";

  constructor(images) {
    this.images = images;
  }

  // Shows the surroundings of each [camera, pixel]. Nothing is drawn anew where the same ones are shown.
  show(picks) {
    const shown = JSON.stringify(picks.map(([camera, pixel]) => [camera, pixel, this.images.has(camera)]));
    if (shown === this.#shown) return;
    this.#shown = shown;
    this.element.replaceChildren(...picks.map(([camera, pixel]) => this.#canvas(camera, pixel)));
  }

  #canvas(camera, pixel) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 152;
    canvas.title = `${camera}: ${pixel[0].toFixed(1)}, ${pixel[1].toFixed(1)}`;
    const image = this.images.get(camera);
    if (image?.complete && image.naturalWidth > 0) magnify(canvas, image, pixel);
    else image?.addEventListener("load", () => magnify(canvas, image, pixel), { once: true });
    return canvas;
  }
}
