// Plane geometry on the floor. Places are [x, y] in metres.

const ARROW_M = 0.45; // most length of a line's arrow
const ARROW_SHARE = 0.5; // of the piece that it crosses

// To the millimetre: finer than anybody draws.
export const rounded = ([x, y]) => [Math.round(x * 1000) / 1000, Math.round(y * 1000) / 1000];

export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

export const between = (a, b, share) => [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];

// Pairs of neighbours; with the last and the first where the outline is closed.
export function edges(points, isClosed) {
  const pairs = points.slice(1).map((b, i) => [points[i], b]);
  return isClosed && points.length > 2 ? pairs.concat([[points.at(-1), points[0]]]) : pairs;
}

export function area(polygon) {
  return Math.abs(edges(polygon, true).reduce((sum, [[x, y], [u, v]]) => sum + x * v - u * y, 0)) / 2;
}

export const length = (points) => edges(points, false).reduce((sum, [a, b]) => sum + distance(a, b), 0);

const turn = (a, b, c) => Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));

// Whether two edges cross that are no neighbours, as in a bow tie.
export function crosses(points, isClosed) {
  const all = edges(points, isClosed);
  const meet = ([a, b], [c, d]) => turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0;
  return all.some((edge, i) => all.slice(i + 2).some((other) => meet(edge, other)));
}

export function middle(points) {
  return [0, 1].map((axis) => points.reduce((sum, p) => sum + p[axis], 0) / points.length);
}

// The arrow across a line's longest piece, from its left to its right: [tail, head, both barbs]; null without a piece.
export function arrow(points) {
  const longest = edges(points, false).reduce((best, edge) => (distance(...edge) > distance(...best) ? edge : best), [[0, 0], [0, 0]]);
  const whole = distance(...longest);
  if (whole === 0) return null;
  const [a, b] = longest;
  const along = [(b[0] - a[0]) / whole, (b[1] - a[1]) / whole];
  const size = Math.min(ARROW_M, ARROW_SHARE * whole);
  const at = (right, forth) => {
    const [x, y] = between(a, b, 0.5);
    return [x + size * (along[1] * right + along[0] * forth), y + size * (-along[0] * right + along[1] * forth)];
  };
  return { tail: at(-0.5, 0), head: at(0.5, 0), barbs: [at(0.22, 0.2), at(0.22, -0.2)], label: at(-0.95, 0) };
}

// The nearest of some corners, or else the nearest place on an edge, within reach; or else the place itself.
export function snapped(place, reach, { corners, edges: lines }) {
  const nearest = (places) => places
    .map((other) => ({ other, away: distance(place, other) }))
    .reduce((best, one) => (one.away < best.away ? one : best), { other: null, away: reach }).other;
  const onEdge = ([a, b]) => {
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const share = ((place[0] - a[0]) * dx + (place[1] - a[1]) * dy) / (dx * dx + dy * dy || 1);
    return between(a, b, Math.min(Math.max(share, 0), 1));
  };
  return nearest(corners) ?? nearest(lines.map(onEdge)) ?? place;
}
