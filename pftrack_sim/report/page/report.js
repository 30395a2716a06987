"use strict";
// Names come from third-party code: they reach the page as text, and Plotly, which reads a little HTML in labels, only escaped.
// The page is filled before Plotly is read: until then plots only take their room, and nothing moves when they are drawn.
const takeRoom = (plot, _, { height }) => { (plot.style ? plot : byId(plot)).style.minHeight = height ? `${height}px` : ""; };
window.Plotly = { react: takeRoom, newPlot: takeRoom, restyle() {}, relayout() {} };
const DATA = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const escaped = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const [colour, dash, marker] = [0, 1, 2].map((part) => (tracker) => DATA.styles.at(tracker)[part]); // -1: the first box in every frame
const finite = (values) => values.filter((value) => value !== null && Number.isFinite(value));
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const median = (values) => {
  const sorted = [...values].sort((a, b) => a - b), half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
};
const state = { trackers: new Set(DATA.trackers.keys()), scenario: -1, condition: -1, episode: 0, group: 0, tag: -1 };
const FIRST = 2; // columns of a row: tracker, episode, then the measures, then the error
const measureAt = (name) => FIRST + DATA.measures.findIndex(([key]) => key === name);
const OVERLAP = measureAt("mean_overlap");

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== null && text !== undefined) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

// The interval of score.statistics.mean_over_seeds of shares; null for too few values.
function interval(values) {
  const count = values.length;
  if (count < DATA.least_seeds) return null;
  const centre = mean(values), spread = Math.sqrt(mean(values.map((value) => (value - centre) ** 2)));
  if (spread === 0) return [centre, centre];
  const t = DATA.quantiles[count], error = spread / Math.sqrt(count - 1);
  const shift = mean(values.map((value) => ((value - centre) / spread) ** 3)) / (6 * Math.sqrt(count));
  const a = Math.abs(2 * shift) < 1e-9 ? 1e-9 : 2 * shift;
  const [above, below] = [t, -t].map((end) => (Math.cbrt(1 + 3 * a * (end - shift)) - 1) / a);
  return [Math.max(centre - error * Math.max(above, t), 0), Math.min(centre - error * Math.min(below, -t), 1)];
}

// An interval, or the values of which there are too few for one.
function inBrackets(values) {
  const range = interval(values);
  return range ? `[${number(range[0])}, ${number(range[1])}]` : values.length > 1 ? values.map((value) => number(value, 2)).join(" ") : "";
}

function chosen(row) {
  const episode = DATA.episodes[row[1]];
  return state.trackers.has(row[0])
    && (state.scenario < 0 || episode.scenario === state.scenario)
    && (state.condition < 0 || episode.condition === state.condition);
}

const titleOf = (episode) => DATA.unit === "seed" ? `${DATA.scenarios[episode.scenario]}, ${DATA.conditions[episode.condition]}, seed ${episode.seed}`
  : `${DATA.scenarios[episode.scenario]}, run ${episode.seed}`;

// One number per seed, as seeds are what is repeated; of result files, one per sequence. Episodes with the same are averaged.
function perSeed(rows, column) {
  const bySeed = new Map();
  for (const row of rows) {
    const value = row[column];
    if (value === null) continue;
    const seed = DATA.episodes[row[1]][DATA.unit === "seed" ? "seed" : "scenario"];
    if (!bySeed.has(seed)) bySeed.set(seed, []);
    bySeed.get(seed).push(value);
  }
  return [...bySeed.values()].map(mean);
}

function number(value, digits = 2) {
  return value === null || value === undefined || !Number.isFinite(value) ? "\u2013" : value.toFixed(digits).replace(/^-(?=[0.]*$)/, "");
}

