"use strict";
// Names come from strangers: they reach the page as text, and Plotly, which reads a little HTML in labels, only escaped.
const DATA = JSON.parse(document.getElementById("data").textContent);
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31", "#7F7F7F"];
const DASHES = ["solid", "dash", "dot", "dashdot"];
const byId = (id) => document.getElementById(id);
const escaped = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const colour = (tracker) => COLOURS[tracker % COLOURS.length];
const dash = (tracker) => DASHES[Math.floor(tracker / COLOURS.length) % DASHES.length];
const finite = (values) => values.filter((value) => value !== null && Number.isFinite(value));
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const state = { trackers: new Set(DATA.trackers.keys()), scenario: -1, condition: -1, episode: 0 };
const FIRST = 2; // columns of a row: tracker, episode, then the measures, then the error
const measureAt = (name) => FIRST + DATA.measures.findIndex(([key]) => key === name);
const OVERLAP = measureAt("mean_overlap");

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== null && text !== undefined) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

// A small generator with a fixed start: the same rows give the same interval.
function generator() {
  let word = 12345;
  return () => { word = (Math.imul(word, 1664525) + 1013904223) >>> 0; return word / 4294967296; };
}

function interval(values) {
  if (values.length < 2) return null;
  const random = generator(), means = [];
  for (let draw = 0; draw < 1000; draw++) {
    let sum = 0;
    for (let k = 0; k < values.length; k++) sum += values[Math.floor(random() * values.length)];
    means.push(sum / values.length);
  }
  means.sort((a, b) => a - b);
  return [means[24], means[974]];
}

function chosen(row) {
  const episode = DATA.episodes[row[1]];
  return state.trackers.has(row[0])
    && (state.scenario < 0 || episode.scenario === state.scenario)
    && (state.condition < 0 || episode.condition === state.condition);
}

// One number per seed: episodes of one seed are averaged, as seeds are what is repeated.
function perSeed(rows, column) {
  const bySeed = new Map();
  for (const row of rows) {
    const value = row[column];
    if (value === null) continue;
    const seed = DATA.episodes[row[1]].seed;
    if (!bySeed.has(seed)) bySeed.set(seed, []);
    bySeed.get(seed).push(value);
  }
  return [...bySeed.values()].map(mean);
}

function number(value, digits = 3) {
  return value === null || value === undefined || !Number.isFinite(value) ? "\u2013" : value.toFixed(digits);
}

function layout(x, y, more = {}) {
  const ink = getComputedStyle(document.body).getPropertyValue("--ink").trim();
  const line = getComputedStyle(document.body).getPropertyValue("--line").trim();
  const axis = { gridcolor: line, zerolinecolor: line, linecolor: line };
  return {
    margin: { l: 56, r: 12, t: 12, b: 46 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: ink, size: 12 }, hovermode: "closest", legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" },
    xaxis: { ...axis, title: { text: escaped(x) }, ...(more.xaxis || {}) },
    yaxis: { ...axis, title: { text: escaped(y) }, ...(more.yaxis || {}) },
    shapes: more.shapes || [],
  };
}
const CONFIG = { displaylogo: false, responsive: true, modeBarButtonsToRemove: ["lasso2d", "select2d"] };

