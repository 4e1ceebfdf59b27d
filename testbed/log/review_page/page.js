// Controls, lists, curves and tables.
const last = run.time.length - 1;
const state = { timer: null, started: 0, from: 0, sort: "severity", down: true };
const COLUMNS = [
  ["object", "object", 0], ["tracker", "tracker", 0], ["severity", "severity [m\u00b2 s]", 1], ["seen", "in view [s]", 1],
  ["birth_delay", "birth delay [s]", 2], ["missed", "no track [s]", 1], ["lost", "lost", 0], ["switches", "switches", 0],
  ["gwd", "GWD [m]", 2], ["rmse_position", "position [m]", 2], ["rmse_velocity", "velocity [m/s]", 2],
  ["rmse_heading_deg", "heading [deg]", 1], ["rmse_length", "length [m]", 2], ["rmse_width", "width [m]", 2],
];

function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    key.startsWith("on") ? node.addEventListener(key.slice(2), value) : node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}

function go(frame) {
  view.frame = Math.max(0, Math.min(last, frame));
  const time = run.time[view.frame];
  el("time").value = view.frame;
  el("clock").textContent = time.toFixed(2) + " / " + run.time[last].toFixed(1) + " s";
  el("action").textContent = run.action[view.frame] ? "ego: " + run.action[view.frame] : "";
  el("scene").setAttribute("aria-label", "Bird's-eye view at " + time.toFixed(2) + " s");
  drawScene();
  drawCharts();
  for (const node of document.querySelectorAll("[data-start]")) {
    node.classList.toggle("now", time >= +node.dataset.start - 0.04 && time <= +node.dataset.end + 0.04);
  }
}

function frameAt(time) {
  let k = run.time.findIndex((t) => t >= time - 1e-6);
  return k < 0 ? last : k;
}

function play(on) {
  cancelAnimationFrame(state.timer);
  state.timer = null;
  el("play").textContent = on ? "\u23f8" : "\u25b6";
  el("play").setAttribute("aria-label", on ? "Pause" : "Play");
  if (!on) return;
  if (view.frame === last) go(0);
  state.started = performance.now();
  state.from = run.time[view.frame];
  const tick = (now) => {
    const time = state.from + (now - state.started) / 1000 * +el("speed").value;
    const frame = time >= run.time[last] ? last : frameAt(time);
    if (frame !== view.frame) go(frame);
    frame === last ? play(false) : (state.timer = requestAnimationFrame(tick));
  };
  state.timer = requestAnimationFrame(tick);
}

function look(object) { // at an object: follow it, and show its curves
  const key = object in run.names ? String(object) : "";
  view.object = key;
  el("whose").value = key;
  el("follow").value = view.follow = key && run.truth.some((f) => f.some((b) => String(b[0]) === key)) ? "veh" + key : "ego";
  view.dx = view.dy = 0;
}

function jump(time, object) { play(false); look(object); go(frameAt(time)); el("scene").scrollIntoView({ block: "nearest" }); }

function fillMoments() {
  for (const m of run.moments) {
    const who = m.object === null ? "track " + m.track : run.names[m.object] || "veh " + m.object;
    const head = make("span", { class: "who" }, make("b", {}, m.time.toFixed(1) + " s  " + who), make("span", { class: "severity" }, m.severity.toFixed(1)));
    const tracker = run.trackers.length > 1 ? " (" + m.tracker + ")" : "";
    el("moments").append(make("li", {}, make("button", {
      "data-start": m.start, "data-end": m.end, onclick: () => jump(m.time, m.object),
    }, head, m.what + ": " + m.text + tracker, make("span", { class: "why" }, m.why))));
  }
  if (!run.moments.length) el("moments").append(make("li", {}, run.no_moments));
}

function fillLayers() {
  const scene = run.ego.length > 0;
  const add = (key, text, draw, on = true) => {
    const box = make("input", { type: "checkbox", onchange: () => { box.checked ? view.shown.add(key) : view.shown.delete(key); drawScene(); } });
    box.checked = on;
    if (on) view.shown.add(key);
    const sample = make("canvas", { width: 60, height: 36, "aria-hidden": "true" });
    const g = sample.getContext("2d");
    g.scale(2, 2);
    draw(g);
    el("layers").append(make("label", {}, ...(scene ? [box] : []), sample, text));
  };
  const line = (color, dash, width) => (g) => { g.strokeStyle = color; g.lineWidth = width; g.setLineDash(dash); g.strokeRect(3, 4, 24, 10); };
  if (scene) add("truth", "truth: vehicles with their names, dimmed where hidden from the radars; the ego in white", line("#d6d8e0", [], 1.4));
  run.trackers.forEach((t, i) => add("tracker" + i, scene ? "tracks of " + t.name + " with their ids" : t.name, line(t.color, DASHES[i % DASHES.length], 2)));
  if (!scene) return;
  run.kinds.forEach((kind, i) => add("kind" + i, kind.note, (g) => { g.fillStyle = g.strokeStyle = kind.color; g.lineWidth = 1.2; mark(g, i, 9, 9, 3.4); mark(g, i, 21, 9, 3.4); }));
  add("rings", "distance from the ego", (g) => { g.strokeStyle = "#8d95a6"; g.beginPath(); g.arc(2, 9, 18, -0.5, 0.5); g.stroke(); });
}