function layout(x, y, more = {}) {
  const ink = getComputedStyle(document.body).getPropertyValue("--ink").trim();
  const line = getComputedStyle(document.body).getPropertyValue("--line").trim();
  const axis = { gridcolor: line, zerolinecolor: line, linecolor: line };
  return {
    // The tool bar has the top margin to itself; the legend lies below the plot.
    margin: { l: 56, r: 12, t: 34, b: 46, ...(more.margin || {}) }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: ink, size: 12 }, hovermode: "closest", showlegend: Boolean(more.legend), legend: more.legend, annotations: more.annotations || [],
    xaxis: { ...axis, title: { text: escaped(x), standoff: 8 }, ...(more.xaxis || {}) },
    yaxis: { ...axis, title: { text: escaped(y) }, ...(more.yaxis || {}) },
    shapes: more.shapes || [], height: more.height, modebar: { bgcolor: "rgba(0,0,0,0)", color: line, activecolor: ink },
  };
}
const SIGNS = { circle: "\u25cf", square: "\u25a0", "triangle-up": "\u25b2", diamond: "\u25c6", x: "\u2716", star: "\u2605" };
const LINE_PX = 15, MARGINS_PX = 80, FAR_PX = 60; // of a name; above and below a plot; no line leads farther

// Draw curves of shares, with names at their ends, or below where the plot is narrow.
function drawShares(plot, traces, x, y, more = {}) {
  const named = traces.filter((trace) => trace.showlegend !== false).map(({ name, tracker, x: at, y: values }) => {
    const known = values.filter(Number.isFinite);
    return { name, tracker, x: at[values.lastIndexOf(known.at(-1))], end: known.at(-1), mean: mean(known) };
  }).filter((one) => one.end !== undefined).sort((a, b) => a.end - b.end || a.mean - b.mean);
  const right = 44 + 6.6 * Math.max(0, ...named.map((one) => one.name.length)), [first, last] = [Math.min, Math.max].map((of) => of(...traces.flatMap((trace) => trace.x)));
  const axes = { yaxis: { range: [-0.02, 1.02] }, xaxis: traces.length ? { range: [first - 0.02 * (last - first), last + 0.01 * (last - first)] } : {} };
  if (plot.clientWidth < right + 280) {
    const legend = { orientation: "h", x: 0, y: 0, yref: "container", yanchor: "bottom", maxheight: 1 }, below = 20 * named.length;
    Plotly.react(plot, traces, layout(x, y, { ...more, ...axes, legend, height: 360 + below, margin: { b: 56 + below } }), CONFIG);
    return;
  }
  const height = Math.max(400, LINE_PX * named.length + MARGINS_PX), room = height - MARGINS_PX, pixel = (share) => (share + 0.02) / 1.04 * room;
  let place = -Infinity;
  for (const one of named) { place = Math.max(pixel(one.end), place + LINE_PX); one.place = place; }
  place = room + LINE_PX;
  for (const one of named.toReversed()) { place = Math.min(one.place, place - LINE_PX); one.place = place; }
  const annotations = named.map((one) => ({ text: `<span style="color:${colour(one.tracker)}">${SIGNS[marker(one.tracker)]}</span> ${one.name}`, font: { size: 11 },
    x: one.x, y: one.end, xanchor: "left", ax: 26, ay: pixel(one.end) - one.place, arrowhead: 0, arrowwidth: 1,
    arrowcolor: Math.abs(pixel(one.end) - one.place) < FAR_PX ? colour(one.tracker) : "rgba(0,0,0,0)" }));
  Plotly.react(plot, traces, layout(x, y, { ...more, ...axes, annotations, height, margin: { r: right } }), CONFIG);
}
const CONFIG = { displaylogo: false, displayModeBar: "hover", responsive: true, modeBarButtonsToRemove: ["lasso2d", "select2d"] };

function rowOf(names, cells) {
  const line = element("tr");
  cells.forEach((cell, k) => { const made = cell instanceof Node ? cell : element("td", cell); made.dataset.label = names[k]; line.append(made); });
  return line;
}

function fillTable(table, names, lines, meanings = {}) {
  const top = element("tr");
  top.append(...names.map((name) => element("th", name, { scope: "col", ...meanings[name] && { title: meanings[name] } })));
  table.tHead.replaceChildren(top);
  table.tBodies[0].replaceChildren(...lines.map((cells) => rowOf(names, cells)));
}

function swatch(tracker) {
  const made = element("span", null, { class: `swatch ${marker(tracker)}` });
  made.style.background = colour(tracker);
  return made;
}

