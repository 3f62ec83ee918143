/* The panel. */

const strongest = () => state.edges.filter((edge) => edge.to !== state.niche).slice(0, 8);
const longJumps = () => {
  const already = strongest();
  return state.edges.filter((edge) => edge.births && isFar(edge) && !already.includes(edge)).slice(0, 4);
};

function drawPanel() {
  const { niche, l, U } = state;
  get("niche").textContent = `Niche ${label(niche)}`;
  get("place").textContent = at(center(niche));
  const warning = get("warning");
  warning.hidden = children[niche] >= FEW;
  warning.textContent = `${children[niche] || "No"} birth${children[niche] === 1 ? "" : "s"} behind this niche's row of T: ` +
    (given ? "little is known of where its children land." : "this is mostly what niches in general do.");
  get("scores-title").textContent = `Niches reached by ${U} ${U === 1 ? "lineage" : "lineages"} in ${l} ${l === 1 ? "generation" : "generations"}`;
  get("plug-in-title").textContent = given ? "exact for this T" : "plug-in";
  get("plug-in").textContent = niches(coverage(state.h[l - 1], U));
  get("interval-title").textContent = given ? "interval" : "mean (90 % interval)";
  get("interval").textContent = interval();
  get("score-note").textContent = given
    ? `T is given by ${data.estimator}: it has no interval.`
    : `Over ${data.draws} draws of T, computed beforehand for U = ${data.sizes.join(", ")}. ` +
      "The plug-in is computed here from the mean of T, and so tends to lie above.";
  drawCurve();
  table(get("edges"), strongest());
  get("jumps-title").textContent = `More long jumps (${number(far, 2)} ${data.unit} or more)`;
  table(get("jumps"), longJumps(), "no others among the births");
  const own = state.edges.find((edge) => edge.to === niche);
  const stays = own ? own.probability : 0;
  facts(get("births"), [
    ["births in the niche", visits[niche]],
    ["births of parents in it", children[niche]],
    ["child stays in the niche", percent(stays)],
    ...(S > n ? [
      ["child lands outside", percent(state.edges.find((edge) => edge.to === n).probability)],
      [`lineage of ${l} passes outside`, percent(state.h[l - 1][n])],
    ] : []),
  ]);
  const filled = Number.isFinite(elite(2, niche));
  facts(get("elite"), filled ? [
    [data.objectiveName, number(elite(0, niche))],
    ["depth", `${elite(1, niche)} generations`],
    ["behavior", at([elite(3, niche), elite(4, niche)])],
    ["uid", elite(2, niche)],
  ] : [["none", "the niche was never filled"]]);
}

function interval() {
  const { niche, l, U } = state;
  if (given) return "none";
  const [mean, low, high] = [0, 1, 2].map((which) => score(which, niche, l, U));
  return mean === undefined ? `not for U = ${U}` : `${niches(mean)} (${niches(low)} to ${niches(high)})`;
}

function facts(list, pairs) {
  list.replaceChildren(...pairs.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
}

function table(element, edges, none) {
  element.replaceChildren();
  if (!edges.length) {
    element.append(make("caption", { class: "note", style: "text-align: left" }, none));
    return;
  }
  const head = make("tr");
  head.append(...["child in", "probability", "births", `distance (${data.unit})`].map((name) => make("th", { scope: "col" }, name)));
  element.append(head);
  for (const edge of edges) {
    const line = make("tr");
    const target = make("td");
    if (edge.to < n) {
      const link = make("button", { type: "button", "aria-label": `go to niche ${label(edge.to)}` }, label(edge.to));
      link.addEventListener("click", () => choose(edge.to));
      target.append(link);
    } else {
      target.textContent = "outside";
    }
    const gap = make("td");
    if (edge.wormhole !== undefined) gap.append(make("small", { title: `posterior probability ${edge.wormhole}` }, "wormhole"));
    else if (isFar(edge)) gap.append(make("small", {}, "long jump"));
    gap.append(edge.to < n ? number(edge.distance, 3) : "");
    line.append(target, make("td", {}, percent(edge.probability)), make("td", {}, edge.births), gap);
    element.append(line);
  }
}

/** Niches reached against the number of generations. */
function drawCurve() {
  const curve = get("curve");
  const [width, height] = [curve.clientWidth || 350, 168];
  const generations = Array.from({ length: LONGEST }, (_, k) => k + 1);
  const plugIn = generations.map((g) => coverage(state.h[g - 1], state.U));
  const drawn = given || score(0, 0, 1, state.U) === undefined ? null
    : [0, 1, 2].map((which) => generations.map((g) => score(which, state.niche, g, state.U)));
  const most = Math.max(...plugIn, ...(drawn ? drawn[2] : []), 1) * 1.06;
  const x = (g) => 34 + ((g - 1) / (LONGEST - 1)) * (width - 46);
  const y = (value) => 128 - (value / most) * 100;
  const points = (values) => values.map((value, k) => `${x(k + 1)},${y(value)}`);
  curve.setAttribute("aria-label", `Niches reached in 1 to ${LONGEST} generations by ${state.U} lineages: ${plugIn.map((v) => v.toFixed(1)).join(", ")}`);
  curve.setAttribute("viewBox", `0 0 ${width} ${height}`);
  curve.replaceChildren();
  for (const [value, text] of ticks(0, most, 3)) {
    curve.append(make("line", { class: "frame", x1: 34, x2: width - 12, y1: y(value), y2: y(value) }));
    curve.append(make("text", { x: 28, y: y(value) + 4, "text-anchor": "end" }, text));
  }
  for (const g of generations) curve.append(make("text", { x: x(g), y: 145, "text-anchor": "middle" }, g));
  curve.append(make("text", { x: width - 12, y: 162, "text-anchor": "end" }, `generations l, with U = ${state.U}`));
  curve.append(make("line", { class: "now", x1: x(state.l), x2: x(state.l), y1: 24, y2: 128 }));
  if (drawn) {
    curve.append(make("polygon", { class: "band", points: [...points(drawn[1]), ...points(drawn[2]).reverse()].join(" ") }));
    curve.append(make("polyline", { class: "mean", points: points(drawn[0]).join(" ") }));
  }
  curve.append(make("polyline", { class: "plug-in", points: points(plugIn).join(" ") }));
  const words = drawn ? [["mean and 90 %", "mean"], ["plug-in", "plug-in"]] : [[given ? "exact" : "plug-in", "plug-in"]];
  words.forEach(([text, kind], k) => {
    const from = 38 + k * 135;
    curve.append(make("line", { class: kind, x1: from, x2: from + 18, y1: 10, y2: 10 }));
    curve.append(make("text", { x: from + 23, y: 14 }, text));
  });
}
