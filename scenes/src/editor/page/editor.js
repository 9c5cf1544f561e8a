// The editor's page. The server does all geometry of cameras (outlines in images, places under pixels); here is what
// binds the page's parts together: loading, saving, keys, and the line that says how things stand.

import { Cameras } from "/cameras.js";
import { DrawnScene } from "/drawn_scene.js";
import { Drawing } from "/drawing.js";
import { arrow, crosses, distance, snapped } from "/geometry.js";
import { KINDS, LAYERS, RULER, kindOf } from "/kinds.js";
import { List } from "/list.js";
import { Numbers } from "/numbers.js";
import { Plan } from "/plan.js";
import { Latest, ask } from "/server.js";
import { isCoarse } from "/shapes.js";
import { Space } from "/space.js";

const byId = (id) => document.getElementById(id);
const HINTS = isCoarse ? {
  idle: "Drag an item or its corners; a dot on an edge makes a corner.",
  empty: "Draw zones where people enter or leave the room, regions where they are counted, lines that they cross.",
  closed: "Tap corners, on the plan or in a camera. The first corner or Done closes.",
  open: "Tap points, on the plan or in a camera. Done ends the line. Across the arrow is in.",
  measure: "Tap two places, on the plan or in a camera.",
  space: "One finger turns the room, two zoom and move it, a double tap shows all of it.",
} : {
  idle: "Drag an item or its corners; a dot on an edge makes a corner, Delete removes one. N zone, R region, L line, F floor, M measure, D duplicates.",
  empty: "Draw zones where people enter or leave the room (N), regions where they are counted (R), lines that they cross (L).",
  closed: "Click corners, on the plan or in a camera. A double click, the first corner or Enter closes; Esc gives up. Alt: no snapping.",
  open: "Click points, on the plan or in a camera. A double click or Enter ends the line; Esc gives up. Across the arrow is in. Alt: no snapping.",
  measure: "Click two places, on the plan or in a camera. Esc ends measuring.",
  space: "Drag turns the room, the wheel zooms, the right button moves, a double click shows all of it. 3 leads back to the plan.",
};
const CAMERA_SNAP_M = 0.1;
const KEYS = Object.fromEntries(Object.entries({ ...KINDS, measure: RULER }).map(([type, { key }]) => [key, type]));

const drawing = new Drawing();
const list = new List(byId("items"), drawing);
new Numbers(byId("numbers"), drawing);
const fail = (error) => say(error.message, "wrong");
const plan = new Plan(byId("plan"), drawing, { finish, hover });
const cameras = new Cameras(byId("cameras"), drawing, { look, place, leave: () => hover(null), add, finish, later });
const drawButtons = [...document.querySelectorAll("[data-draw]")];
const scene = new DrawnScene(drawing);
let space = null; // when it is opened for the first time
let room = null;
let version = null;

// Lines of one kind follow each other; the last answer of a kind that was asked for is the one that stays.
const outlines = new Latest("/outlines", (reply, items) => cameras.show(reply, items), fail);
const places = new Latest("/place", ({ floor, cameras: pixels }, use) => {
  if (!isHovered) return;
  showPlace(floor);
  plan.mark(floor);
  markInSpace(floor);
  cameras.mark(pixels);
  use?.(floor);
}, fail);
let isHovered = false;

function say(line, kind = "", isConflict = false) {
  byId("message").textContent = line;
  byId("message").className = kind;
  byId("again").hidden = !isConflict;
  byId("overwrite").hidden = !isConflict;
  byId("said").hidden = line === "";
  byId("hint").hidden = line !== "";
}

function showPlace(floor) {
  if (!floor) {
    byId("cursor").value = "";
    return;
  }
  const { draft } = drawing;
  const isMeasured = draft?.type === "measure" && draft.corners.length === 2;
  const last = draft?.corners.at(-1);
  const length = isMeasured ? distance(...draft.corners) : last && distance(last, floor);
  const shown = length === undefined ? "" : `, ${length.toFixed(2)} m long`;
  byId("cursor").value = `x ${floor[0].toFixed(2)} m, y ${floor[1].toFixed(2)} m${shown}`;
}

// A place of the floor is pointed at, on the plan; null ends it.
function hover(floor) {
  isHovered = floor !== null;
  showPlace(floor);
  if (floor) {
    places.ask({ floor });
  } else {
    plan.mark(null);
    markInSpace(null);
    cameras.mark([]);
  }
}

function markInSpace(floor) {
  scene.place = floor;
  space?.redraw();
}

