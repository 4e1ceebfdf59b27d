"use strict";
// The run from above: world coordinates are metres, x to the right and y down, as in the log.
const run = JSON.parse(document.getElementById("run").textContent);
const el = (id) => document.getElementById(id);
const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3]]; // trackers differ by dashes as well as by colour
const shapes = run.shapes.map((flat) => flat.map((v) => v / 100));
const view = { frame: 0, follow: "ego", scale: null, dx: 0, dy: 0, shown: new Set(), object: "" };

function fit(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const box = canvas.getBoundingClientRect();
  const width = Math.max(1, Math.round(box.width * ratio));
  const height = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, box.width, box.height);
  return [g, box.width, box.height];
}

function outline(g, to, [shape, x, y, turn]) {
  const points = shapes[shape];
  const c = Math.cos(turn / 1000), s = Math.sin(turn / 1000);
  g.beginPath();
  for (let k = 0; k < points.length; k += 2) {
    const px = x / 100 + c * points[k] - s * points[k + 1];
    const py = y / 100 + s * points[k] + c * points[k + 1];
    k ? g.lineTo(...to(px, py)) : g.moveTo(...to(px, py));
  }
  g.stroke();
}

function polyline(g, to, flat) {
  g.beginPath();
  for (let k = 0; k < flat.length; k += 2) {
    k ? g.lineTo(...to(flat[k] / 100, flat[k + 1] / 100)) : g.moveTo(...to(flat[k] / 100, flat[k + 1] / 100));
  }
  g.stroke();
}

// One mark for each kind of detections, so that they differ by form too.
function mark(g, kind, x, y, r) {
  g.beginPath();
  if (kind === 0) g.arc(x, y, r, 0, 7);
  else if (kind === 1) { g.arc(x, y, r, 0, 7); g.stroke(); return; }
  else if (kind === 2) { g.moveTo(x - r, y - r); g.lineTo(x + r, y + r); g.moveTo(x - r, y + r); g.lineTo(x + r, y - r); g.stroke(); return; }
  else if (kind === 3) g.rect(x - r, y - r, 2 * r, 2 * r);
  else if (kind === 4) { g.moveTo(x, y - 1.4 * r); g.lineTo(x + 1.3 * r, y + r); g.lineTo(x - 1.3 * r, y + r); g.closePath(); }
  else { g.moveTo(x, y - 1.5 * r); g.lineTo(x + 1.5 * r, y); g.lineTo(x, y + 1.5 * r); g.lineTo(x - 1.5 * r, y); g.closePath(); }
  g.fill();
}

function middle() {
  const k = view.frame, ego = run.ego[k] || [0, 0, 0, 0];
  const found = (run.truth[k] || []).find((body) => "veh" + body[0] === view.follow);
  return found ? [found[3] / 100, found[4] / 100] : [ego[1] / 100, ego[2] / 100];
}

function bounds() {
  let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
  const take = (x, y) => { x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y); };
  run.truth.forEach((bodies) => bodies.forEach((b) => take(b[3] / 100, b[4] / 100)));
  run.ego.forEach((e) => take(e[1] / 100, e[2] / 100));
  return [x0 - 8, x1 + 8, y0 - 8, y1 + 8];
}

function drawScene() {
  if (!run.ego.length) return; // numbers only
  const [g, width, height] = fit(el("scene"));
  if (view.scale === null) view.scale = width / (width < 600 ? 75 : 130); // metres across
  const [mx, my] = middle(), scale = view.scale;
  const to = (x, y) => [width * (view.follow === "all" ? 0.5 : 0.42) + (x - mx) * scale + view.dx, height / 2 + (y - my) * scale + view.dy];
  drawRoad(g, to, scale);
  const shown = (name) => view.shown.has(name), k = view.frame;
  if (shown("rings")) drawRings(g, to, scale);
  run.trackers.forEach((tracker, i) => { if (shown("tracker" + i)) drawTracks(g, to, tracker, i, k); });
  if (shown("truth")) drawTruth(g, to, k); // thin, on top: where both agree both stay visible
  run.kinds.forEach((kind, i) => {
    if (!shown("kind" + i)) return;
    g.fillStyle = g.strokeStyle = kind.color;
    g.lineWidth = 1.2;
    const flat = run.detections[k][i], r = Math.max(1.6, Math.min(3.2, 0.16 * scale));
    for (let j = 0; j < flat.length; j += 2) mark(g, i, ...to(flat[j] / 100, flat[j + 1] / 100), r);
  });
  if (shown("truth")) drawNames(g, to, k);
}

function drawRoad(g, to, scale) {
  g.strokeStyle = "#24262d";
  g.lineCap = "butt";
  run.road.surface.forEach((line, i) => { g.lineWidth = 2 * run.road.half[i] / 100 * scale; polyline(g, to, line); });
  g.strokeStyle = "#77777c"; g.lineWidth = 1;
  run.road.lanes.forEach((line) => polyline(g, to, line));
  g.strokeStyle = "#b4b4b8"; g.lineWidth = 1.3;
  run.road.edges.forEach((line) => polyline(g, to, line));
}

function drawRings(g, to, scale) {
  const ego = run.ego[view.frame];
  g.strokeStyle = "#4c5464"; g.fillStyle = "#8d95a6"; g.lineWidth = 1; g.font = "11px system-ui, sans-serif";
  for (const r of run.rings) {
    const [x, y] = to(ego[1] / 100, ego[2] / 100);
    g.beginPath(); g.arc(x, y, r * scale, 0, 7); g.stroke();
    g.fillText(r + " m", x + r * scale + 3, y - 3);
  }
}

function drawTruth(g, to, k) {
  g.strokeStyle = "#ffffff"; g.lineWidth = 2.2;
  outline(g, to, run.ego[k]);
  g.lineWidth = 1.4; g.strokeStyle = "#d6d8e0";
  for (const [, visible, ...where] of run.truth[k]) {
    g.globalAlpha = 0.25 + 0.75 * visible / 100; // the dimmer the less of it can be seen
    outline(g, to, where);
  }
  g.globalAlpha = 1;
}

function drawNames(g, to, k) {
  g.font = "11px system-ui, sans-serif"; g.fillStyle = "#e8e9ee"; g.textAlign = "center";
  const named = new Set();
  for (const [key, visible, , x, y] of run.truth[k]) {
    if (named.has(key)) continue;
    named.add(key);
    g.globalAlpha = 0.45 + 0.55 * visible / 100;
    const [sx, sy] = to(x / 100, y / 100);
    g.fillText(run.names[key] || "veh " + key, sx, sy - Math.max(9, 1.7 * view.scale));
    if ("veh" + key === view.follow || String(key) === view.object) {
      g.strokeStyle = "#ffd34d"; g.lineWidth = 1.5;
      g.beginPath(); g.arc(sx, sy, Math.max(14, 4 * view.scale), 0, 7); g.stroke();
    }
  }
  g.globalAlpha = 1; g.textAlign = "left";
}

function drawTracks(g, to, tracker, i, k) {
  g.strokeStyle = g.fillStyle = tracker.color; g.lineWidth = 2; g.setLineDash(DASHES[i % DASHES.length]);
  g.font = "bold 12px system-ui, sans-serif";
  for (const [id, ...where] of tracker.tracks[k]) {
    outline(g, to, where);
    const [x, y] = to(where[1] / 100, where[2] / 100);
    g.fillText(id, x + 3 + 20 * i, y + Math.max(11, 1.6 * view.scale) + 8);
  }
  g.setLineDash([]);
}
