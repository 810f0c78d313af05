// What stands beside the picture: notes, objects, plots, warnings, parameters. Names from the scene are text only.
import { addPlot, short } from "./plots.js";

export function element(name, className, text) {
  const node = document.createElement(name);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
}

function section(parent, title, open, count) {
  const details = element("details");
  details.open = open;
  const summary = element("summary", "", title);
  if (count !== undefined) summary.append(element("span", "count", String(count)));
  details.append(summary);
  parent.append(details);
  return details;
}

/** Fills the panel; returns the function that sets the time shown. seek(frame index) */
export function fillPanel(parent, facts, seek) {
  if (facts.notes.length) {
    const notes = element("ul", "notes");
    for (const note of facts.notes) notes.append(element("li", "", note));
    parent.append(notes);
  }
  const nearest = (time) => {
    let best = 0;
    facts.times.forEach((t, i) => (best = Math.abs(t - time) < Math.abs(facts.times[best] - time) ? i : best));
    seek(best);
  };
  const plots = section(parent, "Plots", true);
  const movers = facts.plots.map((plot) => addPlot(plots, plot, nearest));
  const warnings = section(parent, "Warnings", facts.warnings.length > 0, facts.warnings.length);
  if (!facts.warnings.length) warnings.append(element("p", "calm", "None: no condition that the run looks at was met."));
  for (const warning of facts.warnings) {
    const row = element("p", "warning");
    const button = element("button", "", `frame ${warning.frame}`);
    button.title = "Show this frame";
    button.addEventListener("click", () => seek(facts.frames.findIndex((f) => f >= warning.frame)));
    row.append(button, element("span", "", warning.text));
    warnings.append(row);
  }
  addObjects(parent, facts);
  const parameters = section(parent, "Parameters", false, facts.parameters.length);
  for (const prim of facts.parameters) {
    const details = section(parameters, prim.path, false);
    details.firstChild.append(element("span", "kind", prim.kind));
    const table = element("table");
    for (const [name, value] of prim.rows) {
      const row = element("tr");
      row.append(element("th", "", name), element("td", "", value));
      table.append(row);
    }
    details.append(table);
  }
  parent.append(element("p", "made", facts.made));
  return (time) => movers.forEach((move) => move(time));
}

function addObjects(parent, facts) {
  const objects = section(parent, "Objects", false, facts.items.length);
  facts.toggles = facts.items.map((item) => {
    const label = element("label", "object");
    const box = element("input");
    box.type = "checkbox";
    box.checked = true;
    const swatch = element("canvas", "swatch");
    swatch.width = swatch.height = 1;
    const pen = swatch.getContext("2d");
    pen.fillStyle = `rgb(${item.color.map((c) => Math.round(255 * Math.min(1, c) ** (1 / 2.2))).join(",")})`;
    pen.fillRect(0, 0, 1, 1);
    const size = item.triangle_count ? `${item.triangle_count.toLocaleString("en")} triangles` : `${item.point_count} points`;
    label.append(box, swatch, element("span", "path", item.path), element("span", "kind", `${item.kind}, ${size}`));
    objects.append(label);
    return box;
  });
}

export { short };
