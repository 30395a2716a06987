"use strict";
// The losses of the target, and the episode shown frame by frame. Shares report.js's helpers.
const BEFORE_S = 1; // the video starts so long before a loss
const MOST_LOSSES = 60, MOST_ANSWERS = 6;

function unpacked(text) {
  return Float32Array.from(atob(text), (letter) => letter.charCodeAt(0) / 250);
}

function drawEpisode() {
  const episode = DATA.episodes[state.episode];
  const traces = [...state.trackers].filter((tracker) => episode.overlap[tracker]).map((tracker) => {
    const y = [...unpacked(episode.overlap[tracker])];
    return { x: y.map((_, k) => startOf(k)), y, name: escaped(DATA.trackers[tracker]), tracker, ...look(tracker) };
  });
  const shapes = (episode.occluded || []).map(([first, end]) => ({ type: "rect", xref: "x", yref: "paper", x0: startOf(first),
    x1: startOf(end), y0: 0, y1: 1, fillcolor: "rgba(128,128,128,0.28)", line: { width: 0 }, layer: "below" }));
  shapes.push({ type: "line", xref: "x", yref: "paper", x0: 0, x1: 0, y0: 0, y1: 1, line: { width: 1.5, color: "#888", dash: "dot" } });
  drawShares(byId("overlap"), traces, "time [s]", "overlap", { shapes });
  const video = byId("video");
  onClick(byId("overlap"), ({ x }) => { video.pause(); seek(frameAt(x + 1e-4)); });
  video.hidden = !episode.video;
  byId("film-note").textContent = episode.video || DATA.unit !== "seed" ? "" : "No video of this episode: the same command with --videos all films every episode into this folder.";
  show(video, episode.video && `${linked(episode.video)}#t=0.01`);
}

