// The zone editor's page. The server does all geometry (outlines in the cameras, places under pixels); here is what
// binds its parts together: loading, saving, keys, and the line that says how things stand.

import { Cameras } from "/cameras.js";
import { Drawing, crosses, distance } from "/drawing.js";
import { List } from "/list.js";
import { Plan } from "/plan.js";
import { Latest, ask } from "/server.js";

const byId = (id) => document.getElementById(id);
const HINTS = {
  idle: "Drag a zone or its corners; a dot on an edge makes a corner, Delete removes one. N draws a zone, D doubles it.",
  empty: "Draw a zone where people enter or leave the room: button above, or N.",
  draft: "Click corners, on the plan or in a camera. A double click, the first corner or Enter closes; Esc gives up. Alt: no snapping.",
};
const DRAFT = { id: null, name: "", selected: true };

const drawing = new Drawing();
const list = new List(byId("zones"), byId("none"), drawing);
const fail = (error) => say(error.message, "wrong");
const plan = new Plan(byId("plan"), drawing, { finish, hover, say });
const cameras = new Cameras(byId("cameras"), drawing, { look, leave: () => hover(null), add, settle, finish });
let version = null;

// Lines of one kind follow each other; the last answer of a kind that was asked for is the one that stays.
const outlines = new Latest("/outlines", (reply, zones) => cameras.show(reply, zones), fail);
const places = new Latest("/place", ({ floor, cameras: pixels }, use) => {
  if (!isHovered) return;
  showPlace(floor);
  plan.mark(floor);
  cameras.mark(pixels);
  use?.(floor);
}, fail);
let isHovered = false;

function say(line, kind = "", offersLoading = false) {
  byId("message").textContent = line;
  byId("message").className = kind;
  byId("again").hidden = !offersLoading;
  byId("said").hidden = line === "";
  byId("hint").hidden = line !== "";
}

function showPlace(floor) {
  if (!floor) {
    byId("cursor").value = "";
    return;
  }
  const last = drawing.draft?.corners.at(-1);
  const length = last ? `, ${distance(last, floor).toFixed(2)} m long` : "";
  byId("cursor").value = `x ${floor[0].toFixed(2)} m, y ${floor[1].toFixed(2)} m${length}`;
}

// A place of the floor is pointed at, on the plan; null ends it.
function hover(floor) {
  isHovered = floor !== null;
  showPlace(floor);
  if (floor) {
    places.ask({ floor });
  } else {
    plan.mark(null);
    cameras.mark([]);
  }
}

// A pixel is pointed at, in a camera.
function look(camera, pixel, use) {
  isHovered = true;
  places.ask({ camera, pixel }, use);
}

// A corner's drag ends at a pixel of a camera.
async function settle(camera, pixel, { id, corner }) {
  try {
    const { floor } = await ask("POST", "/place", { camera, pixel });
    if (floor && drawing.zone(id)?.polygon[corner]) drawing.moveCorner(id, corner, floor);
  } catch (error) {
    fail(error);
  }
}

// A corner is clicked in a camera.
async function add(camera, pixel) {
  try {
    const { floor } = await ask("POST", "/place", { camera, pixel });
    if (!floor) return say("There is no floor under this pixel: it is at or above the horizon.", "warn");
    if (drawing.draft) drawing.addCorner(floor);
  } catch (error) {
    fail(error);
  }
}

function finish() {
  if (!drawing.draft) return;
  if (crosses(drawing.draft.corners)) return say("The outline crosses itself: remove the last corner with Delete.", "warn");
  const zone = drawing.finish();
  if (!zone) return say("A zone needs at least three corners.", "warn");
  say("Give the zone a name, then save.");
  list.focusName(zone.id);
}

function begin() {
  if (drawing.draft) return drawing.cancel();
  say("");
  drawing.begin();
  byId("plan").focus({ preventScroll: true });
}

