/* The map. */

const svg = get("chart");
const cells = get("cells");
const overlay = get("overlay");
const MARGIN = { left: 62, right: 12, top: 8, bottom: 44 };
const view = { zoom: 1, x: 0.5, y: 0.5 };
let frame = { x: 0, y: 0, width: 1, height: 1, scale: 1 };
let shown = [];
let scaleOf = null;

// Cells are drawn in a box of 1 by 1, which is put where it belongs.
const inBox = ([x, y]) => [(x - left) / (right - left), (top - y) / (top - bottom)];
const around = (niche) => `M${outline(niche).map((corner) => inBox(corner).map((v) => v.toFixed(6))).join("L")}Z`;
const rectangles = everywhere((niche) => {
  const rectangle = make("path", {
    d: around(niche), tabindex: -1, role: "option", "aria-selected": "false",
    "aria-label": `niche ${label(niche)}, ${at(center(niche))}${visits[niche] ? "" : ", never filled"}`,
  });
  rectangle.dataset.niche = niche;
  return rectangle;
});
cells.append(...rectangles);
const hatch = make("path", { class: "hatch", fill: "url(#stripes)" });
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
  const box = [(right - left) * frame.scale, (top - bottom) * frame.scale];
  cells.setAttribute("transform", `translate(${x} ${y}) scale(${box[0]} ${box[1]})`);
  get("stripes").setAttribute("patternTransform", `scale(${1 / box[0]} ${1 / box[1]}) rotate(45)`);
  // Marks on the border are not cut in half.
  for (const [id, pad] of [["clip", 0], ["overlay-clip", 9]]) {
    const sides = { x: frame.x - pad, y: frame.y - pad, width: frame.width + 2 * pad, height: frame.height + 2 * pad };
    for (const [key, value] of Object.entries(sides)) get(id).setAttribute(key, value);
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
  // Beside another archive, both have one scale.
  if (range && range.key === rangeKey()) [low, high] = [Math.min(low, range.low), Math.max(high, range.high)];
  tellRange(low, high);
  const place = (value) => (to(value) - to(low)) / (to(high) - to(low));
  const colours = map.colours ? map.colours() : VIRIDIS;
  rectangles.forEach((rectangle, niche) => {
    rectangle.style.fill = Number.isFinite(values[niche]) ? ramp(colours, place(values[niche])) : "var(--empty)";
  });
  hatch.setAttribute("d", map.hatched ? everywhere((j) => (soFar("children", j) && children[j] < FEW ? around(j) : "")).join("") : "");
  scaleOf = { map, marks: [low, from((to(low) + to(high)) / 2), high], colours };
  drawLegend(map, scaleOf.marks, colours);
}

function drawLegend(map, marks, colours) {
  const bar = make("div", { class: "bar" });
  bar.append(make("b", {}, map.legend()), make("i", { style: `background: linear-gradient(90deg, ${colours.join(", ")})` }));
  // As many digits as tell the marks apart.
  const digits = [2, 3, 4, 5].find((count) => new Set(marks.map((mark) => number(mark, count))).size === 3) || 6;
  bar.append(...marks.map((mark) => make("span", {}, number(mark, digits))));
  const keys = [
    ...({
      out: [["var(--edge)", "children land"], ["var(--jump)", `the same, ${number(far, 2)} ${data.unit} or farther`]],
      in: [["var(--edge)", "children come from"], ["var(--jump)", `the same, ${number(far, 2)} ${data.unit} or farther`]],
      lineage: [["var(--lineage)", "the elite's ancestors"]],
    }[state.arrows] || []),
    ["var(--start)", "start", "M5 0h5v5h5v5h-5v5H5v-5H0V5h5z"],
  ];
  if (state.stage < last) keys.push(["var(--empty)", map.colours ? "" : `not yet among the first ${data.stages[state.stage]} births`, "M0 0h15v15H0z"]);
  else if (!map.colours) keys.push(["var(--empty)", map.hatched ? "never a parent" : "never filled", "M0 0h15v15H0z"]);
  if (map.hatched) keys.push(["none", `under ${FEW} births`, "M0 15L15 0M0 8L8 0M7 15L15 7"]);
  const line = "M0 6h9V3l6 4.5L9 12V9H0z";
  get("legend").replaceChildren(bar, ...keys.filter(([, text]) => text && (text !== "start" || data.start)).map(([colour, text, d]) => {
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
