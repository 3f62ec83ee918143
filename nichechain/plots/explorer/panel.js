/* The panel. */

function drawPanel() {
  const { niche, l, U } = state;
  get("niche").textContent = `Niche ${label(niche)}`;
  get("place").textContent = at(center(niche));
  const warning = get("warning");
  warning.hidden = children[niche] >= FEW;
  warning.textContent = `${children[niche] || "No"} birth${children[niche] === 1 ? "" : "s"} behind this niche's row of T: ` +
    (given ? "little is known of where its children land." : "this is mostly what niches in general do.");
  get("scores-title").textContent = `Niches reached by ${lineages()} in ${generations()}`;
  const [mean, low, high] = [0, 1, 2].map((which) => score(which, niche, l, U));
  get("value").textContent = niches(mean);
  get("interval").textContent = given ? "" : `90 % interval ${niches(low)} to ${niches(high)}`;
  get("score-note").textContent = given
    ? `T is ${data.estimator}: the number is exact for it, and has no interval.`
    : `Mean over ${data.draws} draws of T from what the births leave open. ` +
      (data.simulated ? "Lineages were simulated; the interval is by the draws' standard deviation." : "");
  drawCurve();
  table(get("edges"), strongest(), "to");
  get("jumps-title").textContent = `More long jumps (${number(far, 2)} ${data.unit} or more)`;
  table(get("jumps"), longJumps(), "to", "no others among the births");
  table(get("incoming"), leadHere(), "from", "no niche with enough births of parents");
  const own = state.edges.find((edge) => edge.to === niche);
  const stays = own ? own.probability : 0;
  facts(get("births"), [
    ["births in the niche", visits[niche]],
    ["births of parents in it", children[niche]],
    ...(visits[niche] ? [["first of them", `birth ${past.first[niche]}`]] : []),
    ...(state.stage < last ? [[`among the first ${data.stages[state.stage]}`, `${soFar("visits", niche)}, ${soFar("children", niche)}`]] : []),
    ["child stays in the niche", percent(stays)],
    ...(S > n ? [
      ["child lands outside", percent(state.edges.find((edge) => edge.to === n).probability)],
      [`lineage of ${l} passes outside`, percent(state.h[l - 1][n])],
    ] : []),
  ]);
  drawElite(niche);
}

function drawElite(niche) {
  const filled = Number.isFinite(elite(2, niche));
  const states = lineage(niche);
  get("rule").textContent = hasElites ? `: ${RULES[data.replacement] || data.replacement}` : "";
  facts(get("elite"), filled ? [
    [data.objectiveName, number(elite(0, niche))],
    ["depth", some(elite(1, niche), "generation")],
    ["behavior", at([elite(3, niche), elite(4, niche)])],
    ["uid", elite(2, niche)],
    ...(states.length > 1 ? [
      ["its lineage begins", label(states[0])],
      ["niches on its way", new Set(states.filter((place) => place < n)).size],
    ] : []),
  ] : [["none", hasElites ? "the niche was never filled" : "births only"]]);
  get("way").textContent = states.length > 1 ? states.filter((place, k) => place !== states[k - 1]).map(label).join(" → ") : "";
  const film = data.films[niche];
  get("film").replaceChildren();
  if (!film) return;
  const moving = film.startsWith("data:video");
  const shown = make(moving ? "video" : "img", { src: film, ...(moving ? { controls: "" } : { alt: `what the elite of niche ${label(niche)} does` }) });
  get("film").append(shown);
}
const RULES = { random: "a birth of the niche at random", first: "its first birth", newest: "its latest birth", objective: "its best birth" };

function facts(list, pairs) {
  list.replaceChildren(...pairs.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
}

/** Transitions as a table; the niche at the other end is ``to`` or ``from``. */
function table(element, edges, end, none) {
  element.replaceChildren();
  if (!edges.length) {
    element.append(make("caption", { class: "note", style: "text-align: left" }, none));
    return;
  }
  const head = make("tr");
  head.append(...[end === "to" ? "child in" : "parent in", "probability", "births", `distance (${data.unit})`].map((name) => make("th", { scope: "col" }, name)));
  element.append(head);
  for (const edge of edges) {
    const line = make("tr");
    const target = make("td");
    if (edge[end] < n) {
      const link = make("button", { type: "button", "aria-label": `go to niche ${label(edge[end])}` }, label(edge[end]));
      link.addEventListener("click", () => choose(edge[end]));
      target.append(link);
    } else {
      target.textContent = "outside";
    }
    const gap = make("td");
    if (edge.wormhole !== undefined) gap.append(make("small", { title: `posterior probability ${edge.wormhole}` }, "wormhole"));
    else if (isFar(edge)) gap.append(make("small", {}, "long jump"));
    gap.append(Number.isFinite(edge.distance) ? number(edge.distance, 3) : "");
    line.append(target, make("td", {}, percent(edge.probability)), make("td", {}, edge.births || (data.pairsLeftOut ? "few" : 0)), gap);
    element.append(line);
  }
}

/** Niches reached against the number of generations. */
function drawCurve() {
  const curve = get("curve");
  const [width, height] = [curve.clientWidth || 350, 162];
  const [from, to, floor] = [34, width - 12, 122];
  const steps = Array.from({ length: LONGEST }, (_, k) => k + 1);
  const [mean, low, high] = [0, 1, 2].map((which) => steps.map((g) => score(which, state.niche, g, state.U)));
  const most = Math.max(...high, 1) * 1.06;
  const x = (g) => from + ((g - 1) / (LONGEST - 1)) * (to - from);
  const y = (value) => floor - (value / most) * (floor - 10);
  const points = (values) => values.map((value, k) => `${x(k + 1)},${y(value)}`);
  curve.setAttribute("aria-label", `Niches reached in 1 to ${LONGEST} generations by ${lineages()}: ${mean.map((v) => v.toFixed(1)).join(", ")}`);
  curve.setAttribute("viewBox", `0 0 ${width} ${height}`);
  curve.replaceChildren();
  for (const [value, text] of ticks(0, most, 3)) {
    curve.append(make("line", { class: "frame", x1: from, x2: to, y1: y(value), y2: y(value) }));
    curve.append(make("text", { x: from - 6, y: y(value) + 4, "text-anchor": "end" }, text));
  }
  for (const g of steps) curve.append(make("text", { x: x(g), y: floor + 17, "text-anchor": "middle" }, g));
  curve.append(make("text", { x: to, y: floor + 34, "text-anchor": "end" }, `generations l, with ${lineages()}`));
  curve.append(make("line", { class: "now", x1: x(state.l), x2: x(state.l), y1: 10, y2: floor }));
  if (!given) curve.append(make("polygon", { class: "band", points: [...points(low), ...points(high).reverse()].join(" ") }));
  curve.append(make("polyline", { class: "mean", points: points(mean).join(" ") }));
  curve.append(make("circle", { class: "dot", cx: x(state.l), cy: y(mean[state.l - 1]), r: 4 }));
}