function trackerHead(tracker) {
  const head = element("th", null, { scope: "row" });
  head.append(swatch(tracker), document.createTextNode(DATA.trackers[tracker]));
  return head;
}

const errorsOf = (rows) => rows.filter((row) => row[FIRST + DATA.measures.length] !== null).length;

function linkTo(text, title, act, href = "#h-episode") {
  const link = element("a", text, { href, title });
  link.addEventListener("click", (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return; // the browser's own ways to open a link
    event.preventDefault();
    act();
  });
  return link;
}

// Mean over seeds, as text; of times per frame the median over episodes, as in the terminal, of the slowest the longest. A time to the first loss is
// known only of drives that lost the target.
function measured(name, rows) {
  const column = measureAt(name);
  if (name.startsWith("ms")) {
    const times = finite(rows.map((row) => row[column]));
    const shown = name === "ms_max" ? Math.max(...times) : median(times);
    return { values: times, text: times.length ? number(shown, 2) : "\u2013" };
  }
  const held = name === "follow_time_to_loss_s" ? rows.filter((row) => row[measureAt("follow_losses")] === 0) : [];
  const values = perSeed(rows.filter((row) => !held.includes(row)), column);
  const text = values.length ? number(mean(values)) : held.length ? "never" : "\u2013";
  return { values, text: held.length && values.length ? `${text} (never in ${held.length} of ${rows.length})` : text };
}

function drawBoards() {
  drawBoard("board", DATA.groups[state.group][1], OVERLAP, () => true);
  if (!DATA.people.length) return;
  const first = measureAt(DATA.people[0]);
  drawBoard("people", DATA.people, first, (row) => row[first] !== null);
}

// Trackers in the order of the column `by`; `counts` says which of their rows are meant.
function drawBoard(id, shown, by, counts) {
  const names = ["tracker", `${DATA.unit}s`], ranged = DATA.measures[by - FIRST][0];
  for (const name of shown) {
    names.push(DATA.measures.find(([key]) => key === name)[1]);
    if (name === "stay") names.push("skill");
  }
  const groups = [...state.trackers].map((tracker) => {
    const rows = DATA.rows.filter((row) => row[0] === tracker && chosen(row) && counts(row));
    const seeds = perSeed(rows, by);
    return { tracker, rows, seeds, mean: seeds.length ? mean(seeds) : -1 };
  }).filter((group) => group.rows.length);
  groups.sort((a, b) => b.mean - a.mean);
  fillTable(byId(id), names, groups.map((group) => {
    const head = trackerHead(group.tracker);
    head.append(document.createElement("br"), linkTo("worst episode", "Show its episode with the lowest overlap", () => showWorst(group.rows)));
    const errors = errorsOf(group.rows);
    if (errors) head.append(document.createElement("br"), element("small", `${errors} error${errors === 1 ? "" : "s"}`, { class: "error" }));
    const cells = [head, element("td", group.seeds.length)];
    for (const name of shown) {
      const { values, text } = measured(name, group.rows);
      const cell = element("td"), value = element("span", text);
      cell.append(value);
      if (name === ranged) value.append(document.createElement("br"), element("small", inBrackets(values)));
      cells.push(cell);
      if (name === "stay") cells.push(element("td", number(values.length ? (group.mean - mean(values)) / (1 - mean(values)) : null)));
    }
    return cells;
  }), Object.fromEntries(DATA.measures.map(([, head, meaning]) => [head, meaning])));
}

function drawCurves() {
  for (const [id, column, thresholds, x, y] of [
    ["success", 4, DATA.success_thresholds, "overlap threshold", "success rate"],
    ["precision", 5, DATA.precision_thresholds, "centre error threshold [px]", "precision"],
  ]) {
    const traces = [...state.trackers].map((tracker) => {
      let frames = 0;
      const sums = thresholds.map(() => 0);
      for (const curve of DATA.curves) {
        if (curve[0] !== tracker || (state.scenario >= 0 && curve[1] !== state.scenario)
          || (state.condition >= 0 && curve[2] !== state.condition)) continue;
        frames += curve[3];
        curve[column].forEach((count, k) => { sums[k] += count; });
      }
      return { x: thresholds, y: sums.map((sum) => sum / frames), name: escaped(DATA.trackers[tracker]), tracker, frames, ...look(tracker) };
    }).filter((trace) => trace.frames > 0);
    drawShares(byId(id), traces, x, y);
    onClick(byId(id), ({ data }) => showWorst(DATA.rows.filter((row) => row[0] === data.tracker && chosen(row))));
  }
}