function drawBoard() {
  const head = byId("board").tHead, body = byId("board").tBodies[0];
  head.replaceChildren(); body.replaceChildren();
  const top = element("tr");
  top.append(element("th", "tracker", { scope: "col" }), element("th", "seeds", { scope: "col" }));
  for (const [name, label] of DATA.measures) {
    top.append(element("th", label, { scope: "col" }));
    if (name === "stay") top.append(element("th", "skill", { scope: "col" }));
  }
  head.append(top);
  const groups = [...state.trackers].map((tracker) => {
    const rows = DATA.rows.filter((row) => row[0] === tracker && chosen(row));
    const seeds = perSeed(rows, OVERLAP);
    return { tracker, rows, seeds, mean: seeds.length ? mean(seeds) : -1 };
  }).filter((group) => group.rows.length);
  groups.sort((a, b) => b.mean - a.mean);
  for (const group of groups) {
    const line = element("tr");
    line.append(element("th", DATA.trackers[group.tracker], { scope: "row" }), element("td", group.seeds.length));
    DATA.measures.forEach(([name], index) => {
      const values = perSeed(group.rows, FIRST + index);
      const cell = element("td", values.length ? number(mean(values), name.startsWith("ms") ? 2 : 3) : "\u2013");
      const range = name === "mean_overlap" ? interval(values) : null;
      if (range) { cell.append(document.createElement("br"), element("small", `[${number(range[0])}, ${number(range[1])}]`)); }
      line.append(cell);
      if (name === "stay") line.append(element("td", number(values.length ? (group.mean - mean(values)) / (1 - mean(values)) : null)));
    });
    body.append(line);
  }
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
      return { x: thresholds, y: sums.map((sum) => sum / frames), name: escaped(DATA.trackers[tracker]), mode: "lines",
        line: { color: colour(tracker), dash: dash(tracker), width: 2 }, frames };
    }).filter((trace) => trace.frames > 0);
    Plotly.react(id, traces, layout(x, y, { yaxis: { range: [0, 1.02] } }), CONFIG);
  }
}

// Overlaps on the frames that all levels of an axis share; grey and dotted: the first box in every frame.
function drawAxes() {
  const labels = [...new Set(DATA.axes.map(([label]) => label))];
  byId("axes-section").hidden = labels.length === 0;
  const room = byId("axes");
  room.replaceChildren();
  for (const label of labels) {
    const plot = element("div", null, { class: "plot" });
    room.append(plot);
    const traces = [], names = new Set(DATA.axes.filter(([own]) => own === label).map((row) => row[2]));
    for (const name of names) {
      const tracker = DATA.trackers.indexOf(name);
      if (tracker >= 0 && !state.trackers.has(tracker)) continue;
      const levels = new Map();
      for (const [own, x, whose, scenario, seed, overlap] of DATA.axes) {
        if (own !== label || whose !== name || overlap === null || (state.scenario >= 0 && scenario !== state.scenario)) continue;
        if (!levels.has(x)) levels.set(x, new Map());
        const seeds = levels.get(x);
        seeds.set(seed, [...(seeds.get(seed) || []), overlap]);
      }
      const points = [...levels].sort((a, b) => a[0] - b[0]).map(([x, seeds]) => {
        const values = [...seeds.values()].map(mean);
        return [x, mean(values), interval(values) || [mean(values), mean(values)]];
      });
      if (!points.length) continue;
      const x = points.map((point) => point[0]), group = `t${name}`, ink = tracker < 0 ? "#777777" : colour(tracker);
      traces.push({ x: [...x, ...[...x].reverse()], legendgroup: group, showlegend: false, hoverinfo: "skip",
        y: [...points.map((point) => point[2][1]), ...points.map((point) => point[2][0]).reverse()],
        fill: "toself", fillcolor: ink + "22", line: { width: 0 }, mode: "lines" });
      traces.push({ x, y: points.map((point) => point[1]), legendgroup: group, name: escaped(name),
        mode: "lines+markers", line: { color: ink, dash: tracker < 0 ? "dot" : dash(tracker), width: 2 } });
    }
    Plotly.newPlot(plot, traces, layout(label, "mean overlap", { yaxis: { range: [0, 1.02] } }), CONFIG);
  }
}

function unpacked(text) {
  return Float32Array.from(atob(text), (letter) => letter.charCodeAt(0) / 250);
}

