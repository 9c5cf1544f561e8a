// Asks what there is to see, shows it, and asks for what comes after. So the page is as fast as it can show, no faster.

import { Pictures } from "/pictures.js";
import { Plan, TRAIL_S, colorOf, inkOn } from "/plan.js";
import { Recent } from "/recent.js";
import { RunScene } from "/run_scene.js";
import { Space } from "/space.js";

const AGAIN_MS = 2000;
const FRAMES_MS = 50; // between two questions for frames

const at = (id) => document.getElementById(id);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

const recent = new Recent();
const plan = new Plan(at("plan"));
const pictures = new Pictures(at("cameras"));
const scene = new RunScene();
let space = null; // when it is opened for the first time
let room = null;
let status = { text: "Waiting for the first picture", kind: "" };

// While nobody can see the page nothing is asked for: the run then draws nothing for it.
async function beingSeen() {
  while (document.hidden) {
    await new Promise((done) => document.addEventListener("visibilitychange", done, { once: true }));
  }
}

function say(text, kind) {
  status = { text, kind };
  const shown = recent.isPaused && kind === "live" ? { text: "Paused; the run goes on", kind: "paused" } : status;
  const said = at("said");
  if (said.textContent !== shown.text) said.textContent = shown.text;
  said.className = shown.kind;
}

function figure(id, text) {
  at(id).textContent = text ?? "–";
  at(id).parentElement.hidden = text === null;
}

// Time of day where it is known, else since the beginning.
function timeText(time, clock) {
  if (clock) return clock.slice(11, 19);
  const minutes = Math.floor(time / 60);
  return minutes > 0 ? `${minutes}:${(time % 60).toFixed(1).padStart(4, "0")}` : `${time.toFixed(1)} s`;
}

function showTotals({ frame, time_s, people }) {
  at("frame").textContent = frame;
  at("time").textContent = `${time_s.toFixed(2)} s`;
  at("people").textContent = people;
  document.title = `${people} in ${at("title").textContent}`;
}

// The shown frame, everywhere.
function showFrame() {
  const { frame } = recent;
  if (!frame || !room) return;
  showTotals({ frame: frame.frame, time_s: frame.time, people: frame.people.length });
  if (frame.clock) at("time").textContent = frame.clock.slice(11, 21);
  figure("rate", frame.rate > 0 ? frame.rate.toFixed(1) : null);
  figure("latency", frame.latency === undefined ? null : `${Math.round(1000 * frame.latency)} ms`);
  figure("left-out", frame.left_out > 0 ? frame.left_out : null);
  const trails = recent.trails(TRAIL_S);
  if (!at("plan").hasAttribute("hidden")) plan.show(frame, trails);
  scene.take(frame, trails);
  space?.redraw();
  pictures.health(frame.health);
  pictures.paused = recent.isPaused;
  [...at("places").querySelector("tbody").rows].forEach((row, i) => {
    frame.counts[i].forEach((count, k) => { row.cells[k + 1].textContent = count; });
  });
  showPlayer();
  fadeLaterEvents();
}

function showPlayer() {
  const { frames, index, isPaused, frame } = recent;
  at("moment").max = frames.length - 1;
  at("moment").value = index;
  at("pause").textContent = isPaused ? "Go on" : "Pause";
  at("pause").setAttribute("aria-pressed", isPaused);
  at("back").disabled = index <= 0;
  at("forth").disabled = index >= frames.length - 1;
  const behind = frames.at(-1).time - frame.time;
  at("behind").value = isPaused ? `−${behind.toFixed(1)} s` : status.kind === "ended" ? "end" : "live";
  say(status.text, status.kind);
}

const WORDS = {
  appear: ({ where }) => `appears${where ? ` at ${where}` : ""}`,
  disappear: ({ where }) => `is gone${where ? ` at ${where}` : ""}`,
  enter: ({ where }) => `enters ${where}`,
  leave: ({ where, seconds }) => `leaves ${where}${seconds === undefined ? "" : ` after ${durationText(seconds)}`}`,
  dwell: ({ where, seconds }) => `is in ${where} for ${durationText(seconds ?? 0)}`,
  cross: ({ where, direction }) => `crosses ${where}, ${direction}`,
  camera: ({ where, state }) => `${where}: ${state === "back" ? "works again" : state}`,
};

