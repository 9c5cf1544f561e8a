// The page's parts together: points and scale, what the server says of them, saving, the build.

import { BuildPanel } from "/build.js";
import { MagnifiedPair } from "/magnified.js";
import { Picture } from "/picture.js";
import { Rows } from "/rows.js";
import { ScaleForm } from "/scale.js";
import { Latest, ask } from "/server.js";
import { isCoarse } from "/shapes.js";

const FITS_PX = 2; // a residual up to here is that of a careful pick
const OFF_PX = 6; // and from here on a wrong one
const SAME_PX = 6; // proposals nearer to a pick are the pick
const SNAP_PX = 8; // ends of a length to picks
const LOOK_EVERY_MS = 700;
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const HINTS = {
  wait: "The captures are being read.",
  first: `${isCoarse ? "Tap" : "Click"} something small that both pictures show: a corner, the tip of a lamp. ${isCoarse ? "" : "The wheel zooms."}`,
  second: "Now the same point in the other picture. Its line, if there is one, runs through it. Esc gives up.",
  idle: "Drag a pick, or move the selected one by the arrow keys (Shift: finely); Delete removes it. Three points a pair join two cameras; five prove it.",
  ends: "Click both ends of a known length in one picture; picked points count with all their pictures. Esc gives up.",
};

const byId = (id) => document.getElementById(id);
const images = new Map(); // by camera
const residuals = new Map(); // "point camera" → { px, left_out }
let project = null;
let cameras = [];
let points = []; // { id, number, picks: { camera: [x, y] } }
let saved = "";
let selected = null; // { id, camera }
let past = [];
let nextId = 1;
let line = null; // { camera, line, guess }
let progress = { pictures: {}, proposals: [], captures: { state: "idle" }, build: { state: "idle" } };
let saidPairs = [];

const fail = (error) => say(error.message, "wrong", error.status === 409);
const actions = { pick, grab: () => remember(), move, hover, choose: () => {} };
const panes = [...document.querySelectorAll(".pane")].map((figure, side) => new Picture(figure, { ...actions, choose: (name) => chooseCamera(side, name) }));
const room = new BuildPanel(fail);
const scale = new ScaleForm(remember, (isOther) => (isOther ? changed() : draw()));
const pointRows = new Rows(byId("points"), pointRow);
const proposalRows = new Rows(byId("proposals"), proposalRow);
const asked = new Latest("/residuals", (reply, { ids }) => {
  residuals.clear();
  for (const { misfits } of reply.pairs) {
    for (const { point, camera, px, left_out } of misfits) {
      const key = `${ids[point]} ${camera}`;
      if (!(residuals.get(key)?.px > px)) residuals.set(key, { px, isLeftOut: left_out });
    }
  }
  saidPairs = reply.pairs;
  draw();
}, fail);
const lines = new Latest("/epipolar", (reply, { camera }) => {
  if (!pending()) return;
  line = { camera, ...reply };
  mark();
}, fail);

function say(text, kind = "", isConflict = false) {
  byId("message").textContent = text;
  byId("message").className = kind;
  byId("message").hidden = text === "";
  byId("hint").hidden = text !== "";
  byId("again").hidden = !isConflict;
}

// The points and the scale as they are saved.
function picked() {
  const whole = points.filter(({ picks }) => Object.keys(picks).length > 1);
  return { points: whole.map(({ number, picks }) => ({ number, picks })), scale: scale.whole() };
}

const round = (pixel) => pixel.map((value) => Math.round(value * 10) / 10);
const pending = () => points.find(({ picks }) => Object.keys(picks).length === 1);
const pointOfId = (id) => points.find((point) => point.id === id);
const snapshot = () => JSON.stringify({ points, stated: scale.stated });

function remember() {
  past.push(snapshot());
}

function undo() {
  const before = past.pop();
  if (!before) return;
  const { points: earlier, stated } = JSON.parse(before);
  points = earlier;
  selected = null;
  scale.restore(stated);
  changed();
}

// What follows from other points or another scale.
function changed() {
  say("");
  byId("unsaved").hidden = !isUnsaved();
  byId("save").disabled = !isUnsaved();
  byId("undo").disabled = past.length === 0;
  const open = pending();
  line = null;
  if (progress.has_surfaces) {
    asked.ask({ points: points.map(({ picks }) => picks) }, { ids: points.map(({ id }) => id) });
    if (open) askLine(open);
  }
  draw();
}

const isUnsaved = () => project !== null && (scale.isOpen() || JSON.stringify(picked()) !== saved);

function askLine({ picks }) {
  const [[camera, pixel]] = Object.entries(picks);
  const other = panes.map((pane) => pane.camera).find((name) => name !== camera);
  if (other) lines.ask({ camera, pixel, other }, { camera: other });
}

// A pixel is clicked.
function pick(camera, pixel, id, isAdding) {
  if (scale.ends) return scale.setEnd(camera, snapped(camera, pixel));
  if (id !== null) {
    selected = { id, camera };
    return draw();
  }
  const open = pending();
  const chosen = isAdding && selected ? pointOfId(selected.id) : open;
  remember();
  const point = chosen ?? { id: nextId++, number: null, picks: {} };
  if (!chosen) points.push(point);
  point.picks[camera] = round(pixel);
  selected = { id: point.id, camera };
  changed();
}

