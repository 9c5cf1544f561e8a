// The kinds of things that are drawn on the floor: what they are called, how they are closed, and what files call them.

export const KINDS = {
  floor: {
    title: "Floor", word: "floor", key: "f", list: "floor", isClosed: true, least: 3,
    colors: ["#2e7d32", "#4d7c0f"],
    about: "Where people can stand. Without any it follows from the room's geometry.",
  },
  region: {
    title: "Regions", word: "region", key: "r", list: "regions", outline: "polygon", isClosed: true, least: 3,
    colors: ["#6f4bb8", "#9b3fa8", "#4a56c8"], properties: { dwell_s: null },
    about: "Where people are counted and timed.",
  },
  zone: {
    title: "Zones", word: "zone", key: "n", list: "zones", outline: "polygon", isClosed: true, least: 3,
    colors: ["#00868b", "#c2500a", "#1f6fc4", "#7d6200"], properties: { kind: "both" },
    about: "Where people come in or leave.",
  },
  line: {
    title: "Lines", word: "line", key: "l", list: "lines", outline: "points", isClosed: false, least: 2,
    colors: ["#ad1457", "#b3401e"], properties: {},
    about: "Crossed along the arrow: in; against it: out.",
  },
};

// Names of the kinds, from the lowest layer to the uppermost.
export const LAYERS = Object.keys(KINDS);

// What a ruler is drawn as, besides.
export const RULER = { word: "measure", key: "m", isClosed: false, least: 2 };

export const kindOf = (type) => KINDS[type] ?? RULER;

// Whether something of this kind has a name; the floor's polygons have none.
export const isNamed = (type) => KINDS[type].outline !== undefined;

// One as files have it.
export function plain({ type, name, points, ...values }) {
  const { outline, properties } = KINDS[type];
  if (!isNamed(type)) return points;
  const item = { name, [outline]: points };
  for (const key of Object.keys(properties)) {
    if (values[key] !== null) item[key] = values[key];
  }
  return item;
}

// And back.
export function fromPlain(type, item) {
  const { outline, properties } = KINDS[type];
  if (!isNamed(type)) return { type, name: "", points: item };
  const { name, [outline]: points, ...values } = item;
  return { type, name, points, ...properties, ...values };
}
