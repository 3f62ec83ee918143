/* The map. */

const svg = get("chart");
const cells = get("cells");
const overlay = get("overlay");
const MARGIN = { left: 62, right: 12, top: 8, bottom: 44 };
const view = { zoom: 1, x: 0.5, y: 0.5 };
let frame = { x: 0, y: 0, width: 1, height: 1, scale: 1 };
let shown = [];

const rectangles = everywhere((niche) => {
  const [i, j] = index(niche);
  const rectangle = make("rect", {
    x: i, y: rows - 1 - j, width: 1, height: 1, tabindex: -1, role: "option", "aria-selected": "false",
    "aria-label": `niche ${label(niche)}, ${at(center(niche))}${visits[niche] ? "" : ", never filled"}`,
  });
  rectangle.dataset.niche = niche;
  return rectangle;
});
cells.append(...rectangles);
const hatch = make("path", {
  class: "hatch",
  d: everywhere((niche) => {
    const [i, j] = index(niche);
    return children[niche] && children[niche] < FEW ? `M${i} ${rows - j}l1 -1m-.5 0l-.5 .5m.5 .5l.5 -.5` : "";
  }).join(""),
});
cells.append(hatch);

/** Where a point of behavior is on the screen. */
function onScreen([x, y]) {
  return [
    frame.x + frame.width / 2 + (x - (left + view.x * (right - left))) * frame.scale,
    frame.y + frame.height / 2 - (y - (bottom + view.y * (top - bottom))) * frame.scale,
  ];
}

function layOut() {
  const { width, height } = svg.getBoundingClientRect();
  const inner = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom].map((side) => Math.max(40, side));
  const fit = Math.min(inner[0] / (right - left), inner[1] / (top - bottom));
  // The whole grid to scale; zoomed in, all the room there is.
  const used = [right - left, top - bottom].map((span, k) => Math.min(inner[k], span * fit * view.zoom));
  frame = { x: MARGIN.left + (inner[0] - used[0]) / 2, y: MARGIN.top + (inner[1] - used[1]) / 2, width: used[0], height: used[1], scale: fit * view.zoom };
  for (const [axis, side, span] of [["x", used[0], right - left], ["y", used[1], top - bottom]]) {
    const half = side / (2 * frame.scale * span);
    view[axis] = Math.min(Math.max(view[axis], half), 1 - half);
  }
  const [x, y] = onScreen([left, top]);
  cells.setAttribute("transform", `translate(${x} ${y}) scale(${cell[0] * frame.scale} ${cell[1] * frame.scale})`);
  // Marks on the border are not cut in half.
  for (const [id, pad] of [["clip", 0], ["overlay-clip", 9]]) {
    const box = { x: frame.x - pad, y: frame.y - pad, width: frame.width + 2 * pad, height: frame.height + 2 * pad };
    for (const [key, value] of Object.entries(box)) get(id).setAttribute(key, value);
  }
  drawAxes();
  drawOverlay();
}

function ticks(low, high, wanted) {
  const rough = (high - low) / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push([k * step, minus((k * step).toFixed(digits))]);
  return found;
}

function drawAxes() {
  const axes = get("axes");
  const { x, y, width, height, scale } = frame;
  const middle = [left + view.x * (right - left), bottom + view.y * (top - bottom)];
  axes.replaceChildren(make("rect", { x, y, width, height }));
  for (const [value, text] of ticks(middle[0] - width / 2 / scale, middle[0] + width / 2 / scale, width / 60)) {
    const [px] = onScreen([value, bottom]);
    axes.append(make("line", { x1: px, x2: px, y1: y + height, y2: y + height + 4 }));
    axes.append(make("text", { x: px, y: y + height + 18, "text-anchor": "middle" }, text));
  }
  for (const [value, text] of ticks(middle[1] - height / 2 / scale, middle[1] + height / 2 / scale, height / 70)) {
    const [, py] = onScreen([left, value]);
    axes.append(make("line", { x1: x - 4, x2: x, y1: py, y2: py }));
    axes.append(make("text", { x: x - 8, y: py + 4, "text-anchor": "end" }, text));
  }
  axes.append(make("text", { x: x + width / 2, y: y + height + 38, "text-anchor": "middle" }, `${data.axes[0]} (${data.unit})`));
  const turn = [x - 46, y + height / 2];
  axes.append(make("text", { x: turn[0], y: turn[1], "text-anchor": "middle", transform: `rotate(-90 ${turn})` }, `${data.axes[1]} (${data.unit})`));
}

/** Transitions out of a state: its children's states with probability and births, the surest first. */
function transitions(from) {
  const seen = new Map();
  for (let k = counts.start[from]; k < counts.start[from + 1]; k++) seen.set(counts.column[k], counts.count[k]);
  return Array.from(row(from), (probability, to) => ({
    to, probability, births: seen.get(to) || 0,
    distance: to < n && from < n ? distance(from, to) : NaN,
    wormhole: wormholes.get(from * S + to),
  })).sort((a, b) => b.probability - a.probability);
}
const isFar = (edge) => edge.distance >= far;

