/* What can be saved: the map as a picture, all niches as a table. */

function save(blob, ending) {
  const link = make("a", { href: URL.createObjectURL(blob), download: `${data.name}-${state.colour}.${ending}` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** All niches, one a line, as comma-separated text. */
function tableOfNiches() {
  const header = ["niche", ...data.axes, "births", "births_of_parents", "l", "lineages", "niches_reached", "low", "high", "first_birth", "objective", "depth", "uid"];
  const quoted = (text) => (/[",\n]/.test(text) ? `"${String(text).replace(/"/g, '""')}"` : text);
  const orEmpty = (value) => (Number.isFinite(value) ? value : "");
  const lines = everywhere((j) => [
    label(j), ...center(j), visits[j], children[j], state.l, state.U,
    score(0, j, state.l, state.U).toFixed(3),
    ...[1, 2].map((which) => (given ? "" : score(which, j, state.l, state.U).toFixed(3))),
    past.first[j] || "", orEmpty(elite(0, j)), orEmpty(elite(1, j)), orEmpty(elite(2, j)),
  ]);
  return [header, ...lines].map((line) => line.map(quoted).join(",")).join("\n") + "\n";
}
const saveTable = () => save(new Blob([tableOfNiches()], { type: "text/csv" }), "csv");

// A picture has no style sheet: what it looks like must stand in its elements.
const STYLE = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-dasharray", "stroke-linecap", "opacity", "font-size", "font-family", "text-anchor", "vector-effect"];

/** The map with its colours and their scale as SVG. */
function picture() {
  const { width, height } = svg.getBoundingClientRect();
  const copy = svg.cloneNode(true);
  const [own, copied] = [svg, copy].map((root) => root.querySelectorAll("*"));
  own.forEach((element, k) => {
    const style = getComputedStyle(element);
    for (const name of STYLE) copied[k].style.setProperty(name, style.getPropertyValue(name));
  });
  const ink = getComputedStyle(document.body);
  const words = (x, y, anchor, text) => make("text", { x, y, "text-anchor": anchor, fill: ink.color, "font-size": 13, "font-family": "system-ui, sans-serif" }, text);
  const { map, marks, colours } = scaleOf;
  const steps = 120;
  const bar = Array.from({ length: steps }, (_, k) => make("rect", {
    x: frame.x + (260 * k) / steps, y: height + 28, width: 260 / steps + 0.5, height: 11, fill: ramp(colours, k / (steps - 1)),
  }));
  copy.prepend(make("rect", { width, height: height + 70, fill: ink.backgroundColor }));
  copy.append(
    words(frame.x, height + 18, "start", `${data.name}: ${map.legend()}`), ...bar,
    ...marks.map((mark, k) => words(frame.x + 130 * k, height + 56, ["start", "middle", "end"][k], number(mark))),
  );
  for (const [key, value] of Object.entries({ xmlns: "http://www.w3.org/2000/svg", width, height: height + 70, viewBox: `0 0 ${width} ${height + 70}` })) copy.setAttribute(key, value);
  return { text: new XMLSerializer().serializeToString(copy), width, height: height + 70 };
}

function savePicture() {
  const { text, width, height } = picture();
  const image = new Image();
  image.addEventListener("load", () => {
    const canvas = make("canvas", { width: 2 * width, height: 2 * height });
    canvas.getContext("2d").drawImage(image, 0, 0, 2 * width, 2 * height);
    canvas.toBlob((blob) => save(blob, "png"));
  });
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
}