function curvesOf(tracker) { return view.object === "" ? tracker.means : tracker.of[view.object] || {}; }

function drawCharts() {
  for (const { key, title } of run.curves) {
    const figure = el("curve-" + key);
    const lines = run.trackers.map((t) => curvesOf(t)[key]);
    const values = lines.flatMap((line) => line || []).filter((v) => v !== null);
    figure.hidden = !values.length;
    const low = Math.min(0, ...values), high = Math.max(0, ...values);
    if (values.length) drawChart(figure.querySelector("canvas"), lines, low, high > low ? high : 1, title);
  }
}

function drawChart(canvas, lines, low, high, title) {
  const [g, width, height] = fit(canvas);
  const t0 = run.time[0], t1 = Math.max(run.time[last], t0 + 1e-9);
  const x = (t) => 34 + (t - t0) / (t1 - t0) * (width - 40), y = (v) => height - 16 - (v - low) / (high - low) * (height - 26);
  g.font = "11px system-ui, sans-serif"; g.fillStyle = "#a9adb8"; g.strokeStyle = "#333843"; g.lineWidth = 1;
  for (const v of low < 0 ? [0, low, high] : [0, high]) {
    g.beginPath(); g.moveTo(34, y(v)); g.lineTo(width - 6, y(v)); g.stroke();
    if (v && Math.abs(y(v) - y(0)) < 12) continue;
    g.textAlign = "right"; g.fillText(Math.abs(v) >= 100 ? v.toFixed(0) : v.toPrecision(2), 30, y(v) + 4);
  }
  g.textAlign = "center";
  const every = [0.5, 1, 2, 5, 10, 20, 50, 100].find((s) => (t1 - t0) / s <= 6) || 200;
  for (let t = Math.ceil(t0 / every) * every; t <= t1; t += every) {
    const room = width - g.measureText(t + " s").width / 2 - 1;  // the last label ends where the picture does
    g.fillText(t + " s", Math.min(x(t), room), height - 3);
  }
  lines.forEach((line, i) => {
    if (!line) return;
    g.strokeStyle = run.trackers[i].color; g.lineWidth = 1.5; g.setLineDash(DASHES[i % DASHES.length]);
    g.beginPath();
    let pen = false;
    line.forEach((v, k) => { if (v === null) pen = false; else { pen ? g.lineTo(x(run.time[k]), y(v)) : g.moveTo(x(run.time[k]), y(v)); pen = true; } });
    g.stroke();
    g.setLineDash([]);
  });
  g.strokeStyle = "#ffd34d"; g.lineWidth = 1;
  g.beginPath(); g.moveTo(x(run.time[view.frame]), 2); g.lineTo(x(run.time[view.frame]), height - 14); g.stroke();
  const now = lines.map((line) => line && line[view.frame] !== null ? line[view.frame].toFixed(2) : "\u2013").join(" | ");
  canvas.setAttribute("aria-label", title + " now: " + now);
  canvas.parentElement.querySelector("output").textContent = now;
}

function fillCharts() {
  for (const { key, title } of run.curves) {
    const canvas = make("canvas", { role: "img", onclick: (e) => {
      const box = canvas.getBoundingClientRect();
      go(frameAt(run.time[0] + (e.clientX - box.left - 34) / (box.width - 40) * (run.time[last] - run.time[0])));
    } });
    el("charts").append(make("figure", { id: "curve-" + key }, make("figcaption", {}, title + ": ", make("output")), canvas));
  }
  el("whose").append(make("option", { value: "" }, "all objects, mean"));
  for (const [key, name] of Object.entries(run.names)) {
    el("whose").append(make("option", { value: key }, name));
    el("follow").append(make("option", { value: "veh" + key }, name));
  }
}

function fillEvents() {
  for (const [time, level, text] of run.events) {
    const object = /veh_(\d+)/.exec(text);
    el("events").append(make("li", {}, make("button", { class: level, onclick: () => jump(time, object ? +object[1] : null) },
      time.toFixed(2) + " s  " + (level === "INFO" ? "" : level.toLowerCase() + ": ") + text)));
  }
}

function cell(row, key) {
  const scan = (run.time[last] - run.time[0]) / Math.max(last, 1);
  if (key === "seen") return row.scans_counted * scan;
  if (key === "missed") return row.scans_missed * scan;
  return row[key];
}