function drawOverlay() {
  overlay.replaceChildren();
  const styles = getComputedStyle(document.documentElement);
  const arrows = strongest().concat(longJumps()).filter((edge) => edge.to < n);
  for (const edge of arrows.reverse()) {
    const [a, b] = [onScreen(center(state.niche)), onScreen(center(edge.to))];
    const colour = styles.getPropertyValue(isFar(edge) ? "--jump" : "--edge");
    const width = 1.2 + 5 * Math.sqrt(edge.probability);
    // Curved, so that an arrow and its opposite do not lie on each other.
    const bend = [(a[0] + b[0]) / 2 - 0.14 * (b[1] - a[1]), (a[1] + b[1]) / 2 + 0.14 * (b[0] - a[0])];
    const angle = Math.atan2(b[1] - bend[1], b[0] - bend[0]);
    const size = 5 + 1.6 * width;
    const foot = [b[0] - size * 0.8 * Math.cos(angle), b[1] - size * 0.8 * Math.sin(angle)];
    const wing = (turn) => `${b[0] - size * Math.cos(angle + turn)},${b[1] - size * Math.sin(angle + turn)}`;
    const path = `M${a}Q${bend} ${foot}`;
    const dash = edge.births ? "none" : "2 5";
    overlay.append(make("path", { class: "arrow", d: path, stroke: styles.getPropertyValue("--halo"), "stroke-width": width + 2.5, opacity: 0.75 }));
    overlay.append(make("path", { class: "arrow", d: path, stroke: colour, "stroke-width": width, "stroke-dasharray": dash }));
    overlay.append(make("polygon", { points: `${b} ${wing(0.45)} ${wing(-0.45)}`, fill: colour, stroke: styles.getPropertyValue("--halo"), "stroke-width": 0.8 }));
  }
  if (data.start) {
    const [x, y] = onScreen(data.start);
    overlay.append(make("path", { class: "start", d: `M${x - 2.5} ${y - 7.5}h5v5h5v5h-5v5h-5v-5h-5v-5h5z` }));
  }
  const [i, j] = index(state.niche);
  const [x, y] = onScreen([left + i * cell[0], bottom + (j + 1) * cell[1]]);
  const box = { x, y, width: cell[0] * frame.scale, height: cell[1] * frame.scale, rx: 2 };
  overlay.append(make("rect", { ...box, class: "chosen-halo" }), make("rect", { ...box, class: "chosen" }));
}

function paint() {
  const map = MAPS[state.colour];
  const values = map.values();
  shown = values;
  const known = values.filter(Number.isFinite);
  let [low, high] = map.bounds || [Math.min(...known), Math.max(...known)];
  if (map.scale === "log") low = 1;
  if (!known.length || low === high) [low, high] = known.length ? [low, low + 1] : [0, 1];
  const to = { root: Math.sqrt, log: Math.log }[map.scale] || ((v) => v);
  const from = { root: (v) => v * v, log: Math.exp }[map.scale] || ((v) => v);
  const place = (value) => (to(value) - to(low)) / (to(high) - to(low));
  const colours = map.colours ? map.colours() : VIRIDIS;
  rectangles.forEach((rectangle, niche) => {
    rectangle.style.fill = Number.isFinite(values[niche]) ? ramp(colours, place(values[niche])) : "var(--empty)";
  });
  hatch.style.display = map.hatched ? "" : "none";
  drawLegend(map, [low, from((to(low) + to(high)) / 2), high], colours);
}

function drawLegend(map, marks, colours) {
  const bar = make("div", { class: "bar" });
  bar.append(make("b", {}, map.legend()), make("i", { style: `background: linear-gradient(90deg, ${colours.join(", ")})` }));
  // As many digits as tell the marks apart.
  const digits = [2, 3, 4, 5].find((count) => new Set(marks.map((mark) => number(mark, count))).size === 3) || 6;
  bar.append(...marks.map((mark) => make("span", {}, number(mark, digits))));
  const keys = [
    ["var(--edge)", "transition"],
    ["var(--jump)", `long jump, ${number(far, 2)} ${data.unit} or more`],
    ["var(--start)", "start", "M5 0h5v5h5v5h-5v5H5v-5H0V5h5z"],
  ];
  if (!map.colours) keys.push(["var(--empty)", map.hatched ? "never a parent" : "never filled", "M0 0h15v15H0z"]);
  if (map.hatched) keys.push(["none", `under ${FEW} births`, "M0 15L15 0M0 8L8 0M7 15L15 7"]);
  const line = "M0 6h9V3l6 4.5L9 12V9H0z";
  get("legend").replaceChildren(bar, ...keys.filter(([, text]) => text !== "start" || data.start).map(([colour, text, d]) => {
    const key = make("span", { class: "key" });
    const picture = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    picture.setAttribute("width", 15);
    picture.setAttribute("height", 15);
    picture.setAttribute("aria-hidden", "true");
    picture.append(make("path", { d: d || line, fill: colour, stroke: colour === "none" ? "var(--soft)" : "none" }));
    key.append(picture, make("span", {}, text));
    return key;
  }));
}
