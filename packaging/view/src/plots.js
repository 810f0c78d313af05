// Curves beside the picture, with a line at the frame that is shown.

const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [320, 118, 44, 8, 8, 18];
const SVG = "http://www.w3.org/2000/svg";
let plots = 0;

function svg(parent, name, attributes, text) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  parent.append(node);
  return node;
}

/** Numbers for people, at most four digits. */
export function short(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
  return String(Number(value.toPrecision(4)));
}

/** A figure; returns the function that sets the time shown. choose(time): called by a click. */
export function addPlot(parent, plot, choose) {
  const figure = document.createElement("figure");
  const title = document.createElement("figcaption");
  title.textContent = plot.title;
  const unit = document.createElement("span");
  unit.textContent = plot.unit;
  title.append(unit);
  figure.append(title);
  const image = svg(figure, "svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": plot.title });
  const clip = `plot${plots++}`;
  svg(svg(image, "clipPath", { id: clip }), "rect", { x: LEFT, y: 0, width: WIDTH - LEFT - RIGHT, height: HEIGHT });
  const scale = scales(plot);
  drawGrid(image, plot, scale);
  plot.series.forEach((series, number) => {
    const points = series.x.map((x, i) => (series.y[i] === null ? null : `${scale.x(x).toFixed(1)},${scale.y(series.y[i]).toFixed(1)}`));
    const path = points.map((p, i) => (p ? `${i && points[i - 1] ? "L" : "M"}${p}` : "")).join("");
    svg(image, "path", { d: path, class: `line c${number % 6}`, "clip-path": `url(#${clip})` });
  });
  const now = svg(image, "line", { class: "now", y1: TOP, y2: HEIGHT - BOTTOM });
  parent.append(figure);
  const values = legend(figure, plot);
  image.addEventListener("click", (event) => {
    const box = image.getBoundingClientRect();
    choose(scale.time(((event.clientX - box.left) / box.width) * WIDTH));
  });
  return (time) => {
    now.setAttribute("x1", scale.x(time));
    now.setAttribute("x2", scale.x(time));
    plot.series.forEach((series, i) => (values[i].textContent = valueAt(series, time)));
  };
}

function scales(plot) {
  const xs = plot.series.flatMap((series) => series.x);
  const ys = plot.series.flatMap((series) => series.y).filter((y) => y !== null);
  const [x0, x1] = [plot.range[0], Math.max(plot.range[1], plot.range[0] + 1e-9, ...(xs.length ? [xs[xs.length - 1]] : []))];
  let low = ys.reduce((a, b) => Math.min(a, b), Infinity);
  let high = ys.reduce((a, b) => Math.max(a, b), -Infinity);
  if (!ys.length) [low, high] = [0, 1];
  if (plot.zero) low = Math.min(low, 0);
  const least = plot.least ?? 1e-12;
  if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
  const pad = 0.06 * (high - low);
  [low, high] = [plot.zero && low === 0 ? 0 : low - pad, high + pad];
  const width = WIDTH - LEFT - RIGHT, height = HEIGHT - TOP - BOTTOM;
  return {
    x: (time) => LEFT + ((time - x0) / (x1 - x0)) * width,
    y: (value) => TOP + (1 - (value - low) / (high - low)) * height,
    time: (x) => x0 + ((x - LEFT) / width) * (x1 - x0),
    low,
    high,
    x0,
    x1,
  };
}

function drawGrid(image, plot, scale) {
  for (const tick of ticks(scale.low, scale.high)) {
    const y = scale.y(tick);
    svg(image, "line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y });
    svg(image, "text", { x: LEFT - 5, y: y + 3, "text-anchor": "end" }, short(tick));
  }
  for (const [time, anchor] of [[scale.x0, "start"], [scale.x1, "end"]]) {
    svg(image, "text", { x: scale.x(time), y: HEIGHT - 4, "text-anchor": anchor }, `${short(time)} s`);
  }
}

function ticks(low, high) {
  const rough = (high - low) / 3;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((s) => s >= rough);
  const result = [];
  for (let k = Math.ceil(low / step); k * step <= high; ++k) result.push(Number((k * step).toPrecision(12)));
  return result;
}

function legend(figure, plot) {
  const list = document.createElement("ul");
  list.className = "legend";
  const values = plot.series.map((series, number) => {
    const entry = document.createElement("li");
    const mark = document.createElement("i");
    mark.className = `c${number % 6}`;
    const name = document.createElement("span");
    name.textContent = series.name;
    const value = document.createElement("b");
    entry.append(mark, name, value);
    list.append(entry);
    return value;
  });
  figure.append(list);
  return values;
}

function valueAt(series, time) {
  let at = -1;
  for (let i = 0; i < series.x.length && series.x[i] <= time + 1e-9; ++i) at = i;
  const value = at < 0 ? series.y[0] : series.y[at];
  return value === null || value === undefined ? "" : short(value);
}