// A line whose marks are far enough apart to tell it without its colour.
function look(tracker) {
  return { mode: "lines+markers", marker: { symbol: marker(tracker), color: colour(tracker), size: 6, maxdisplayed: 12 },
    line: { color: colour(tracker), dash: dash(tracker), width: 2 } };
}

function onClick(plot, act) {
  if (!plot.on) return; // not drawn yet
  plot.removeAllListeners("plotly_click");
  plot.on("plotly_click", (event) => act(event.points[0]));
}

// Conditions with given levels; an axis that a condition does not name is at 0.
function conditionsAt(levels) {
  return new Set([...DATA.levels.keys()].filter((k) => levels.every(([label, x]) => (DATA.levels[k][label.split(", mean over")[0]] ?? 0) === x)));
}

function rowsAt(tracker, levels) {
  const conditions = conditionsAt(levels);
  return DATA.rows.filter((row) => row[0] === tracker && conditions.has(DATA.episodes[row[1]].condition)
    && (state.scenario < 0 || DATA.episodes[row[1]].scenario === state.scenario));
}

// Values of [key, seed, value]: for each key the values of its seeds, each averaged over the scenarios.
function bySeed(entries) {
  const keys = new Map();
  for (const [key, seed, value] of entries) {
    if (!keys.has(key)) keys.set(key, new Map());
    const seeds = keys.get(key);
    seeds.set(seed, [...(seeds.get(seed) || []), value]);
  }
  return [...keys].map(([key, seeds]) => [key, [...seeds.values()].map(mean)]);
}

// Overlaps on the frames that all levels of an axis share; grey and dashed: the first box in every frame.
function drawAxes() {
  const room = byId("axes"), maps = byId("maps");
  const own = (scenario, overlap, name) => overlap !== null && (state.scenario < 0 || scenario === state.scenario)
    && (!DATA.trackers.includes(name) || state.trackers.has(DATA.trackers.indexOf(name)));
  room.replaceChildren(); maps.replaceChildren();
  const curves = [];
  for (const label of new Set(DATA.axes.map((row) => row[0]))) {
    const traces = [], rows = DATA.axes.filter(([whose, , name, scenario, , overlap]) => whose === label && own(scenario, overlap, name));
    for (const name of new Set(rows.map((row) => row[2]))) {
      const points = bySeed(rows.filter((row) => row[2] === name).map(([, x, , , seed, overlap]) => [x, seed, overlap]))
        .sort((a, b) => a[0] - b[0]).map(([x, values]) => ({ x, values, range: interval(values) }));
      if (points.length < 2) continue; // no curve
      const tracker = DATA.trackers.indexOf(name), x = points.map((point) => point.x);
      const more = { legendgroup: `t${name}`, showlegend: false, hoverinfo: "skip" };
      if (points.every((point) => point.range)) {
        traces.push({ ...more, x: [...x, ...[...x].reverse()],
          y: [...points.map((point) => point.range[1]), ...points.map((point) => point.range[0]).reverse()],
          fill: "toself", fillcolor: colour(tracker) + "22", line: { width: 0 }, mode: "lines" });
      } else { // too few seeds for a band: a point for each
        traces.push({ ...more, x: points.flatMap((point) => point.values.map(() => point.x)), y: points.flatMap((point) => point.values),
          mode: "markers", marker: { color: colour(tracker) + "66", symbol: marker(tracker), size: 4 } });
      }
      traces.push({ x, y: points.map((point) => mean(point.values)), legendgroup: more.legendgroup, name: escaped(name), tracker,
        text: points.map((point) => `${point.values.length} seeds`), ...look(tracker) });
    }
    if (traces.length) curves.push({ label, traces, plot: element("div", null, { class: "plot" }) });
  }
  // A plot takes its width when it is drawn: all of them must be in the grid by then.
  room.append(...curves.map(({ plot }) => plot));
  for (const { label, traces, plot } of curves) {
    drawShares(plot, traces, label, "mean overlap");
    onClick(plot, ({ data, x }) => showWorst(rowsAt(data.tracker, [[label, x]])));
  }
  for (const pair of new Set(DATA.maps.map(([one, , other]) => JSON.stringify([one, other])))) {
    const [one, other] = JSON.parse(pair);
    const rows = DATA.maps.filter((row) => row[0] === one && row[2] === other && own(row[5], row[7], row[4]));
    for (const name of new Set(rows.map((row) => row[4]))) {
      const cells = new Map(bySeed(rows.filter((row) => row[4] === name).map((row) => [`${row[1]} ${row[3]}`, row[6], row[7]])));
      const [xs, ys] = [1, 3].map((column) => [...new Set(rows.map((row) => row[column]))].sort((a, b) => a - b));
      const z = ys.map((y) => xs.map((x) => cells.has(`${x} ${y}`) ? mean(cells.get(`${x} ${y}`)) : null));
      const plot = element("div", null, { class: "map" }), texts = (values) => values.map((value) => String(Number(value.toPrecision(3))));
      maps.append(plot);
      Plotly.newPlot(plot, [{ type: "heatmap", x: texts(xs), y: texts(ys), z, zmin: 0, zmax: 1, colorscale: "Viridis", showscale: false,
        texttemplate: "%{z:.2f}", hovertemplate: "%{x}, %{y}: %{z:.3f}<extra></extra>" }],
      { ...layout(one, other, { xaxis: { type: "category" }, yaxis: { type: "category" }, margin: { t: 40 } }),
        title: { text: escaped(name), font: { size: 13 }, x: 0.5 } }, { ...CONFIG, displayModeBar: false });
      onClick(plot, ({ pointIndex }) => showWorst(rowsAt(DATA.trackers.indexOf(name), [[one, xs[pointIndex[1]]], [other, ys[pointIndex[0]]]])));
    }
  }
  byId("maps-note").hidden = !maps.childElementCount;
  byId("axes-section").hidden = !room.childElementCount && !maps.childElementCount;
}

