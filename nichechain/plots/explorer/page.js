/* What one can do. */

function choose(niche, { focus = false } = {}) {
  rectangles[state.niche].setAttribute("aria-selected", "false");
  rectangles[state.niche].tabIndex = -1;
  state.niche = niche;
  rectangles[niche].setAttribute("aria-selected", "true");
  rectangles[niche].tabIndex = 0;
  if (focus) rectangles[niche].focus({ preventScroll: true });
  state.h = visitProbabilities(niche);
  state.edges = transitions(niche);
  state.incoming = transitionsInto(niche);
  keepInView(niche);
  layOut();
  update();
}

function update() {
  get("l").value = state.l;
  get("l-value").textContent = state.l;
  get("u").value = stops.indexOf(state.U);
  get("u").setAttribute("aria-valuetext", state.U);
  get("u-value").textContent = state.U;
  get("colour").value = state.colour;
  get("arrows").value = state.arrows;
  get("stage").value = state.stage;
  const births = data.stages[state.stage];
  get("stage").setAttribute("aria-valuetext", births);
  get("stage-value").textContent = births;
  get("go").value = label(state.niche);
  range = null;
  paint();
  drawPanel();
  get("live").textContent = `Niche ${label(state.niche)}: ${niches(score(0, state.niche, state.l, state.U))} niches reached, ` +
    `${visits[state.niche]} births${visits[state.niche] ? "" : ", never filled"}`;
  remember();
  tell({ niche: state.niche, l: state.l, U: state.U, colour: state.colour, arrows: state.arrows, stage: state.stage });
}

/** The address says what is shown; a page within another has none of its own. */
function remember() {
  if (beside) return;
  const { l, U, colour, arrows } = state;
  history.replaceState(null, "", `#niche=${label(state.niche)}&l=${l}&U=${U}&colour=${colour}&arrows=${arrows}&births=${data.stages[state.stage]}`);
}

/** Move the view, if it is zoomed in, so far that a niche can be seen. */
function keepInView(niche) {
  const [x, y] = onScreen(center(niche));
  const { width, height, scale } = frame;
  const off = [x - frame.x, frame.x + width - x, y - frame.y, frame.y + height - y];
  if (view.zoom > 1 && Math.min(...off) < 0.5 * cell[0] * scale) {
    const [cx, cy] = center(niche);
    view.x = (cx - left) / (right - left);
    view.y = (cy - bottom) / (top - bottom);
  }
}

function zoom(factor, point) {
  const box = svg.getBoundingClientRect();
  // Without a pointer, what is chosen stays where it is.
  const pixel = point ? [point[0] - box.left, point[1] - box.top] : onScreen(center(state.niche));
  const behavior = (p) => [
    left + view.x * (right - left) + (p[0] - frame.x - frame.width / 2) / frame.scale,
    bottom + view.y * (top - bottom) - (p[1] - frame.y - frame.height / 2) / frame.scale,
  ];
  const before = behavior(pixel);
  view.zoom = Math.min(Math.max(view.zoom * factor, 1), Math.max(4, Math.max(columns, rows) / 4));
  layOut();
  const after = behavior(pixel);
  view.x += (before[0] - after[0]) / (right - left);
  view.y += (before[1] - after[1]) / (top - bottom);
  if (!point) keepInView(state.niche);
  layOut();
}

function showTip(niche, x, y) {
  const tip = get("tip");
  const map = MAPS[state.colour];
  tip.textContent = [
    `niche ${label(niche)}`,
    at(center(niche)),
    `${map.legend()}: ${number(shown[niche])}`,
    visits[niche] ? `${some(visits[niche], "birth")}, ${children[niche]} of parents here` : "never filled",
  ].join("\n");
  tip.hidden = false;
  const room = get("map").getBoundingClientRect();
  const size = tip.getBoundingClientRect();
  tip.style.left = `${Math.min(x - room.left + 14, room.width - size.width)}px`;
  tip.style.top = `${y - room.top + 16 + size.height > room.height ? y - room.top - size.height - 10 : y - room.top + 16}px`;
}

