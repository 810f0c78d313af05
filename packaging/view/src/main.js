// The page of `eulerfsi view`: reads what it holds, then plays it.
import { facts } from "./data.js";
import { fillPanel } from "./panel.js";
import { Studio } from "./studio.js";

const root = document.documentElement;
const get = (id) => document.getElementById(id);
const [canvas, slider, playButton, label, strength] = ["canvas", "time", "play", "frame", "strength"].map(get);
let studio = null;
let moveTime = () => {};
let playing = false;
let shown = 0;
let due = 0;

function fail(text) {
  get("message").textContent = text;
  get("message").hidden = false;
  root.dataset.state = "failed";
}

async function seek(index) {
  const frame = Math.min(Math.max(index < 0 ? facts.frames.length - 1 : index, 0), facts.frames.length - 1);
  shown = frame;
  slider.value = frame;
  label.textContent = `${facts.frames[frame]}`;
  get("seconds").textContent = `${facts.times[frame].toFixed(2)} s`;
  slider.setAttribute("aria-valuetext", `frame ${facts.frames[frame]}`);
  moveTime(facts.times[frame]);
  if (studio) await studio.show(frame);
}

function setPlaying(on) {
  playing = on && facts.frames.length > 1;
  playButton.setAttribute("aria-pressed", playing);
  playButton.setAttribute("aria-label", playing ? "Pause" : "Play");
  due = performance.now();
}

async function loop(now) {
  if (playing && now >= due) {
    const each = Math.max(1000 / (facts.fps * Number(get("speed").value)) * facts.every, 1);
    due = Math.max(due + each, now - each);
    await seek((shown + 1) % facts.frames.length);
  }
  studio?.draw(now);
  requestAnimationFrame(loop);
}

const KEYS = {
  " ": () => setPlaying(!playing),
  ArrowRight: () => (setPlaying(false), seek(Math.min(shown + 1, facts.frames.length - 1))),
  ArrowLeft: () => (setPlaying(false), seek(Math.max(shown - 1, 0))),
  Home: () => seek(0),
  End: () => seek(facts.frames.length - 1),
  a: () => studio?.orbit(-0.1, 0),
  d: () => studio?.orbit(0.1, 0),
  w: () => studio?.orbit(0, -0.08),
  s: () => studio?.orbit(0, 0.08),
  "+": () => studio?.zoom(0.9),
  "-": () => studio?.zoom(1.1),
  r: () => studio?.resetCamera(),
  b: () => toggleBox(),
  f: () => fullscreen(),
  p: () => togglePanel(),
};

function toggleBox() {
  if (!studio) return;
  studio.box.visible = !studio.box.visible;
  studio.dirty = true;
}

function togglePanel() {
  document.body.classList.toggle("wide");
}

function fullscreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else root.requestFullscreen?.().catch(() => {});
}

function listen() {
  slider.max = facts.frames.length - 1;
  slider.addEventListener("input", () => (setPlaying(false), seek(Number(slider.value))));
  playButton.addEventListener("click", () => setPlaying(!playing));
  get("reset").addEventListener("click", () => studio?.resetCamera());
  get("full").addEventListener("click", fullscreen);
  get("side").addEventListener("click", togglePanel);
  window.addEventListener("keydown", (event) => {
    const typing = event.target.matches?.("select, summary, button, input[type=checkbox]") && event.key === " ";
    const sliding = event.target === strength && event.key.startsWith("Arrow");
    if (event.ctrlKey || event.metaKey || event.altKey || typing || sliding || !(event.key in KEYS)) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  strength.addEventListener("input", () => {
    studio.smoke.strength = 2 ** Number(strength.value);
    studio.smoke.again();
    studio.dirty = true;
  });
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    fail("The graphics card has dropped this page. Reload it.");
  });
}

/** Frames whose smoke is not read yet, one after the other while nothing else happens. */
async function readAhead() {
  if (!studio.smoke) return;
  for (let frame = 0; frame < facts.frames.length; ++frame) await studio.smoke.load(frame);
  root.dataset.read = facts.frames.length;
}

async function start() {
  moveTime = fillPanel(get("panel"), facts, (index) => (setPlaying(false), seek(index)));
  listen();
  root.dataset.frames = facts.frames.length;
  root.dataset.triangles = facts.items.reduce((sum, item) => sum + item.triangle_count, 0);
  const wanted = facts.frames.indexOf(Number(new URLSearchParams(location.hash.slice(1)).get("frame")));
  try {
    studio = new Studio(canvas, facts);
  } catch {
    await seek(Math.max(wanted, 0));
    fail("The picture needs WebGL 2, which this browser does not offer. Curves, warnings and parameters are beside it.");
    return;
  }
  get("smoke-strength").hidden = !studio.smoke;
  await studio.load();
  facts.toggles.forEach((box, i) =>
    box.addEventListener("change", () => {
      studio.items[i].on = box.checked;
      seek(shown);
    }),
  );
  await seek(Math.max(wanted, 0));
  studio.draw();
  root.dataset.state = "ready";
  root.dataset.milliseconds = Math.round(performance.now());
  get("wait").hidden = true;
  requestAnimationFrame(loop);
  await readAhead();
}

start().catch((error) => {
  fail(`This page is damaged: ${error.message}`);
  throw error;
});