function drawMatrix() {
  const table = byId("matrix"), count = DATA.trackers.length;
  table.closest("section").hidden = count < 2;
  const cells = Array.from({ length: count }, () => Array(count).fill(null));
  for (const pair of DATA.matrix) {
    cells[pair.one][pair.other] = { ...pair, sign: 1 };
    cells[pair.other][pair.one] = { ...pair, sign: -1 };
  }
  table.replaceChildren();
  table.classList.toggle("many", count > 6);
  const overlap = DATA.trackers.map((_, tracker) => mean(perSeed(DATA.rows.filter((row) => row[0] === tracker), OVERLAP)) || 0);
  const order = [...DATA.trackers.keys()].sort((a, b) => overlap[b] - overlap[a]), head = element("tr");
  head.append(element("th", "row \u2212 column", { scope: "col" }), ...order.map((one) => element("th", DATA.trackers[one], { scope: "col" })));
  table.append(head);
  order.forEach((one) => {
    const line = element("tr");
    line.append(element("th", DATA.trackers[one], { scope: "row" }));
    order.forEach((other) => {
      const pair = cells[one][other];
      const cell = element("td", one === other || !pair || pair.difference === null ? "" : number(pair.sign * pair.difference));
      if (pair && pair.shown) cell.style.fontWeight = "700";
      if (pair && pair.difference !== null) cell.title = `p ${pair.p < 0.001 ? "< 0.001" : `= ${number(pair.p, 3)}`}, ${pair.seeds} ${DATA.unit}s`;
      line.append(cell);
    });
    table.append(line);
  });
}

