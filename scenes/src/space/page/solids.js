// Small matrices and meshes for the 3-D view. Matrices are column by column, as WebGL has them.

export const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);

export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const unit = (a) => a.map((c) => c / Math.hypot(...a));

// Seen from an eye that looks at a target, z up.
export function lookAt(eye, target) {
  const back = unit(minus(eye, target));
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  const axes = [right, up, back];
  return [0, 1, 2].flatMap((i) => [...axes.map((axis) => axis[i]), 0]).concat([...axes.map((axis) => -dot(axis, eye)), 1]);
}

// `fov` is the vertical field of view, radians.
export function perspective(fov, aspect, near, far) {
  const f = 1 / Math.tan(fov / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

export function product(a, b) {
  const element = (i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * Math.floor(i / 4) + k], 0);
  return Array.from({ length: 16 }, (_, i) => element(i));
}

export function transformed(m, [x, y, z]) {
  return [0, 1, 2, 3].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
}

// A capsule of any size: normals, and 1 in the upper half. The place is normal · radius + the half's middle.
export function capsule(around = 20, rings = 5) {
  const profile = [];
  for (let i = 0; i <= 2 * rings + 1; i += 1) {
    const isUpper = i > rings;
    const angle = (Math.PI / 2) * ((isUpper ? i - rings - 1 : i - rings) / rings);
    profile.push([Math.cos(angle), Math.sin(angle), isUpper ? 1 : 0]);
  }
  const vertex = ([r, z, half], k) => {
    const angle = (2 * Math.PI * k) / around;
    return [r * Math.cos(angle), r * Math.sin(angle), z, half];
  };
  const data = [];
  for (let i = 0; i + 1 < profile.length; i += 1) {
    for (let k = 0; k < around; k += 1) {
      const [a, b, c, d] = [vertex(profile[i], k), vertex(profile[i], k + 1), vertex(profile[i + 1], k + 1), vertex(profile[i + 1], k)];
      data.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
  }
  return new Float32Array(data);
}

// Triangles of a simple polygon, as corners: ears are cut off one after the other.
export function triangles(polygon) {
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const area = polygon.reduce((sum, p, i) => sum + turn([0, 0], p, polygon[(i + 1) % polygon.length]), 0);
  const rest = area < 0 ? polygon.toReversed() : polygon.slice();
  const isEar = (a, b, c) => turn(a, b, c) > 0
    && !rest.some((p) => p !== a && p !== b && p !== c && turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0);
  const cut = [];
  while (rest.length >= 3) {
    const n = rest.length;
    const i = rest.findIndex((b, k) => isEar(rest[(k + n - 1) % n], b, rest[(k + 1) % n]));
    if (i < 0) break;
    cut.push(rest[(i + n - 1) % n], rest[i], rest[(i + 1) % n]);
    rest.splice(i, 1);
  }
  return cut;
}

// Coloured triangles on the floor and above it, gathered for one drawing.
export class Triangles {
  data = [];

  #push([x, y], z, color) {
    this.data.push(x, y, z, ...color);
  }

  fill(polygon, z, color) {
    for (const corner of triangles(polygon)) this.#push(corner, z, color);
  }

  // A ribbon along places of the floor; `color` may depend on the number of the piece.
  ribbon(places, width, z, color) {
    for (let i = 1; i < places.length; i += 1) {
      const [a, b] = [places[i - 1], places[i]];
      const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
      if (length < 1e-6) continue;
      const [nx, ny] = [((a[1] - b[1]) / length) * width * 0.5, ((b[0] - a[0]) / length) * width * 0.5];
      const [p, q, r, s] = [[a[0] + nx, a[1] + ny], [a[0] - nx, a[1] - ny], [b[0] - nx, b[1] - ny], [b[0] + nx, b[1] + ny]];
      const tint = typeof color === "function" ? color(i) : color;
      for (const corner of [p, q, r, p, r, s]) this.#push(corner, z, tint);
    }
  }

  disc([x, y], rx, ry, z, color) {
    const rim = Array.from({ length: 28 }, (_, i) => [x + rx * Math.cos((i * Math.PI) / 14), y + ry * Math.sin((i * Math.PI) / 14)]);
    rim.forEach((p, i) => [[x, y], p, rim[(i + 1) % rim.length]].forEach((corner) => this.#push(corner, z, color)));
  }
}
