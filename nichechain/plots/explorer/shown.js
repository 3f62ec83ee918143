/* What is shown. */

const stops = [...new Set([1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 700, 1000, ...data.sizes])];
stops.sort((a, b) => a - b);
const state = { niche: 0, l: data.l, U: data.lineages, colour: "reach", h: [] };
const given = data.draws === 0;

const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const REACH = {
  light: ["#f3f3f1", "#cfdcea", "#94b4d3", "#5786b3", "#35618f", "#1d3f66", "#0d2240"],
  dark: ["#1f2429", "#223c57", "#2b5a86", "#4280b8", "#74aee0", "#b4d8f8", "#f0f8ff"],
};
const theme = () => document.documentElement.dataset.theme;
const reachColours = () => REACH[theme()];
const everywhere = (value) => Array.from({ length: n }, (_, j) => value(j));
const orNone = (known, value) => (known ? value : NaN);

// A map: what its colours mean, and the value of every niche; NaN has no colour.
const MAPS = {
  reach: {
    title: "reach of all lineages",
    legend: () => `probability that one of ${state.U} lineages visits`,
    values: () => everywhere((j) => atLeastOne(state.h[state.l - 1][j], state.U)),
    scale: "root", colours: reachColours, bounds: [0, 1],
  },
  one: {
    title: "reach of one lineage",
    legend: () => "probability that one lineage visits",
    values: () => everywhere((j) => state.h[state.l - 1][j]),
    scale: "root", colours: reachColours, bounds: [0, 1],
  },
  evolvability: {
    title: "l-evolvability",
    legend: () => `niches reached, l = ${state.l}, U = ${precomputed()}`,
    values: () => everywhere((j) => orNone(children[j], score(0, j, state.l, precomputed()))),
    hatched: true,
  },
  width: {
    title: "its interval's width",
    legend: () => `width in niches, l = ${state.l}, U = ${precomputed()}`,
    values: () => everywhere((j) => orNone(children[j], score(2, j, state.l, precomputed()) - score(1, j, state.l, precomputed()))),
    hatched: true,
  },
  visits: {
    title: "births in the niche",
    legend: () => "births",
    values: () => everywhere((j) => orNone(visits[j], visits[j])),
    scale: "log",
  },
  children: {
    title: "births behind the row",
    legend: () => "births of parents in the niche",
    values: () => everywhere((j) => orNone(children[j], children[j])),
    scale: "log",
  },
  objective: {
    title: "elite: objective",
    legend: () => data.objectiveName,
    values: () => everywhere((j) => elite(0, j)),
  },
  depth: {
    title: "elite: depth",
    legend: () => "generations since an initial birth",
    values: () => everywhere((j) => elite(1, j)),
  },
};
if (given) delete MAPS.width;

/** The number of lineages nearest to U that means over draws were computed for. */
function precomputed() {
  const gap = (size) => Math.abs(Math.log(size / state.U));
  return data.sizes.reduce((best, size) => (gap(size) < gap(best) ? size : best));
}

/* Words, numbers and elements. */

const get = (id) => document.getElementById(id);
function number(value, digits = 3) {
  if (!Number.isFinite(value)) return "none";
  if (Number.isInteger(value)) return minus(String(value));
  const size = Math.abs(value);
  const text = size >= 1e-3 || size === 0 ? value.toFixed(Math.max(0, digits - 1 - Math.floor(Math.log10(size)))) : value.toExponential(digits - 1);
  return minus(text);
}
const niches = (value) => value.toFixed(value < 100 ? 1 : 0);
const percent = (p) => (p > 0 && p < 1e-3 ? "<0.1 %" : `${(100 * p).toFixed(1)} %`);
// To a tenth of a niche or finer.
const decimals = Math.max(0, 1 - Math.floor(Math.log10(Math.min(...cell))));
const minus = (text) => text.replace(/-/g, "−");
const at = (point) => `${data.axes.map((name, k) => `${name} ${minus(point[k].toFixed(decimals))}`).join(", ")} ${data.unit}`;

function make(name, attributes = {}, text) {
  const svg = "http://www.w3.org/2000/svg";
  const inSvg = ["rect", "path", "text", "line", "g", "polygon", "polyline"].includes(name);
  const element = inSvg ? document.createElementNS(svg, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

function ramp(colours, t) {
  const place = Math.min(Math.max(t, 0), 1) * (colours.length - 1);
  const k = Math.min(Math.floor(place), colours.length - 2);
  const mixed = [1, 3, 5].map((from) => {
    const [a, b] = [colours[k], colours[k + 1]].map((colour) => parseInt(colour.slice(from, from + 2), 16));
    return Math.round(a + (b - a) * (place - k));
  });
  return `rgb(${mixed.join(" ")})`;
}