function drawSpeed() {
  byId("slowest").replaceChildren(...DATA.slowest.filter(([tracker]) => state.trackers.has(tracker)).map(([tracker, ms, episode, frame, seconds]) => {
    const line = element("li", `${DATA.trackers[tracker]}: slowest frame ${number(ms, 1)} ms, `);
    line.append(linkTo(`${titleOf(DATA.episodes[episode])}, frame ${frame}`, "Show this frame", () => showAtTime(tracker, episode, seconds)));
    return line;
  }));
  const column = measureAt("ms_median");
  byId("slowest").closest("details").hidden = !DATA.slowest.length;
  byId("speed").closest("section").hidden = column < FIRST;
  if (column < FIRST) return;
  const bars = [...state.trackers].map((tracker) => {
    const values = finite(DATA.rows.filter((row) => row[0] === tracker && chosen(row)).map((row) => row[column]));
    return values.length ? [tracker, median(values)] : null;
  }).filter(Boolean).sort((a, b) => a[1] - b[1]);
  const names = bars.map(([tracker]) => escaped(DATA.trackers[tracker]));
  Plotly.react("speed", [{ type: "bar", orientation: "h", y: names, x: bars.map((bar) => bar[1]),
    marker: { color: bars.map(([tracker]) => colour(tracker)) }, text: bars.map((bar) => number(bar[1], 2)), textposition: "outside", cliponaxis: false }],
  layout("ms per frame", "", { height: 24 * bars.length + 120, margin: { r: 44 }, xaxis: { rangemode: "tozero" }, yaxis: { automargin: true, autorange: "reversed" } }), CONFIG);
}

function drawAll() { drawAnswers(); drawBoards(); drawCurves(); drawAxes(); drawLosses(); drawEpisode(); drawSpeed(); }

function fill(select, names, all) {
  if (all) select.append(element("option", all, { value: -1 }));
  names.forEach((name, index) => select.append(element("option", name, { value: index })));
}

function start() {
  const seeds = new Set(DATA.episodes.map((episode) => episode.seed));
  const parts = DATA.unit === "seed" ? [["tracker", DATA.trackers.length], ["scenario", DATA.scenarios.length],
    ["condition", DATA.conditions.length], ["seed", seeds.size], ["episode", DATA.episodes.length]]
    : [["tracker", DATA.trackers.length], ["sequence", DATA.scenarios.length], ["result", DATA.rows.length]];
  byId("extent").textContent = `${document.title.split(" - ")[0]}: ${parts.map(([name, count]) => `${count} ${name}${count === 1 ? "" : "s"}`).join(", ")}`;
  DATA.trackers.forEach((name, index) => {
    const label = element("label"), box = element("input", null, { type: "checkbox", checked: "" });
    box.addEventListener("change", () => {
      if (box.checked) state.trackers.add(index); else state.trackers.delete(index);
      state.trackers = new Set([...state.trackers].sort((a, b) => a - b));
      drawAll();
    });
    label.append(box, swatch(index), document.createTextNode(name));
    byId("filter-trackers").append(label);
  });
  fill(byId("filter-scenario"), DATA.scenarios, "all");
  fill(byId("filter-condition"), DATA.conditions, "all");
  byId("filter-scenario").addEventListener("change", (event) => { state.scenario = Number(event.target.value); drawAll(); });
  byId("filter-condition").addEventListener("change", (event) => { state.condition = Number(event.target.value); drawAll(); });
  fill(byId("group"), DATA.groups.map(([title]) => title));
  state.group = DATA.drives.length ? Math.max(DATA.groups.findIndex(([title]) => title === "following"), 0) : 0;
  byId("group").value = state.group;
  byId("group").addEventListener("change", (event) => { state.group = Number(event.target.value); drawBoards(); });
  fill(byId("tag"), DATA.tags.map(([name]) => name), "anything");
  byId("tag").addEventListener("change", (event) => { state.tag = Number(event.target.value); drawLosses(); });
  fill(byId("episode"), DATA.episodes.map(titleOf));
  const filmed = DATA.episodes.findIndex((episode) => episode.video);
  state.episode = Math.max(filmed, 0);
  byId("episode").value = state.episode;
  byId("episode").addEventListener("change", (event) => showEpisode(Number(event.target.value)));
  byId("video").addEventListener("timeupdate", () => mark(frameAt(byId("video").currentTime)));
  byId("viewer").addEventListener("keydown", keys);
  byId("filters").addEventListener("submit", (event) => event.preventDefault());
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  drawAll();
  drawMatrix();
}