async function load() {
  try {
    const room = await ask("GET", "/room.json");
    version = room.version;
    byId("room").textContent = room.name;
    document.title = `Zones of ${room.name}`;
    plan.load(room.plan, version);
    cameras.load(room.cameras, version);
    drawing.load(room.zones);
    say("");
  } catch (error) {
    fail(error);
  }
}

// One save at a time: the answer to one is the version that the next one starts from.
let saving = null;

async function save() {
  while (saving) await saving;
  if (!drawing.isUnsaved) return;
  saving = saveNow();
  await saving;
  saving = null;
}

async function saveNow() {
  if (drawing.draft) return say("Close the zone first, or give it up with Esc.", "warn");
  const zones = drawing.plain();
  try {
    const reply = await ask("PUT", "/zones", { zones, version });
    version = reply.version;
    drawing.markSaved(zones);
    if (reply.warnings.length > 0) return say(`Saved. ${reply.warnings.join("; ")}`, "warn");
    say("Saved.");
  } catch (error) {
    say(error.message, "wrong", error.status === 409);
  }
}

function remove() {
  const { selected, corner, draft } = drawing;
  if (draft) {
    draft.corners.pop();
    return drawing.changed();
  }
  if (selected === null) return;
  if (corner === null) return drawing.remove(selected);
  if (!drawing.removeCorner(selected, corner)) say("A zone needs at least three corners.", "warn");
}

drawing.addEventListener("change", () => {
  const { draft, zones, selected } = drawing;
  byId("unsaved").hidden = !drawing.isUnsaved;
  byId("save").disabled = !drawing.isUnsaved;
  byId("undo").disabled = !drawing.canUndo || draft !== null;
  byId("redo").disabled = !drawing.canRedo || draft !== null;
  byId("draw").setAttribute("aria-pressed", draft !== null);
  byId("draw").textContent = draft ? "Give up" : "Draw a zone";
  byId("hint").textContent = draft ? HINTS.draft : zones.length > 0 ? HINTS.idle : HINTS.empty;
  const shown = zones.map(({ id, name, color }) => ({ id, name, color, selected: id === selected }));
  const asked = zones.map(({ polygon }) => ({ polygon }));
  if (draft) {
    shown.push({ ...DRAFT, color: getComputedStyle(document.documentElement).getPropertyValue("--draft").trim() });
    asked.push({ polygon: draft.cursor ? draft.corners.concat([draft.cursor]) : draft.corners, closed: false });
  }
  outlines.ask({ zones: asked }, shown);
});

// What was said is about zones that are others now.
drawing.addEventListener("edit", () => say(""));

document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey) {
    const isTyping = event.target.matches("input");
    if (key === "s") {
      event.target.blur?.(); // what is being typed counts
      save();
    } else if (isTyping || drawing.draft || (key !== "z" && key !== "y")) {
      return;
    } else if (key === "y" || event.shiftKey) {
      drawing.redo();
    } else {
      drawing.undo();
    }
    return event.preventDefault();
  }
  if (event.altKey || event.target.matches("input, select, button")) return;
  if (key === "n") begin();
  else if (key === "enter" && drawing.draft) finish();
  else if (key === "escape" && drawing.draft) drawing.cancel();
  else if (key === "escape") drawing.select(null);
  else if (key === "d" && drawing.selected !== null && !drawing.draft) list.focusName(drawing.duplicate(drawing.selected).id);
  else if (key === "delete" || key === "backspace") remove();
  else return;
  event.preventDefault();
});

byId("draw").addEventListener("click", begin);
byId("undo").addEventListener("click", () => drawing.undo());
byId("redo").addEventListener("click", () => drawing.redo());
byId("save").addEventListener("click", save);
byId("again").addEventListener("click", load);
byId("zoom-in").addEventListener("click", () => plan.zoom(1.4));
byId("zoom-out").addEventListener("click", () => plan.zoom(1 / 1.4));
byId("zoom-all").addEventListener("click", () => plan.zoom(0));
window.addEventListener("beforeunload", (event) => {
  if (drawing.isUnsaved || drawing.draft?.corners.length) event.preventDefault();
});

load();
