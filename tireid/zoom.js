// Draws panels of a figure in place of its picture, and back: `data` and LIBRARY as of zoom.py.
const HEIGHT = 240, FINEST = 5;  // px; digits that are read
const HINT = "Drag to zoom, double-click for all. "
  + `Of long signals: the lowest and highest sample of each of ${data.columns} columns.`;
const STYLE = `
.zoomed { display: grid; gap: .4rem 1rem; margin: .5rem 0;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); }
.zoomed > div { min-width: 0; }
.zoomed .u-title { font-size: .85rem; line-height: 1.3; }
.zoomed .u-legend { border: 0; font-size: .8rem; text-align: left; }
.zoomed .u-legend tr > * { padding: 0 .2rem; border: 0; font-weight: 400; white-space: nowrap; }
.zoomed .u-value { min-width: 4.5em; font-variant-numeric: tabular-nums; }
figure > button { margin-top: .5rem; padding: .25rem .9rem; font: inherit; font-size: .9rem;
  color: #00588c; background: #fff; border: 1px solid; border-radius: 6px; cursor: pointer; }
@media print { figure > button { display: none; } }
`;
const element = (kind, text, place) => {
  const made = document.createElement(kind);
  made.textContent = text;
  place.append(made);
  return made;
};
element("style", LIBRARY + STYLE, document.head);
const arrays = data.arrays.map(([decimals, ...steps]) => {
  let sum = 0;
  return steps.map(step => step === null ? null : (sum += step) / 10 ** decimals);
});
const read = (u, value) => value == null ? "" : String(+value.toPrecision(FINEST));

function series({ name, color, kind }, up) {
  const line = { label: name || up, stroke: color, value: read, points: { show: false } };
  if (kind === "points")
    return { ...line, paths: () => null, points: { show: true, size: 3, fill: color, width: 0 } };
  if (kind === "dashed") return { ...line, width: 1.5, dash: [6, 4] };
  if (kind === "line") return { ...line, width: 1.5 };
  return { ...line, label: `${name} (${kind})`, width: .5 };
}

function shade(u, spans) {
  for (const [from, to, color] of spans) {
    const [left, right] = [from, to].map(x => u.valToPos(x, "x", true));
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    u.ctx.fillStyle = color;
    u.ctx.fillRect(left, u.bbox.top, Math.max(right - left, 1), u.bbox.height);
    u.ctx.restore();
  }
}

function chart(panel, place, key) {
  const lines = panel.series, [least, most] = panel.limits;
  const bands = lines.flatMap(({ kind, color }, k) =>
    kind === "high" ? [{ series: [k + 1, k], fill: color + "50" }] : []);
  const inside = (u, low, high) => {
    const ends = [Math.max(low ?? least, least), Math.min(high ?? most, most)];
    const room = .05 * (ends[1] - ends[0]);
    return room > 0 ? [ends[0] - room, ends[1] + room] : [least, most];
  };
  const made = new uPlot({
    title: panel.title, width: place.clientWidth || 300, height: HEIGHT, pxAlign: 0, bands,
    cursor: { sync: { key }, y: false },
    axes: [{ label: panel.across, labelSize: 18, size: 34 }, { label: panel.up, labelSize: 18 }],
    scales: { x: { time: false }, y: { range: inside } },
    series: [{ label: panel.across, value: read }, ...lines.map(line => series(line, panel.up))],
    hooks: { drawClear: [u => shade(u, panel.spans)] },
  }, uPlot.join(lines.map(({ x, y }) => [arrays[x], arrays[y]])), place);
  new ResizeObserver(() => made.setSize({ width: place.clientWidth, height: HEIGHT }))
    .observe(place);
}

for (const [id, panels] of Object.entries(data.figures)) {
  const figure = document.getElementById(id);
  const picture = [...figure.children].find(one => one.querySelector("img"));
  const button = element("button", "Zoom", figure);
  let plots = null;
  button.type = "button";
  button.onclick = () => {
    const first = !plots;
    plots ??= document.createElement("div");
    if (first) picture.after(plots);
    picture.hidden = !picture.hidden;
    plots.hidden = !picture.hidden;
    button.textContent = picture.hidden ? "Picture" : "Zoom";
    if (!first) return;
    element("small", HINT, plots);
    const grid = element("div", "", plots);
    grid.className = "zoomed";
    for (const panel of panels) chart(panel, element("div", "", grid), id);
  };
}