function drawEpisode() {
  const episode = DATA.episodes[state.episode];
  const traces = [...state.trackers].filter((tracker) => episode.overlap[tracker]).map((tracker) => {
    const y = [...unpacked(episode.overlap[tracker])];
    return { x: y.map((_, k) => k), y, name: escaped(DATA.trackers[tracker]), mode: "lines+markers", marker: { size: 3 },
      line: { color: colour(tracker), dash: dash(tracker), width: 1.5 } };
  });
  const shapes = (episode.occluded || []).map(([first, end]) => ({ type: "rect", xref: "x", yref: "paper", x0: first - 0.5,
    x1: end - 0.5, y0: 0, y1: 1, fillcolor: "rgba(128,128,128,0.28)", line: { width: 0 }, layer: "below" }));
  shapes.push({ type: "line", xref: "x", yref: "paper", x0: 0, x1: 0, y0: 0, y1: 1, line: { width: 1.5, color: "#888", dash: "dot" } });
  Plotly.react("overlap", traces, layout("frame", "overlap", { yaxis: { range: [-0.02, 1.02] }, shapes }), CONFIG);
  const plot = byId("overlap"), video = byId("video");
  plot.removeAllListeners("plotly_click");
  plot.on("plotly_click", (event) => { video.pause(); seek(Math.round(event.points[0].x)); });
  video.hidden = !episode.video;
  byId("film-note").textContent = episode.video ? "" : DATA.drives.length ? "Every tracker drove an episode of its own: see Following."
    : "No video of this episode: run bench with --videos all.";
  if (episode.video) { video.src = episode.video.split("/").map(encodeURIComponent).join("/"); } else { video.removeAttribute("src"); }
}

// Frames per second of the video shown: as recorded, or from its length and the number of frames.
function rate() {
  const episode = DATA.episodes[state.episode];
  if (episode.rate_hz) return episode.rate_hz;
  const first = Object.values(episode.overlap)[0];
  const duration = byId("video").duration;
  return first && Number.isFinite(duration) && duration > 0 ? atob(first).length / duration : 25;
}

// Start of a frame in the video [s]. Episodes with lost frames list the times of their frames.
function startOf(frame) {
  const times = DATA.episodes[state.episode].time;
  if (!times) return frame / rate();
  return frame < times.length ? times[frame] : times[times.length - 1] + (frame - times.length + 1) / rate();
}

function frameAt(seconds) {
  const times = DATA.episodes[state.episode].time;
  if (!times) return Math.floor(seconds * rate() + 1e-6);
  let frame = 0;
  while (frame + 1 < times.length && times[frame + 1] <= seconds + 1e-6) frame += 1;
  return frame;
}

function seek(frame) {
  const video = byId("video");
  const count = atob(Object.values(DATA.episodes[state.episode].overlap)[0] || "").length;
  const wanted = Math.min(Math.max(frame, 0), Math.max(count - 1, 0));
  video.currentTime = 0.5 * (startOf(wanted) + startOf(wanted + 1)); // the middle of the frame: rounding cannot show its neighbour
  mark(wanted);
}

function mark(frame) {
  const plot = byId("overlap");
  if (!plot.layout) return;
  const last = plot.layout.shapes.length - 1;
  Plotly.relayout(plot, { [`shapes[${last}].x0`]: frame, [`shapes[${last}].x1`]: frame });
}

function keys(event) {
  const video = byId("video");
  const frame = frameAt(video.currentTime);
  if (event.key === "ArrowRight" || event.key === "ArrowLeft") {
    video.pause();
    seek(frame + (event.key === "ArrowRight" ? 1 : -1));
  } else if (event.key === " " && event.target.tagName !== "VIDEO") {
    if (video.paused) video.play(); else video.pause();
  } else return;
  event.preventDefault();
}

