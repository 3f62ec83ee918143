/* What is drawn over the map: transitions, lineages, the chosen niche. */

const seenBirths = (from, to) => {
  for (let k = counts.start[from]; k < counts.start[from + 1]; k++) if (counts.column[k] === to) return counts.count[k];
  return 0;
};
const edgeOf = (from, to, probability, births) => ({
  from, to, probability, births,
  distance: to < n && from < n ? distance(from, to) : NaN,
  wormhole: wormholes.get(from * S + to),
});
const surestFirst = (a, b) => b.probability - a.probability;

/** Transitions out of a state: its children's states with probability and births, the surest first. */
function transitions(from) {
  const seen = new Map();
  for (let k = counts.start[from]; k < counts.start[from + 1]; k++) seen.set(counts.column[k], counts.count[k]);
  return Array.from(row(from), (probability, to) => edgeOf(from, to, probability, seen.get(to) || 0)).sort(surestFirst);
}

/** Transitions into a niche, from states that parents stood in, the surest first. */
function transitionsInto(to) {
  const found = [];
  for (let from = 0; from < S; from++) if (children[from]) found.push(edgeOf(from, to, entry(from, to), seenBirths(from, to)));
  return found.sort(surestFirst);
}

const isFar = (edge) => edge.distance >= far;
const elsewhere = (edge) => edge.from !== edge.to;
const strongest = () => state.edges.filter(elsewhere).slice(0, 8);
const longJumps = () => {
  const already = strongest();
  return state.edges.filter((edge) => edge.births && isFar(edge) && !already.includes(edge)).slice(0, 4);
};
// A niche that few births left says little of where its children land.
const leadHere = () => state.incoming.filter((edge) => elsewhere(edge) && children[edge.from] >= FEW).slice(0, 8);

function drawArrow(edge, styles) {
  const [a, target] = [onScreen(center(edge.from)), onScreen(center(edge.to))];
  // Arrows that end in one niche would hide each other's heads at its centre.
  const short = edge.to === state.niche ? Math.min(0.7 * Math.min(...cell) * frame.scale, 16) / Math.hypot(target[0] - a[0], target[1] - a[1]) : 0;
  const b = target.map((v, k) => v + short * (a[k] - v));
  const [halo, colour] = ["--halo", isFar(edge) ? "--jump" : "--edge"].map((name) => styles.getPropertyValue(name));
  const width = 1.2 + 5 * Math.sqrt(edge.probability);
  // Curved, so that an arrow and its opposite do not lie on each other.
  const bend = [(a[0] + b[0]) / 2 - 0.14 * (b[1] - a[1]), (a[1] + b[1]) / 2 + 0.14 * (b[0] - a[0])];
  const angle = Math.atan2(b[1] - bend[1], b[0] - bend[0]);
  const size = 5 + 1.6 * width;
  const foot = [b[0] - size * 0.8 * Math.cos(angle), b[1] - size * 0.8 * Math.sin(angle)];
  const wing = (turn) => `${b[0] - size * Math.cos(angle + turn)},${b[1] - size * Math.sin(angle + turn)}`;
  const path = `M${a}Q${bend} ${foot}`;
  const dash = edge.births || data.pairsLeftOut ? "none" : "2 5";
  overlay.append(make("path", { class: "arrow", d: path, stroke: halo, "stroke-width": width + 2.5, opacity: 0.75 }));
  overlay.append(make("path", { class: "arrow", d: path, stroke: colour, "stroke-width": width, "stroke-dasharray": dash }));
  overlay.append(make("polygon", { points: `${b} ${wing(0.45)} ${wing(-0.45)}`, fill: colour, stroke: halo, "stroke-width": 0.8 }));
}

/** The ancestors of the niche's elite, from the first, a ring, to the niche; dashed through the outside. */
function drawLineage(styles) {
  const states = lineage(state.niche);
  const [halo, colour] = ["--halo", "--lineage"].map((name) => styles.getPropertyValue(name));
  const inside = states.map((place, k) => [place, k]).filter(([place]) => place < n);
  if (!inside.length) return;
  for (let k = 1; k < inside.length; k++) {
    const [[from, i], [to, j]] = [inside[k - 1], inside[k]];
    if (from === to) continue;
    const [a, b] = [onScreen(center(from)), onScreen(center(to))];
    const bend = [(a[0] + b[0]) / 2 - 0.1 * (b[1] - a[1]), (a[1] + b[1]) / 2 + 0.1 * (b[0] - a[0])];
    const path = `M${a}Q${bend} ${b}`;
    overlay.append(make("path", { class: "arrow", d: path, stroke: halo, "stroke-width": 5, opacity: 0.7 }));
    overlay.append(make("path", { class: "arrow step", d: path, stroke: colour, "stroke-width": 2.2, "stroke-dasharray": j - i > 1 ? "3 5" : "none" }));
  }
  inside.forEach(([place], k) => {
    const [x, y] = onScreen(center(place));
    const first = k === 0;
    overlay.append(make("circle", { cx: x, cy: y, r: first ? 6.5 : 3.6, fill: first ? halo : colour, stroke: first ? colour : halo, "stroke-width": first ? 3 : 1.2 }));
  });
}

function drawOverlay() {
  overlay.replaceChildren();
  const styles = getComputedStyle(document.documentElement);
  const drawn = { out: strongest().concat(longJumps()), in: leadHere() }[state.arrows] || [];
  drawn.filter((edge) => edge.to < n && edge.from < n).reverse().forEach((edge) => drawArrow(edge, styles));
  if (state.arrows === "lineage") drawLineage(styles);
  if (data.start) {
    const [x, y] = onScreen(data.start);
    overlay.append(make("path", { class: "start", d: `M${x - 2.5} ${y - 7.5}h5v5h5v5h-5v5h-5v-5h-5v-5h5z` }));
  }
  const path = `M${outline(state.niche).map(onScreen).join("L")}Z`;
  overlay.append(make("path", { d: path, class: "chosen-halo" }), make("path", { d: path, class: "chosen" }));
}