function durationText(seconds) {
  return seconds < 60 ? `${seconds.toFixed(1)} s` : `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

function eventItem(event) {
  const item = document.createElement("li");
  item.className = [event.kind, event.isRevoked ? "revoked" : ""].join(" ");
  item.dataset.time = event.time;
  const time = item.appendChild(document.createElement("time"));
  time.textContent = timeText(event.time, event.clock);
  const id = item.appendChild(document.createElement("b"));
  if (event.id !== undefined) {
    id.textContent = event.id;
    id.style.background = colorOf(room, event.id);
    id.style.color = inkOn(colorOf(room, event.id));
  }
  item.appendChild(document.createElement("span")).textContent = WORDS[event.kind](event);
  return item;
}

function showEvents() {
  if (!room) return;
  at("events").querySelector("ol").replaceChildren(...recent.events.map(eventItem));
  at("no-events").hidden = recent.events.length > 0;
  fadeLaterEvents();
}

// What has not happened yet at the frame at which the page is paused.
function fadeLaterEvents() {
  const now = recent.isPaused ? recent.frame.time : Infinity;
  for (const item of at("events").querySelectorAll("li")) item.classList.toggle("later", Number(item.dataset.time) > now);
}

async function loadRoom() {
  const response = await fetch("/room.json");
  if (!response.ok) return;
  room = await response.json();
  const kinds = new Map([...room.zones.map((z) => [z.name, "zone"]), ...room.regions.map((r) => [r.name, "region"]), ...room.lines.map((l) => [l.name, "tripwire"])]);
  at("places").querySelector("tbody").replaceChildren(...room.places.map((name, i) => {
    const row = document.createElement("tr");
    const mark = document.createElement("span");
    mark.className = `mark ${i === 0 ? "" : kinds.get(name)}`;
    row.insertCell().append(mark, i === 0 ? "whole room" : name);
    for (let k = 0; k < 3; k += 1) row.insertCell().textContent = "0";
    return row;
  }));
  for (const id of ["room", "places", "events"]) at(id).hidden = false;
  plan.load(room);
  scene.load(room);
  await loadSpace();
}

// Frames and events, apart from the pictures, which take longer.
async function watchFrames() {
  let after = null;
  for (;;) {
    await beingSeen();
    try {
      if (after === null) await loadRoom();
      if (!room) return; // nothing is known of the room
      const response = await fetch(`/frames?after=${after ?? 0}`);
      if (!response.ok) throw new Error(`The run answered ${response.status}`);
      const { number, has_ended, frames, events } = await response.json();
      if (after === null || number < after) recent.clear();
      after = number;
      recent.add(frames, events);
      if (has_ended) await pause(AGAIN_MS);
    } catch {
      after = null;
      await pause(AGAIN_MS);
    }
    await pause(FRAMES_MS);
  }
}

async function showMoment(now) {
  pictures.hang(now.cameras.map((camera) => camera.name));
  at("title").textContent = now.title;
  await pictures.show(now.cameras.map((camera) => camera.picture));
  // Without a description of the room there are no frames.
  if (now.moment && !room) showTotals(now.moment);
  if (now.has_ended) {
    say("The run has ended", "ended");
  } else if (now.moment || recent.frames.length > 0) {
    say("Live", "live");
  } else {
    say("Waiting for the first picture", "");
  }
}

async function watchPictures() {
  let after = null;
  let hasEnded = false;
  for (;;) {
    await beingSeen();
    try {
      const response = await fetch(after === null ? "/moment" : `/moment?after=${after}`);
      if (!response.ok) throw new Error(`The run answered ${response.status}`);
      const now = await response.json();
      await showMoment(now);
      after = now.number;
      hasEnded = now.has_ended;
    } catch {
      // Once it has ended, it is not asked any more but for another run at the same address.
      if (!hasEnded) say("No answer: the run has ended, or the connection is lost", "lost");
      pictures.forget();
      after = null;
      await pause(AGAIN_MS);
      continue;
    }
    if (hasEnded) await pause(AGAIN_MS);
    // Pictures are not wanted meanwhile.
    while (recent.isPaused) await pause(FRAMES_MS);
  }
}

// Surfaces are fetched when the 3-D view is opened for the first time.
async function loadSpace() {
  if (!space || !room) return;
  await space.load({ bounds: room.plan, cameras: room.cameras, surfaces: room.has_surfaces ? "/surfaces" : null });
}

async function open(name) {
  const isSpace = name === "space";
  at("tab-plan").setAttribute("aria-selected", !isSpace);
  at("tab-space").setAttribute("aria-selected", isSpace);
  at("plan").toggleAttribute("hidden", isSpace);
  at("space").hidden = !isSpace;
  if (isSpace && !space) {
    space = new Space(at("space"), scene);
    await loadSpace();
  }
  showFrame();
}

const togglePause = () => (recent.isPaused ? recent.resume() : recent.pause());

recent.addEventListener("change", showFrame);
recent.addEventListener("events", showEvents);
at("tab-plan").addEventListener("click", () => open("plan"));
at("tab-space").addEventListener("click", () => open("space"));
at("pause").addEventListener("click", togglePause);
at("back").addEventListener("click", () => recent.show(recent.index - 1));
at("forth").addEventListener("click", () => recent.show(recent.index + 1));
at("moment").addEventListener("input", () => recent.show(Number(at("moment").value)));
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, button, canvas")) return;
  if (event.key === " ") togglePause();
  else if (event.key === "ArrowLeft") recent.show(recent.index - 1);
  else if (event.key === "ArrowRight") recent.show(recent.index + 1);
  else return;
  event.preventDefault();
});

watchFrames();
watchPictures();