// A pixel is pointed at, in a camera.
function look(camera, pixel, use) {
  isHovered = true;
  places.ask({ camera, pixel }, use);
}

// The place of the floor that a pixel shows.
async function place(camera, pixel) {
  return (await ask("POST", "/place", { camera, pixel })).floor;
}

// Clicks and drags in cameras wait for the server's answers, one after the other; closing and saving wait for them.
let pending = Promise.resolve();

function later(task) {
  pending = pending.then(task).catch(fail);
  return pending;
}

// A corner is clicked in a camera.
function add(camera, pixel, isFree) {
  later(async () => {
    const floor = await place(camera, pixel);
    if (!floor) return say("There is no floor under this pixel: it is at or above the horizon.", "warn");
    if (drawing.draft) drawing.addCorner(isFree ? floor : snapped(floor, CAMERA_SNAP_M, drawing.targets()));
  });
}

async function finish() {
  await pending;
  const { draft } = drawing;
  if (!draft || draft.type === "measure") return;
  const { word, isClosed, least } = kindOf(draft.type);
  if (crosses(draft.corners, isClosed)) return say("The outline crosses itself: remove the last corner with Delete.", "warn");
  const isFirstFloor = draft.type === "floor" && drawing.ofType("floor").length === 0 && room.has_geometry;
  const item = drawing.finish();
  if (!item) return say(`A ${word} needs at least ${least} ${isClosed ? "corners" : "points"}.`, "warn");
  if (isFirstFloor) say("From now on people can stand on what is drawn alone, no longer on what follows from the geometry.");
  else say(item.name ? `Give the ${word} a name, then save.` : "");
  list.focusName(item.id);
}

function begin(type) {
  if (drawing.draft?.type === type) return drawing.cancel();
  say("");
  drawing.begin(type);
  byId("plan").focus({ preventScroll: true });
}

async function load() {
  try {
    room = await ask("GET", "/room.json");
    version = room.version;
    byId("room").textContent = room.name;
    document.title = `Floor of ${room.name}`;
    plan.load(room.plan, version);
    cameras.load(room.cameras, version);
    drawing.load(room.drawing, room.walls);
    say("");
    await loadSpace();
  } catch (error) {
    fail(error);
  }
}

// The room's surfaces are fetched when it is shown in 3-D for the first time.
async function loadSpace() {
  if (!space || !room) return;
  const { plan: { low, high }, cameras: views, has_geometry: hasGeometry } = room;
  await space.load({ bounds: [low, high], cameras: views, surfaces: hasGeometry ? `/surfaces?${room.version}` : null });
}

function showInSpace(isSpace) {
  byId("in-space").setAttribute("aria-pressed", isSpace);
  byId("space").hidden = !isSpace;
  byId("zoom").hidden = isSpace;
  byId("plan").toggleAttribute("hidden", isSpace);
  byId("hint").textContent = hint();
  space ??= new Space(byId("space"), scene);
  if (space.cameras) space.redraw();
  else loadSpace().catch(fail);
}

// One save at a time: what one has saved is what the next one starts from.
let saving = null;

async function save(onConflict = "refuse") {
  await pending;
  while (saving) await saving;
  if (!drawing.isUnsaved) return;
  saving = saveNow(onConflict);
  await saving;
  saving = null;
}

async function saveNow(onConflict) {
  const { draft } = drawing;
  if (draft && draft.type !== "measure") return say(`Close the ${kindOf(draft.type).word} first, or give it up with Esc.`, "warn");
  const snapshot = drawing.snapshot();
  try {
    const reply = await ask("PUT", "/drawing", { ...drawing.savingOf(snapshot), on_conflict: onConflict });
    version = reply.version;
    drawing.markSaved(snapshot);
    // What others changed is shown, unless there is something new by now: the next save brings it.
    const isShown = (reply.merged || reply.changed) && !drawing.isUnsaved;
    if (isShown) await load();
    const saved = isShown && reply.merged ? "Saved, together with what was changed in the file meanwhile." : "Saved.";
    if (reply.warnings.length > 0) return say(`${saved} ${reply.warnings.join("; ")}`, "warn");
    say(saved);
  } catch (error) {
    say(error.message, "wrong", error.status === 409);
  }
}

function remove() {
  const { selected, corner, draft } = drawing;
  if (draft) return drawing.undo();
  if (selected === null) return;
  if (corner === null) return drawing.remove(selected);
  const { word, least } = KINDS[drawing.item(selected).type];
  if (!drawing.removeCorner(selected, corner)) say(`A ${word} needs at least ${least} corners.`, "warn");
}