/** The nearest niche to the chosen one in a direction: its neighbour on a grid. */
function neighbour([dx, dy]) {
  if (data.shape) {
    const [i, j] = index(state.niche);
    return i + dx >= 0 && i + dx < columns && j + dy >= 0 && j + dy < rows ? (i + dx) * rows + j + dy : state.niche;
  }
  const [x, y] = center(state.niche);
  let [best, least] = [state.niche, Infinity];
  for (let other = 0; other < n; other++) {
    const [ox, oy] = [center(other)[0] - x, center(other)[1] - y];
    const [along, across] = [ox * dx + oy * dy, Math.abs(ox * dy) + Math.abs(oy * dx)];
    const far = along + across;
    if (along > 0 && across <= along && far < least) [best, least] = [other, far];
  }
  return best;
}

/** The niche of a name such as 14,3, whatever is between the numbers; -1 if there is none. */
function named(text) {
  const numbers = (text.match(/\d+/g) || []).join(",");
  return rectangles.findIndex((_, k) => label(k) === numbers);
}

function goTo(text) {
  const niche = named(text);
  const example = data.shape ? `${columns - 1},${rows - 1}` : String(n - 1);
  get("go").setCustomValidity(niche < 0 ? `There is no such niche: they go up to ${example}.` : "");
  if (niche < 0) get("go").reportValidity();
  else choose(niche);
}

const nicheAt = (event) => (event.target.dataset && event.target.dataset.niche !== undefined ? Number(event.target.dataset.niche) : null);
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };

function listen() {
  get("controls").addEventListener("submit", (event) => { event.preventDefault(); goTo(get("go").value); });
  get("go").addEventListener("input", () => get("go").setCustomValidity(""));
  get("go").addEventListener("change", () => goTo(get("go").value));
  get("arrows").addEventListener("input", (event) => { state.arrows = event.target.value; update(); drawOverlay(); });
  get("stage").addEventListener("input", (event) => { state.stage = Number(event.target.value); update(); });
  get("save-picture").addEventListener("click", savePicture);
  get("save-table").addEventListener("click", saveTable);
  get("l").addEventListener("input", (event) => { state.l = Number(event.target.value); update(); });
  get("u").addEventListener("input", (event) => { state.U = stops[Number(event.target.value)]; update(); });
  get("colour").addEventListener("input", (event) => { state.colour = event.target.value; update(); });
  get("zoom-in").addEventListener("click", () => zoom(1.5));
  get("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
  get("zoom-all").addEventListener("click", () => zoom(0));
  get("theme").addEventListener("click", () => setTheme(theme() === "dark" ? "light" : "dark"));

  cells.addEventListener("keydown", (event) => {
    get("tip").hidden = true;
    if (event.key in ARROWS && !event.ctrlKey && !event.altKey && !event.metaKey) {
      choose(neighbour(ARROWS[event.key]), { focus: true });
    } else if (event.key === "+" || event.key === "=") zoom(1.5);
    else if (event.key === "-") zoom(1 / 1.5);
    else if (event.key === "0") zoom(0);
    else return;
    event.preventDefault();
  });

  let grip = null;
  svg.addEventListener("pointerdown", (event) => {
    grip = { x: event.clientX, y: event.clientY, niche: nicheAt(event), moved: false };
  });
  svg.addEventListener("pointermove", (event) => {
    const by = grip && [event.clientX - grip.x, event.clientY - grip.y];
    if (grip && (grip.moved || Math.hypot(...by) > 4)) {
      if (!grip.moved) svg.setPointerCapture(event.pointerId);
      grip.moved = true;
      svg.classList.add("moving");
      get("tip").hidden = true;
      view.x -= by[0] / frame.scale / (right - left);
      view.y += by[1] / frame.scale / (top - bottom);
      Object.assign(grip, { x: event.clientX, y: event.clientY });
      layOut();
      return;
    }
    const niche = nicheAt(event);
    if (niche === null) get("tip").hidden = true;
    else showTip(niche, event.clientX, event.clientY);
  });
  svg.addEventListener("pointerup", () => {
    if (grip && !grip.moved && grip.niche !== null) choose(grip.niche, { focus: true });
    grip = null;
    svg.classList.remove("moving");
  });
  svg.addEventListener("pointercancel", () => { grip = null; });
  svg.addEventListener("pointerleave", () => { get("tip").hidden = true; });
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 400), [event.clientX, event.clientY]);
  }, { passive: false });
  new ResizeObserver(layOut).observe(get("map"));
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  get("theme").textContent = name === "dark" ? "Light" : "Dark";
  get("theme").setAttribute("aria-label", `Switch to ${name === "dark" ? "light" : "dark"} colours`);
  if (state.h.length) {
    drawOverlay();
    paint();
  }
}