// A pick nearby, or the pixel itself: a point that is picked in several pictures is known better.
function snapped(camera, pixel) {
  const isNear = (other) => other && Math.hypot(other[0] - pixel[0], other[1] - pixel[1]) < SNAP_PX;
  return points.map(({ picks }) => picks[camera]).find(isNear) ?? round(pixel);
}

function move(id, camera, pixel) {
  const point = pointOfId(id);
  if (!point) return;
  point.picks[camera] = round(pixel);
  selected = { id, camera };
  changed();
}

function remove(id) {
  remember();
  points = points.filter((point) => point.id !== id);
  if (selected?.id === id) selected = null;
  changed();
}

function hover(pane, pixel) {
  byId("cursor").value = pixel ? `${pane.camera}: ${pixel[0].toFixed(1)}, ${pixel[1].toFixed(1)}` : "";
}

function chooseCamera(side, name) {
  const shown = panes.map((pane) => pane.camera);
  if (shown[1 - side] === name) showCamera(1 - side, shown[side]);
  showCamera(side, name);
  line = null;
  const open = pending();
  if (open && progress.has_surfaces) askLine(open);
  draw();
}

function showCamera(side, name) {
  if (images.has(name)) panes[side].show(name, images.get(name), progress.pictures[name]);
}

// What is shown.

function stateOf(residual) {
  if (!residual) return "";
  return residual.isLeftOut || residual.px > OFF_PX ? "off" : residual.px <= FITS_PX ? "fits" : "";
}

function openProposals() {
  const isTaken = ({ cameras: [a, b], pixels: [p, q] }) => points.some(({ picks }) => [[a, p], [b, q]].some(([camera, pixel]) => picks[camera] && Math.hypot(picks[camera][0] - pixel[0], picks[camera][1] - pixel[1]) < SAME_PX));
  const shown = panes.map((pane) => pane.camera);
  return progress.proposals.filter((proposal) => proposal.cameras.every((camera) => shown.includes(camera)) && !isTaken(proposal));
}

function mark() {
  const proposals = openProposals();
  for (const pane of panes) {
    const { camera } = pane;
    const of = points.map((point, i) => ({ point, label: String(i + 1) })).filter(({ point }) => point.picks[camera]);
    pane.mark({
      picks: of.map(({ point, label }) => ({ id: point.id, label, pixel: point.picks[camera], state: stateOf(residuals.get(`${point.id} ${camera}`)), isSelected: selected?.id === point.id })),
      proposals: proposals.map((proposal) => proposal.pixels[proposal.cameras.indexOf(camera)]),
      line: line?.camera === camera ? line : null,
      lengths: scale.linesIn(camera),
    });
  }
}

function draw() {
  mark();
  pointRows.show(points.map((point) => ({ key: point.id, ...point })));
  const proposals = openProposals();
  proposalRows.show(proposals.map((proposal) => ({ key: JSON.stringify(proposal), ...proposal })));
  byId("take-all").hidden = proposals.length < 2;
  scale.say();
  const problems = saidPairs.map(({ cameras: [a, b], points: count, problem }) => problem ? `${a} and ${b}: ${problem}` : `${a} and ${b}: ${count} points${count < 3 ? ", at least 3 are needed" : count === 3 ? ", which prove nothing: pick two more" : ""}`);
  byId("pair").textContent = problems.join("; ") || "None yet.";
  byId("pair").className = saidPairs.some(({ problem }) => problem) ? "wrong" : "";
  const isReady = Object.keys(progress.pictures).length > 1;
  byId("hint").textContent = HINTS[scale.ends ? "ends" : !isReady ? "wait" : pending() ? "second" : points.length > 0 ? "idle" : "first"];
}

function button(text, title, action) {
  const element = document.createElement("button");
  Object.assign(element, { type: "button", textContent: text });
  setTitle(element, title);
  element.addEventListener("click", (event) => { event.stopPropagation(); action(); });
  return element;
}

function setTitle(element, title) {
  element.title = title;
  element.setAttribute("aria-label", title);
}

// A row: a label, magnified pictures, a text about them, buttons.
function row(...buttons) {
  const element = document.createElement("li");
  const label = document.createElement("span");
  const text = document.createElement("output");
  const pair = new MagnifiedPair(images);
  element.append(label, pair.element, text, ...buttons);
  return { element, label, pair, text };
}