function hint() {
  const { draft, items } = drawing;
  if (!draft && !byId("space").hidden) return HINTS.space;
  if (!draft) return items.length > 0 ? HINTS.idle : HINTS.empty;
  if (draft.type === "measure") return HINTS.measure;
  return kindOf(draft.type).isClosed ? HINTS.closed : HINTS.open;
}

// What is shown in the cameras, and the questions for its outlines.
function outlined() {
  const { draft, selected } = drawing;
  const shown = [];
  const asked = [];
  const show = (item, polygon, closed) => {
    shown.push(item);
    asked.push({ polygon, closed });
  };
  const showArrow = (item, points) => {
    const found = arrow(points);
    if (!found) return;
    show({ ...item, isArrow: true }, [found.tail, found.head], false);
    show({ ...item, isArrow: true }, [found.barbs[0], found.head, found.barbs[1]], false);
  };
  for (const type of LAYERS) {
    for (const { id, name, color, points } of drawing.ofType(type)) {
      const item = { id, type, name, color, selected: id === selected };
      if (type === "line") showArrow(item, points);
      show(item, points, KINDS[type].isClosed);
    }
  }
  if (draft) {
    const { type, corners, cursor } = draft;
    const isMeasured = type === "measure" && corners.length === 2;
    const line = cursor && !isMeasured ? corners.concat([cursor]) : corners;
    const name = type === "measure" && line.length === 2 ? `${distance(...line).toFixed(2)} m` : "";
    const color = getComputedStyle(document.documentElement).getPropertyValue("--draft").trim();
    const item = { id: null, type, name, color, selected: true };
    if (type === "line") showArrow(item, line);
    show(item, line, false);
  }
  return [{ zones: asked }, shown];
}

drawing.addEventListener("change", () => {
  const { draft } = drawing;
  byId("unsaved").hidden = !drawing.isUnsaved;
  byId("save").disabled = !drawing.isUnsaved;
  byId("undo").disabled = !drawing.canUndo;
  byId("redo").disabled = !drawing.canRedo;
  byId("done").hidden = draft === null || draft.type === "measure";
  byId("done").disabled = draft === null || draft.corners.length < kindOf(draft.type).least;
  byId("none").hidden = drawing.ofType("zone").length > 0;
  for (const button of drawButtons) button.setAttribute("aria-pressed", draft?.type === button.dataset.draw);
  byId("hint").textContent = hint();
  outlines.ask(...outlined());
  space?.redraw();
});

// What was said is about things that are others now.
drawing.addEventListener("edit", () => say(""));

document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey) {
    const isTyping = event.target.matches("input");
    if (key === "s") {
      event.target.blur?.(); // what is being typed counts
      save();
    } else if (isTyping || (key !== "z" && key !== "y")) {
      return;
    } else if (key === "y" || event.shiftKey) {
      drawing.redo();
    } else {
      drawing.undo();
    }
    return event.preventDefault();
  }
  if (event.altKey || event.target.matches("input, select, button")) return;
  if (KEYS[key]) begin(KEYS[key]);
  else if (key === "3") showInSpace(byId("space").hidden);
  else if (key === "enter" && drawing.draft) finish();
  else if (key === "escape" && drawing.draft) drawing.cancel();
  else if (key === "escape") drawing.select(null);
  else if (key === "d" && drawing.selected !== null && !drawing.draft) list.focusName(drawing.duplicate(drawing.selected).id);
  else if (key === "delete" || key === "backspace") remove();
  else return;
  event.preventDefault();
});

for (const button of drawButtons) button.addEventListener("click", () => begin(button.dataset.draw));
byId("done").addEventListener("click", finish);
byId("undo").addEventListener("click", () => drawing.undo());
byId("redo").addEventListener("click", () => drawing.redo());
byId("save").addEventListener("click", () => save());
byId("overwrite").addEventListener("click", () => save("overwrite"));
byId("again").addEventListener("click", load);
byId("in-space").addEventListener("click", () => showInSpace(byId("space").hidden));
byId("zoom-in").addEventListener("click", () => plan.zoom(1.4));
byId("zoom-out").addEventListener("click", () => plan.zoom(1 / 1.4));
byId("zoom-all").addEventListener("click", () => plan.zoom(0));
window.addEventListener("beforeunload", (event) => {
  const isDrawn = drawing.draft?.type !== "measure" && drawing.draft?.corners.length;
  if (drawing.isUnsaved || isDrawn) event.preventDefault();
});

load();