/** The niche, l, U and colour that the address asks for, as far as they exist. */
function fromAddress() {
  const asked = new URLSearchParams(location.hash.slice(1));
  const l = Number(asked.get("l"));
  if (Number.isInteger(l) && l >= 1 && l <= LONGEST) state.l = l;
  if (stops.includes(Number(asked.get("U")))) state.U = Number(asked.get("U"));
  if (Object.hasOwn(MAPS, asked.get("colour"))) state.colour = asked.get("colour");
  if (["out", "in", "lineage", "none"].includes(asked.get("arrows"))) state.arrows = asked.get("arrows");
  const stage = data.stages.indexOf(Number(asked.get("births")));
  if (stage >= 0) state.stage = stage;
  const niche = rectangles.findIndex((_, k) => label(k) === asked.get("niche"));
  return niche >= 0 ? niche : liveliest();
}

/* Beside another archive: what is chosen in one page is chosen in both, on one scale of colours. */

const beside = window.parent !== window;
let range = null;
let following = false;
const tell = (what) => { if (beside && !following) window.parent.postMessage(what, "*"); };
const rangeKey = () => `${state.colour} ${state.l} ${state.U}`;
function tellRange(low, high) {
  if (beside && !range) window.parent.postMessage({ range: { key: rangeKey(), low, high } }, "*");
}

function follow({ range: told, ...what }) {
  following = true;
  if (told) {
    if (told.key === rangeKey()) {
      range = told;
      paint();
    }
  } else {
    const { niche, stage, ...rest } = what;
    Object.assign(state, rest);
    if (!Object.hasOwn(MAPS, state.colour)) state.colour = "evolvability";
    if (!stops.includes(state.U)) state.U = stops.reduce((best, size) => (Math.abs(size - what.U) < Math.abs(best - what.U) ? size : best));
    state.stage = Math.min(stage, last);
    if (niche < n && niche !== state.niche) choose(niche);
    else { update(); drawOverlay(); }
  }
  following = false;
}
if (beside) window.addEventListener("message", (event) => { if (event.source === window.parent) follow(event.data); });

/** Of the niches that births speak of, the one whose lineages reach most. */
function liveliest() {
  const known = everywhere((j) => j).filter((j) => children[j] >= FEW);
  const worth = (j) => score(0, j, data.l, data.lineages);
  return known.reduce((best, j) => (worth(j) > worth(best) ? j : best), known[0] || 0);
}

/** Steps of the births that are shown, the last of which is not among them. */
function windowText() {
  const [first, end] = data.steps;
  return end < 2 ** 31 - 1 ? `${first} to ${end - 1}` : `${first} on`;
}

document.title = `${data.name}: nichechain explore`;
get("title").textContent = data.name;
const shareOutside = `${((100 * data.birthsOutside) / Math.max(1, data.birthsSeen)).toFixed(1)} % of them outside`;
get("summary").textContent = `${data.domain}: ${data.filled} of ${n} niches filled by ${data.births} births, ` +
  (data.steps ? `seen through ${data.birthsSeen} births of steps ${windowText()}, ` : "") +
  `${shareOutside}; T: ${data.estimator}`;
get("method").textContent = "Convention: definition, the root's own niche counts only if a descendant returns to it. " +
  "A lineage has l generations; U lineages have l·U descendants. Arrows, and where lineages go, are by the mean of T" +
  (data.strongest ? `, of which the ${data.strongest} strongest transitions of every niche are kept. ` : ". ") +
  (data.wormholes ? "Wormhole: a transition over ten times as probable as distance and destination explain. " : "") +
  (data.pairsLeftOut ? "" : "Dotted arrow: no birth did this. ") +
  "Numbers of niches are those of the whole search, whatever births are shown.";
get("stage").max = last;
if (!hasElites) document.querySelector('#arrows [value="lineage"]').remove();
get("u").max = stops.length - 1;
for (const [name, map] of Object.entries(MAPS)) get("colour").append(make("option", { value: name }, map.title));
const prefersDark = matchMedia("(prefers-color-scheme: dark)");
setTheme(prefersDark.matches ? "dark" : "light");
prefersDark.addEventListener("change", () => setTheme(prefersDark.matches ? "dark" : "light"));
listen();
choose(fromAddress());

// For tests and for the browser's console.
window.explorer = { data, state, choose, visitProbabilities, score, entry, lineage, tableOfNiches, picture };
