// Asks what there is to see, shows it, and asks for what comes after. So the page is as fast as it can show, no faster.

const AGAIN_MS = 2000;

const at = (id) => document.getElementById(id);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

// The cameras as they are shown: name, image, number of the picture.
let cameras = [];

// While nobody can see the page nothing is asked for: the run then draws nothing for it.
async function beingSeen() {
  while (document.hidden) {
    await new Promise((done) => document.addEventListener("visibilitychange", done, { once: true }));
  }
}

function say(text, kind) {
  const said = at("said");
  if (said.textContent !== text) said.textContent = text;
  said.className = kind;
}

function hang(names) {
  cameras = names.map((name) => {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const image = new Image();
    caption.textContent = name;
    figure.append(caption, image);
    return { name, figure, image, picture: null };
  });
  at("cameras").replaceChildren(...cameras.map((camera) => camera.figure));
  arrange();
}

// The number of columns with which the pictures are largest.
function arrange() {
  const main = at("cameras");
  const shown = cameras.map((camera) => camera.image).find((image) => image.naturalWidth > 0);
  const ratio = shown ? shown.naturalWidth / shown.naturalHeight : 8 / 3;
  let best = { columns: 1, width: 0 };
  for (let columns = 1; columns <= cameras.length; columns += 1) {
    const rows = Math.ceil(cameras.length / columns);
    const width = Math.min(main.clientWidth / columns, (main.clientHeight / rows - 28) * ratio);
    if (width > best.width) best = { columns, width };
  }
  main.style.setProperty("--columns", best.columns);
}

// Puts a new picture in the old one's place when it is there as a whole.
async function replace(index, camera, picture) {
  const image = new Image();
  image.alt = `What ${camera.name} sees, and beside it the simulated view`;
  image.src = `/camera/${index}.jpg?${picture}`;
  await image.decode();
  const isFirst = camera.picture === null;
  camera.image.replaceWith(image);
  Object.assign(camera, { image, picture });
  if (isFirst) arrange();
}

async function show(now) {
  const names = now.cameras.map((camera) => camera.name);
  if (JSON.stringify(names) !== JSON.stringify(cameras.map((camera) => camera.name))) hang(names);
  at("title").textContent = now.title;
  const fresh = cameras.map((camera, index) => [index, camera, now.cameras[index].picture]);
  const wanted = fresh.filter(([, camera, picture]) => picture !== null && picture !== camera.picture);
  await Promise.all(wanted.map((one) => replace(...one)));
  if (now.moment) {
    at("frame").textContent = now.moment.frame;
    at("time").textContent = `${now.moment.time_s.toFixed(2)} s`;
    at("people").textContent = now.moment.people;
    document.title = `${now.moment.people} in ${now.title}`;
  }
  if (now.has_ended) {
    say("The run has ended", "ended");
  } else if (now.moment) {
    say("Live", "live");
  } else {
    say("Waiting for the first picture", "");
  }
}

async function watch() {
  let after = null;
  let hasEnded = false;
  for (;;) {
    await beingSeen();
    try {
      const response = await fetch(after === null ? "/moment" : `/moment?after=${after}`);
      if (!response.ok) throw new Error(`The run answered ${response.status}`);
      const now = await response.json();
      await show(now);
      after = now.number;
      hasEnded = now.has_ended;
    } catch {
      // Once it has ended, it is not asked any more but for another run at the same address.
      if (!hasEnded) say("No answer: the run has ended, or the connection is lost", "lost");
      for (const camera of cameras) camera.picture = null;
      after = null;
      await pause(AGAIN_MS);
      continue;
    }
    if (hasEnded) await pause(AGAIN_MS);
  }
}

new ResizeObserver(arrange).observe(at("cameras"));
watch();