// Show a video, or none; one that is shown already goes on.
function show(video, source) {
  if (!source) video.removeAttribute("src"); else if (video.getAttribute("src") !== source) video.src = source;
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
  Plotly.relayout(plot, { [`shapes[${last}].x0`]: startOf(frame), [`shapes[${last}].x1`]: startOf(frame) });
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


function showEpisode(index) {
  state.episode = index;
  byId("episode").value = index;
  drawEpisode();
}

// Show a tracker's episode from a time on [s]: in the viewer, or the tracker's own drive.
function showAtTime(tracker, episode, seconds) {
  const own = DATA.drives.findIndex((one) => one.tracker === tracker && one.episode === episode);
  if (own >= 0) { showDrive(own, seconds); return; }
  showEpisode(episode);
  const { time } = DATA.episodes[episode], video = byId("video");
  const frame = time ? Math.max(time.findLastIndex((one) => one <= seconds), 0) : Math.round(seconds * rate());
  if (video.readyState >= 1) seek(frame); else { video.addEventListener("loadedmetadata", () => seek(frame), { once: true }); mark(frame); }
  byId("h-episode").closest("section").hidden = false; // a drive that is not among those of Following
  byId("h-episode").scrollIntoView();
  byId("viewer").focus({ preventScroll: true });
}

// The episode with the lowest overlap, at the tracker's first loss in it.
function showWorst(rows) {
  const known = rows.filter((row) => row[OVERLAP] !== null).sort((a, b) => a[OVERLAP] - b[OVERLAP]);
  if (!known.length) return;
  const [tracker, episode] = known[0], loss = DATA.losses.find((one) => one[0] === tracker && one[1] === episode);
  showAtTime(tracker, episode, loss ? Math.max(loss[2] - BEFORE_S, 0) : 0);
}

function percent(share) { return Number.isFinite(share) ? `${Math.round(100 * share)} %` : "\u2013"; }

// Of each tracker one sentence: how well, how often to the end, and how its losses begin.
function drawAnswers() {
  const losses = DATA.losses.filter(chosen), moments = DATA.moments.filter(chosen);
  const frames = moments.reduce((sum, row) => sum + row[2], 0), success = measureAt("follow_success");
  const usual = (tag) => moments.reduce((sum, row) => sum + row[4 + tag], 0) / frames;
  const answers = [...state.trackers].map((tracker) => {
    const rows = DATA.rows.filter((row) => row[0] === tracker && chosen(row)), own = losses.filter((loss) => loss[0] === tracker);
    const seen = moments.filter((row) => row[0] === tracker), overlaps = perSeed(rows, OVERLAP), told = [];
    const shareOf = (tag) => own.filter((loss) => has(loss, tag)).length / own.length;
    const untracked = seen.filter((row) => !row[3]).length, errors = errorsOf(rows);
    const ended = new Set([...own, ...rows.filter((row) => errorsOf([row]))].map((row) => row[1])); // by a loss or an error
    const drives = success < FIRST ? [] : finite(rows.map((row) => row[success]));
    if (drives.length) told.push(`follows to the end in ${drives.filter((one) => one > 0).length} of ${drives.length} drives`);
    if (seen.length) told.push(`holds the target in ${seen.filter((row) => row[3] && !ended.has(row[1])).length} of ${seen.length} episodes`);
    const tag = [...DATA.tags.keys()].sort((one, other) => (shareOf(other) - usual(other)) - (shareOf(one) - usual(one)))[0];
    if (own.length && shareOf(tag) > usual(tag)) told.push(`${own.length === 1 ? "its loss begins" : `${percent(shareOf(tag))} of its ${own.length} losses begin`} with: ${DATA.tags[tag][0]} (${percent(usual(tag))} of all ${frames} frames)`);
    else if (own.length) told.push(`${own.length} ${own.length === 1 ? "loss" : "losses"}`);
    if (untracked) told.push(`never tracks the target in ${untracked} of ${seen.length} episodes`);
    if (errors) told.push(`ends with an error in ${errors} of ${seen.length || rows.length} episodes`);
    return { tracker, overlap: overlaps.length ? mean(overlaps) : null, told };
  }).filter((answer) => DATA.rows.some((row) => row[0] === answer.tracker && chosen(row)));
  answers.sort((a, b) => b.overlap - a.overlap);
  const lines = answers.map(({ tracker, overlap, told }) => {
    const line = element("li");
    line.append(swatch(tracker), element("b", DATA.trackers[tracker]), element("strong", number(overlap, 2)), element("span", told.join("; ")));
    return line;
  });
  byId("answers").replaceChildren(...lines.slice(0, MOST_ANSWERS));
  byId("more-answers").replaceChildren(...lines.slice(MOST_ANSWERS));
  byId("more").hidden = lines.length <= MOST_ANSWERS;
  byId("more").firstElementChild.textContent = `${lines.length - MOST_ANSWERS} more, the last: ${answers.at(-1)?.tracker === undefined ? "" : DATA.trackers[answers.at(-1).tracker]} ${number(answers.at(-1)?.overlap)}`;
}

const has = (loss, tag) => Boolean(loss[5] & (1 << tag));

function drawLosses() {
  const losses = DATA.losses.filter(chosen), moments = DATA.moments.filter(chosen);
  const trackers = [...state.trackers].filter((tracker) => losses.some((loss) => loss[0] === tracker));
  const shareOf = (found, tag) => found.filter((loss) => has(loss, tag)).length / found.length;
  const frames = moments.reduce((sum, row) => sum + row[2], 0);
  byId("losses-body").hidden = !losses.length;
  byId("losses-none").hidden = losses.length > 0;
  const order = [...DATA.tags.keys()].filter((tag) => losses.some((loss) => has(loss, tag))).sort((a, b) => shareOf(losses, b) - shareOf(losses, a));
  byId("shares").hidden = !order.length;
  fillTable(byId("shares"), ["of the losses begin with", ...trackers.map((tracker) => `${DATA.trackers[tracker]} (${losses.filter((loss) => loss[0] === tracker).length})`), `all frames (${frames})`],
    order.map((tag) => [element("th", DATA.tags[tag][0], { scope: "row", title: DATA.tags[tag][1] }),
      ...trackers.map((tracker) => percent(shareOf(losses.filter((loss) => loss[0] === tracker), tag))),
      percent(moments.reduce((sum, row) => sum + row[4 + tag], 0) / frames)]));
  const wanted = losses.filter((loss) => state.tag < 0 || has(loss, state.tag));
  const lasting = (loss) => (loss[4] === null ? 1e6 : loss[4]) - loss[2];
  wanted.sort((a, b) => lasting(b) - lasting(a));
  byId("losses-count").textContent = `${wanted.length} of ${losses.length} losses` + (wanted.length > MOST_LOSSES ? `; the ${MOST_LOSSES} longest are shown` : "");
  fillTable(byId("losses"), ["tracker", "episode", "lost at", "tracked again", "what happened then"], wanted.slice(0, MOST_LOSSES).map((loss) => {
    const [tracker, number, at, , found] = loss, episode = DATA.episodes[number], from = Math.max(at - BEFORE_S, 0);
    const own = DATA.drives.find((one) => one.tracker === tracker && one.episode === number), video = own ? own.video : episode.video;
    const when = element("td");
    when.append(linkTo(`${at.toFixed(2)} s${video ? " \u25b6" : ""}`, "Show this moment", () => showAtTime(tracker, number, from),
      video ? `${linked(video)}#t=${from.toFixed(2)}` : undefined));
    const what = DATA.tags.filter((_, tag) => has(loss, tag)).map(([name]) => name).join(", ");
    return [trackerHead(tracker), titleOf(episode), when,
      found === null ? "never" : `after ${(found - at).toFixed(2)} s`, what || "none of these"];
  }));
}

function linked(video) { return video.split("/").map(encodeURIComponent).join("/"); }