function fillObjects() {
  const order = (a, b) => {
    const [x, y] = [cell(a, state.sort), cell(b, state.sort)];
    const missing = (x === null) - (y === null);
    const sign = state.down ? -1 : 1;
    return missing || (typeof x === "string" ? sign * x.localeCompare(y) : sign * (x - y));
  };
  el("objects").tHead.replaceChildren(make("tr", {}, ...COLUMNS.map(([key, title]) => {
    const sorted = key === state.sort;
    const press = () => { state.down = sorted ? !state.down : true; state.sort = key; fillObjects(); };
    return make("th", { scope: "col", "aria-sort": sorted ? (state.down ? "descending" : "ascending") : "none" },
      make("button", { onclick: press }, title + (sorted ? (state.down ? " \u25bc" : " \u25b2") : "")));
  })));
  el("objects").tBodies[0].replaceChildren(...[...run.objects].sort(order).map((row) => make("tr", {
    onclick: () => { look(row.object); go(view.frame); },
  }, ...COLUMNS.map(([key, , digits]) => {
    const value = cell(row, key);
    const text = key === "object" ? run.names[value] || "veh " + value : typeof value === "string" ? value : value === null ? "\u2013" : value.toFixed(digits);
    return make("td", {}, text);
  }))));
}

function zoom(factor) { if (view.scale) { view.scale = Math.min(80, Math.max(0.3, view.scale * factor)); view.dx *= factor; view.dy *= factor; drawScene(); } }

function showAll() {
  const [x0, x1, y0, y1] = bounds(), box = el("scene").getBoundingClientRect();
  view.scale = Math.min(box.width / (x1 - x0), box.height / (y1 - y0));
  const [mx, my] = middle();
  view.dx = (mx - (x0 + x1) / 2) * view.scale + 0.08 * box.width;
  view.dy = (my - (y0 + y1) / 2) * view.scale;
  drawScene();
}

function listen() {
  el("time").max = last;
  el("time").addEventListener("input", (e) => { play(false); go(+e.target.value); });
  el("play").addEventListener("click", () => play(state.timer === null));
  el("back").addEventListener("click", () => { play(false); go(view.frame - 1); });
  el("next").addEventListener("click", () => { play(false); go(view.frame + 1); });
  el("closer").addEventListener("click", () => zoom(1.3));
  el("farther").addEventListener("click", () => zoom(1 / 1.3));
  el("all").addEventListener("click", showAll);
  el("speed").addEventListener("change", () => play(state.timer !== null));
  el("follow").addEventListener("change", (e) => { view.follow = e.target.value; view.dx = view.dy = 0; drawScene(); });
  el("whose").addEventListener("change", (e) => { view.object = e.target.value; go(view.frame); });
  el("scene").addEventListener("wheel", (e) => { e.preventDefault(); zoom(e.deltaY < 0 ? 1.15 : 1 / 1.15); }, { passive: false });
  el("scene").addEventListener("pointermove", (e) => { if (e.buttons) { view.dx += e.movementX; view.dy += e.movementY; drawScene(); } });
  window.addEventListener("resize", () => go(view.frame));
  window.addEventListener("keydown", (e) => {
    if (e.target.tagName === "SELECT" || e.ctrlKey || e.metaKey || e.altKey) return;
    const second = Math.max(1, Math.round(last / Math.max(run.time[last] - run.time[0], 1e-9)));
    const to = { ArrowLeft: view.frame - (e.shiftKey ? second : 1), ArrowRight: view.frame + (e.shiftKey ? second : 1), Home: 0, End: last }[e.key];
    if (to !== undefined) { e.preventDefault(); play(false); go(to); }
    else if (e.key === " " && !["BUTTON", "INPUT"].includes(e.target.tagName)) { e.preventDefault(); play(state.timer === null); }
  });
}

el("about").textContent = "radar " + run.run.radar + ", planner " + run.run.planner + ", " + run.trackers.map((t) => t.name).join(" and ") + "; log " + run.run.log;
document.body.classList.toggle("numbers", !run.ego.length);
fillLayers();
fillMoments();
fillCharts();
fillEvents();
fillObjects();
document.querySelector(".objects").hidden = !run.objects.length;
document.querySelector(".moments .note").hidden = !run.moments.length;
document.querySelector(".curves").hidden = run.trackers.every((t) => Object.values(t.means).flat().every((v) => v === null));
listen();
const asked = new URLSearchParams(location.hash.slice(1)); // #t=9&veh=3 opens the page there
if (asked.has("veh")) look(+asked.get("veh"));

go(asked.has("t") ? frameAt(+asked.get("t")) : 0);
document.body.dataset.ready = "yes";
