/* What is shown. */

// Numbers were computed for these stops, so that each has its interval.
const stops = data.sizes;
const last = data.stages.length - 1;
const state = { niche: 0, l: data.l, U: data.lineages, colour: "evolvability", arrows: "out", stage: last, h: [], edges: [], incoming: [] };
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

/** Births so far, at the stage that is shown, in a niche (visits) or of parents in it (children). */
const soFar = (kind, niche) => past[kind][state.stage * n + niche];
const counted = (count) => orNone(count, count);

// A map: what its colours mean, and the value of every niche; NaN has no colour.
const MAPS = {
  evolvability: {
    title: "niches reached",
    legend: () => `niches reached by ${lineages()} in ${generations()}`,
    values: () => everywhere((j) => orNone(soFar("children", j), score(0, j, state.l, state.U))),
    hatched: true,
  },
  width: {
    title: "its interval's width",
    legend: () => `width of the 90 % interval of niches reached by ${lineages()} in ${generations()}`,
    values: () => everywhere((j) => orNone(soFar("children", j), score(2, j, state.l, state.U) - score(1, j, state.l, state.U))),
    hatched: true,
  },
  reach: {
    title: "where all lineages go",
    legend: () => `probability that one of ${lineages()} from the chosen niche visits`,
    values: () => everywhere((j) => atLeastOne(state.h[state.l - 1][j], state.U)),
    scale: "root", colours: reachColours, bounds: [0, 1],
  },
  one: {
    title: "where one lineage goes",
    legend: () => "probability that one lineage from the chosen niche visits",
    values: () => everywhere((j) => state.h[state.l - 1][j]),
    scale: "root", colours: reachColours, bounds: [0, 1],
  },
  visits: {
    title: "births in the niche",
    legend: () => "births",
    values: () => everywhere((j) => counted(soFar("visits", j))),
    scale: "log",
  },
  children: {
    title: "births of its parents",
    legend: () => "births of parents in the niche",
    values: () => everywhere((j) => counted(soFar("children", j))),
    scale: "log",
  },
  first: {
    title: "when it was filled",
    legend: () => "number of the first birth in the niche",
    values: () => everywhere((j) => orNone(soFar("visits", j), past.first[j])),
  },
  objective: {
    title: "elite: objective",
    legend: () => data.objectiveName,
    values: () => everywhere((j) => orNone(soFar("visits", j), elite(0, j))),
  },
  depth: {
    title: "elite: depth",
    legend: () => "generations since an initial birth",
    values: () => everywhere((j) => orNone(soFar("visits", j), elite(1, j))),
  },
};
if (given) delete MAPS.width;
const hasElites = data.filled > 0 && elites.some(Number.isFinite);
if (!hasElites) for (const name of ["objective", "depth"]) delete MAPS[name];

/* Words, numbers and elements. */

const get = (id) => document.getElementById(id);
function number(value, digits = 3) {
  if (!Number.isFinite(value)) return "none";
  if (Number.isInteger(value)) return minus(String(value));
  const size = Math.abs(value);
  const text = size >= 1e-3 || size === 0 ? value.toFixed(Math.max(0, digits - 1 - Math.floor(Math.log10(size)))) : value.toExponential(digits - 1);
  return minus(text);
}
const some = (count, one) => `${count} ${one}${count === 1 ? "" : "s"}`;
const lineages = () => some(state.U, "lineage");
const generations = () => some(state.l, "generation");
const niches = (value) => value.toFixed(value < 100 ? 1 : 0);
const percent = (p) => (p > 0 && p < 1e-3 ? "<0.1 %" : `${(100 * p).toFixed(1)} %`);
// To a tenth of a niche or finer.
const decimals = Math.max(0, 1 - Math.floor(Math.log10(Math.min(...cell))));
const minus = (text) => text.replace(/-/g, "−");
const at = (point) => `${data.axes.map((name, k) => `${name} ${minus(point[k].toFixed(decimals))}`).join(", ")} ${data.unit}`;

function make(name, attributes = {}, text) {
  const svg = "http://www.w3.org/2000/svg";
  const inSvg = ["rect", "path", "text", "line", "g", "polygon", "polyline", "circle"].includes(name);
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