function drawMatrix() {
  const table = byId("matrix"), count = DATA.trackers.length;
  const cells = Array.from({ length: count }, () => Array(count).fill(null));
  for (const pair of DATA.matrix.pairs) {
    cells[pair.one][pair.other] = { ...pair, sign: 1 };
    cells[pair.other][pair.one] = { ...pair, sign: -1 };
  }
  table.replaceChildren();
  const head = element("tr");
  head.append(element("th", "row \u2212 column", { scope: "col" }));
  DATA.trackers.forEach((name) => head.append(element("th", name, { scope: "col" })));
  table.append(head);
  DATA.trackers.forEach((name, one) => {
    const line = element("tr");
    line.append(element("th", name, { scope: "row" }));
    DATA.trackers.forEach((_, other) => {
      const pair = cells[one][other];
      const cell = element("td", one === other || !pair || pair.difference === null ? "" : number(pair.sign * pair.difference));
      if (pair && DATA.matrix.wins[one][other] !== 0) cell.style.fontWeight = "700";
      if (pair && pair.difference !== null) cell.title = `p = ${number(pair.p, 4)}, ${pair.seeds} seeds`;
      line.append(cell);
    });
    table.append(line);
  });
}

function drawSpeed() {
  const column = measureAt("ms_median");
  if (column < FIRST) { byId("speed").hidden = true; return; }
  const bars = [...state.trackers].map((tracker) => {
    const values = finite(DATA.rows.filter((row) => row[0] === tracker && chosen(row)).map((row) => row[column])).sort((a, b) => a - b);
    return values.length ? [tracker, values[Math.floor(values.length / 2)]] : null;
  }).filter(Boolean);
  const names = bars.map(([tracker]) => escaped(DATA.trackers[tracker]));
  Plotly.react("speed", [{ type: "bar", orientation: "h", y: names, x: bars.map((bar) => bar[1]),
    marker: { color: bars.map(([tracker]) => colour(tracker)) }, text: bars.map((bar) => number(bar[1], 2)), textposition: "auto" }],
  layout("ms per frame", "", { xaxis: { type: "log" }, yaxis: { automargin: true } }), CONFIG);
}

function drawAll() { drawBoard(); drawCurves(); drawAxes(); drawEpisode(); drawSpeed(); }

function fill(select, names, all) {
  if (all) select.append(element("option", all, { value: -1 }));
  names.forEach((name, index) => select.append(element("option", name, { value: index })));
}

function start() {
  const seeds = new Set(DATA.episodes.map((episode) => episode.seed)).size;
  byId("extent").textContent = `${DATA.trackers.length} trackers, ${DATA.scenarios.length} scenarios, `
    + `${DATA.conditions.length} conditions, ${seeds} seeds, ${DATA.episodes.length} episodes`;
  DATA.trackers.forEach((name, index) => {
    const label = element("label"), box = element("input", null, { type: "checkbox", checked: "" });
    box.addEventListener("change", () => {
      if (box.checked) state.trackers.add(index); else state.trackers.delete(index);
      state.trackers = new Set([...state.trackers].sort((a, b) => a - b));
      drawAll();
    });
    label.append(box, document.createTextNode(" " + name));
    byId("filter-trackers").append(label);
  });
  fill(byId("filter-scenario"), DATA.scenarios, "all");
  fill(byId("filter-condition"), DATA.conditions, "all");
  byId("filter-scenario").addEventListener("change", (event) => { state.scenario = Number(event.target.value); drawAll(); });
  byId("filter-condition").addEventListener("change", (event) => { state.condition = Number(event.target.value); drawAll(); });
  fill(byId("episode"), DATA.episodes.map((episode) =>
    `${DATA.scenarios[episode.scenario]}, ${DATA.conditions[episode.condition]}, seed ${episode.seed}`));
  const filmed = DATA.episodes.findIndex((episode) => episode.video);
  state.episode = Math.max(filmed, 0);
  byId("episode").value = state.episode;
  byId("episode").addEventListener("change", (event) => { state.episode = Number(event.target.value); drawEpisode(); });
  byId("video").addEventListener("timeupdate", () => mark(frameAt(byId("video").currentTime)));
  byId("viewer").addEventListener("keydown", keys);
  byId("filters").addEventListener("submit", (event) => event.preventDefault());
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  drawAll();
  drawMatrix();
}
start();
