// Moves the pages of a wedge through time together: each by its own slider, at the same second.
const [time, play, seconds] = ["time", "play", "seconds"].map((id) => document.getElementById(id));
const pages = [...document.querySelectorAll("iframe")];
const duration = Math.max(...pages.map((page) => Number(page.dataset.seconds)), 1e-9);
let running = false, last = 0;

function show(at) {
  time.value = at;
  seconds.textContent = `${(at * duration).toFixed(2)} s`;
  for (const page of pages) {
    const slider = page.contentDocument?.getElementById("time");
    const own = Number(page.dataset.seconds);
    if (!slider) continue;
    const frame = String(Math.round(Math.min(1, own > 0 ? (at * duration) / own : 0) * Number(slider.max)));
    if (slider.value === frame) continue;
    slider.value = frame;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  }
}

function tick(now) {
  if (!running) return;
  const at = Number(time.value) + (now - last) / 1000 / duration;
  last = now;
  show(at >= 1 ? 0 : at);
  requestAnimationFrame(tick);
}

function toggle() {
  running = !running;
  play.setAttribute("aria-pressed", String(running));
  play.textContent = running ? "Pause" : "Play";
  last = performance.now();
  if (running) requestAnimationFrame(tick);
}

// Whether a page has read its frames, or has said why it cannot.
function isReady(page) {
  const state = page.contentDocument?.documentElement?.dataset.state;
  return state === "ready" || state === "failed";
}

// The panels of the pages would leave no room for the pictures.
function begin() {
  if (!pages.every(isReady)) {
    setTimeout(begin, 100);
    return;
  }
  for (const page of pages) page.contentDocument.getElementById("side").click();
  show(0);
  document.documentElement.dataset.state = "ready";
}

begin();
time.addEventListener("input", () => {
  if (running) toggle();
  show(Number(time.value));
});
play.addEventListener("click", toggle);
document.addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target === play) return;
  event.preventDefault();
  toggle();
});