function pointRow({ id }) {
  const removeButton = button("✕", "", () => remove(id));
  const { element, label, pair, text } = row(removeButton);
  element.dataset.point = id;
  element.addEventListener("click", () => {
    const { picks } = pointOfId(id);
    const [a, b] = Object.keys(picks);
    selected = { id, camera: a };
    if (b && !panes.every((pane) => pane.camera in picks)) [a, b].forEach((name, side) => showCamera(side, name));
    draw();
  });
  const show = ({ picks }, index) => {
    label.textContent = `${index + 1}`;
    setTitle(removeButton, `Remove point ${index + 1}`);
    element.classList.toggle("selected", selected?.id === id);
    pair.show(Object.entries(picks));
    const worst = Object.keys(picks).map((camera) => residuals.get(`${id} ${camera}`)).filter(Boolean).sort((a, b) => b.px - a.px)[0];
    text.className = `residual ${stateOf(worst)}`;
    text.value = worst ? `${worst.px.toFixed(1)} px${worst.isLeftOut ? ", left out" : ""}` : Object.keys(picks).length < 2 ? "in one picture" : "";
  };
  return { element, show };
}

function take(proposals) {
  remember();
  for (const { cameras: names, pixels } of proposals) {
    points.push({ id: nextId++, number: null, picks: Object.fromEntries(names.map((name, i) => [name, round(pixels[i])])) });
  }
  changed();
}

function proposalRow(proposal) {
  const { element, pair, text } = row(button("Take", "Take this proposal: it is the same physical point", () => take([proposal])));
  text.className = "residual";
  text.value = `alike ${proposal.correlation.toFixed(2)}`;
  return { element, show: () => pair.show(proposal.cameras.map((camera, i) => [camera, proposal.pixels[i]])) };
}

// The server.

function loaded({ version, picked: { points: tables, scale: stated } }) {
  project.version = version;
  points = tables.map(({ number, picks }) => ({ id: nextId++, number, picks }));
  scale.load(stated);
  past = [];
  selected = null;
  saved = JSON.stringify(picked());
  changed();
}

async function load() {
  try {
    project = await ask("GET", "/project.json");
    cameras = project.cameras;
    byId("project").textContent = project.name;
    document.title = `Picks of ${project.name}`;
    for (const pane of panes) pane.offer(cameras);
    scale.offer(cameras);
    loaded(project);
  } catch (error) {
    fail(error);
  }
}

async function save() {
  if (!isUnsaved()) return true;
  if (pending()) {
    say("A point is picked in one picture only: pick it in another, or give it up with Esc.", "warn");
    return false;
  }
  if (scale.isOpen()) {
    say("One of the scales is incomplete: complete it, or remove it.", "warn");
    return false;
  }
  try {
    loaded(await ask("PUT", "/project", { version: project.version, picked: picked() }));
    say("Saved.");
    return true;
  } catch (error) {
    fail(error);
    return false;
  }
}

async function build() {
  if (!(await save())) return;
  try {
    takeIn(await ask("POST", "/build", {}));
  } catch (error) {
    fail(error);
  }
}

function takeIn(state) {
  const [had, before] = [progress.has_surfaces, progress.proposals.length];
  progress = state;
  let isNew = had !== state.has_surfaces || before !== state.proposals.length;
  for (const [name, size] of Object.entries(state.pictures)) {
    if (images.has(name)) continue;
    isNew = true;
    images.set(name, Object.assign(new Image(...size), { src: `/reference/${encodeURIComponent(name)}` }));
    const side = cameras.indexOf(name);
    if (side === 0 || side === 1) showCamera(side, name);
  }
  const { captures } = state;
  byId("captures").textContent = captures.state === "running" ? `Working through the captures: ${captures.what} (${captures.number} of ${captures.of})`
    : captures.problem ?? (state.proposals.length > 0 ? "Look at each: it has to be the same physical point." : "Nothing that two pictures show could be borne out: pick by hand.");
  byId("captures").classList.toggle("wrong", captures.state === "failed");
  room.show(state);
  if (!had && state.has_surfaces) changed();
  else if (isNew) draw();
}

async function watch() {
  try {
    takeIn(await ask("GET", "/state.json"));
  } catch (error) {
    fail(error);
  }
  setTimeout(watch, LOOK_EVERY_MS);
}

// Keys and buttons.

document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && (key === "s" || key === "z")) {
    event.preventDefault();
    event.target.blur?.(); // what is being typed counts
    return key === "s" ? save() : undo();
  }
  if (event.target.matches("input, select")) return;
  if (event.key === "Escape") {
    if (scale.ends) scale.ends = null;
    else if (pending()) return remove(pending().id);
    else selected = null;
    return draw();
  }
  if (!selected) return;
  if (event.key === "Delete" || event.key === "Backspace") return remove(selected.id);
  const step = STEPS[event.key];
  const place = step && pointOfId(selected.id)?.picks[selected.camera];
  if (!place) return;
  event.preventDefault();
  const size = event.shiftKey ? 0.1 : 0.5;
  remember();
  move(selected.id, selected.camera, [place[0] + size * step[0], place[1] + size * step[1]]);
});
byId("undo").addEventListener("click", undo);
byId("save").addEventListener("click", save);
byId("build").addEventListener("click", build);
byId("again").addEventListener("click", load);
byId("take-all").addEventListener("click", () => take(openProposals()));
window.addEventListener("beforeunload", (event) => { if (isUnsaved()) event.preventDefault(); });

load().then(watch);
