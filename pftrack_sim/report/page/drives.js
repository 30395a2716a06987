"use strict";
// Closed loop: the way from above, distance and bearing, beside the drive's own video. Shares report.js's helpers.
const DRIVES = DATA.drives;
const drive = { index: 0 };
const VIEW_M = 4;

// The last sample that is not later than a time.
function sampleAt(one, seconds) {
  let low = 0, high = one.time.length - 1;
  while (low < high) { const middle = Math.ceil((low + high) / 2); if (one.time[middle] <= seconds + 1e-6) low = middle; else high = middle - 1; }
  return low;
}

function cone(one, k) {
  const [x, y] = [one.robot[0][k], one.robot[1][k]];
  const edge = (side) => [x + VIEW_M * Math.cos(one.gaze[k] + side * one.half_fov), y + VIEW_M * Math.sin(one.gaze[k] + side * one.half_fov)];
  const [left, right] = [edge(1), edge(-1)];
  return { x: [x, left[0], right[0], x], y: [y, left[1], right[1], y] };
}

function cursor(seconds) {
  return { type: "line", xref: "x", yref: "paper", x0: seconds, x1: seconds, y0: 0, y1: 1, line: { width: 1.5, color: "#888", dash: "dot" } };
}

const end = ([x, y], text) => ({ x: x.at(-1), y: y.at(-1), text, showarrow: false, yshift: 14 });
const level = (y, dash) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, line: { width: 1, color: "#888", dash }, layer: "below" });
const said = (y, text) => ({ xref: "paper", x: 1.01, y, xanchor: "left", text, font: { size: 11 }, showarrow: false });

function drawDrive() {
  const one = DRIVES[drive.index], ink = colour(one.tracker);
  const line = (points, name, style) => ({ x: points[0], y: points[1], name, mode: "lines", line: style, hoverinfo: "name" });
  const dot = (name, look) => ({ x: [0], y: [0], name, mode: "markers", marker: look, showlegend: false });
  Plotly.react("drive-map", [
    { x: [0], y: [0], mode: "lines", fill: "toself", fillcolor: ink + "22", line: { color: ink, width: 1 }, hoverinfo: "skip" },
    line(one.robot, "robot", { color: ink, width: 2 }),
    line(one.target, "target", { color: DATA.neutral, width: 2, dash: "dash" }),
    dot("robot now", { color: ink, size: 11, symbol: "square" }),
    dot("target now", { color: DATA.neutral, size: 10 }),
    { x: one.lost.map((loss) => loss.x), y: one.lost.map((loss) => loss.y), text: one.lost.map((loss) => escaped(loss.why)),
      name: "lost here", mode: "markers", marker: { symbol: "x", size: 12, color: "#D1242F" }, hoverinfo: "text" },
  ], layout("x [m]", "y [m]", { yaxis: { scaleanchor: "x" }, annotations: [end(one.robot, "robot"), end(one.target, "target")] }), CONFIG);
  const { distance_m: wanted, distance_limit_m: off, bearing_limit_deg: aside } = one;
  for (const [id, values, label, wish, limits] of [["drive-distance", one.distance, "distance [m]", wanted, [wanted - off, wanted + off].filter((limit) => limit > 0)],
    ["drive-bearing", one.bearing, "bearing [\u00b0]", 0, [-aside, aside]]]) {
    const last = one.after[one.after.length - 1];
    const shapes = one.lost.map((loss) => ({ type: "rect", xref: "x", yref: "paper", x0: loss.since, x1: loss.until === null ? last : loss.until,
      y0: 0, y1: 1, fillcolor: "rgba(209,36,47,0.18)", line: { width: 0 }, layer: "below" }));
    Plotly.react(id, [{ x: one.after, y: values, mode: "lines", line: { color: ink, width: 2 }, showlegend: false }],
      layout("time [s]", label, { shapes: [...shapes, level(wish, "dot"), ...limits.map((limit) => level(limit, "dash")), cursor(0)], margin: { r: 52 },
        annotations: [said(wish, "wanted"), ...limits.map((limit) => said(limit, "limit"))] }), CONFIG);
    onClick(byId(id), ({ x }) => goTo(x));
  }
  const told = byId("drive-told");
  told.replaceChildren(element("li", one.ending), ...one.lost.map((loss) => element("li", loss.why)));
  const video = byId("drive-video"), slider = byId("drive-time");
  video.hidden = !one.video;
  show(video, one.video && linked(one.video));
  slider.max = one.time[one.time.length - 1];
  showAt(0);
}

function showAt(seconds) {
  const one = DRIVES[drive.index], k = sampleAt(one, seconds), view = cone(one, k);
  byId("drive-time").value = seconds;
  byId("drive-clock").textContent = `${seconds.toFixed(1)} s`;
  Plotly.restyle("drive-map", { x: [view.x, [one.robot[0][k]], [one.target[0][k]]], y: [view.y, [one.robot[1][k]], [one.target[1][k]]] }, [0, 3, 4]);
  for (const id of ["drive-distance", "drive-bearing"]) {
    const last = (byId(id).layout?.shapes.length ?? 0) - 1;
    Plotly.relayout(id, { [`shapes[${last}].x0`]: seconds, [`shapes[${last}].x1`]: seconds });
  }
}

function goTo(seconds) {
  const one = DRIVES[drive.index], video = byId("drive-video");
  video.pause();
  if (one.video) video.currentTime = seconds + 0.5 / one.rate_hz;
  showAt(seconds);
}

function showDrive(index, seconds) {
  drive.index = index;
  byId("drive").value = index;
  drawDrive();
  const video = byId("drive-video");
  if (DRIVES[index].video && video.readyState < 1) video.addEventListener("loadedmetadata", () => goTo(seconds), { once: true });
  goTo(seconds);
  byId("h-drives").scrollIntoView();
}

start();
if (DRIVES.length) {
  fill(byId("drive"), DRIVES.map((one) => one.name));
  byId("drive").addEventListener("change", (event) => { drive.index = Number(event.target.value); drawDrive(); });
  byId("drive-time").addEventListener("input", (event) => goTo(Number(event.target.value)));
  byId("drive-video").addEventListener("timeupdate", () => showAt(byId("drive-video").currentTime));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawDrive);
  drawDrive();
}
