// SVG elements, and where pointers are on them.

const DOUBLE_MS = 500; // between the presses of a double click
const DOUBLE_PX = 12; // and on the screen

// Whether fingers point here, for which handles have to be larger.
export const isCoarse = matchMedia("(pointer: coarse)").matches;

export function shape(name, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined) element.setAttribute(key, value);
  }
  if (text !== undefined) element.textContent = text;
  return element;
}

export const points = (line) => line.map((p) => p.join(",")).join(" ");

// Class names, those that hold.
export const classes = (names) => Object.keys(names).filter((name) => names[name]).join(" ");

// The size of a pixel of the screen in the units of an SVG.
export function unitOf(svg) {
  const matrix = svg.getScreenCTM();
  return matrix && matrix.a > 0 ? 1 / matrix.a : 1;
}

// Where a pointer is, in the units of an SVG.
export function pointOf(svg, event) {
  const matrix = svg.getScreenCTM();
  if (!matrix) return null;
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
  return [point.x, point.y];
}

// Tells the second press of a double click, or of a double tap, from the first: browsers count clicks, not presses.
export class DoublePress {
  #last = null;

  isSecond({ clientX, clientY, timeStamp }) {
    const last = this.#last;
    const isSecond = last !== null && timeStamp - last.timeStamp < DOUBLE_MS
      && Math.hypot(clientX - last.clientX, clientY - last.clientY) < DOUBLE_PX;
    this.#last = isSecond ? null : { clientX, clientY, timeStamp };
    return isSecond;
  }
}
