"use strict";
const scene = JSON.parse(document.getElementById("scene").textContent);
const at = id => document.getElementById(id);
const map = at("map"), image = at("image"), strips = at("strips"), slider = at("time"), play = at("play");
const frames = scene.frames, pictures = scene.pictures || [], STAY = scene.timed ? 10 : 3;
let now = 0, running = false, zoom = 1, middle = null, loaded = {};

const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

// Index of the last time that is not later; -1 where all are.
function last(times, t) {
  let low = 0, high = times.length;
  while (low < high) { const half = (low + high) >> 1; if (times[half] <= t) low = half + 1; else high = half; }
  return low - 1;
}

// A place (north, east) on a way at a time, on a straight line between two of its own; null where nothing is known.
function place(way, t) {
  if (way.still) return way.p[0][0] === null ? null : way.p[0];
  const i = last(way.t, t), next = i + 1;
  if (i < 0 || way.p[i][0] === null) return null;
  if (next >= way.t.length || way.t[next] - way.t[i] > way.gap || way.p[next][0] === null)
    return t > way.t[i] + STAY ? null : way.p[i];
  const share = (t - way.t[i]) / (way.t[next] - way.t[i] || 1);
  return [0, 1].map(k => way.p[i][k] + share * (way.p[next][k] - way.p[i][k]));
}

// A canvas as sharp as the screen, empty, in units of the page.
function begin(canvas) {
  const ratio = devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, w, h);
  ctx.font = "13px system-ui, sans-serif";
  ctx.lineJoin = "round";
  return [ctx, w, h];
}

// Pixels of the map for each metre, and where a place lies on it.
function view(w, h) {
  const [south, west, north, east] = scene.extent, room = 60;  // for the buttons, and the bar below
  const whole = Math.min(Math.max(w - room, 1) / Math.max(east - west, 1), Math.max(h - 2 * room, 1) / Math.max(north - south, 1));
  const scale = whole * zoom, centre = middle || [(south + north) / 2, (west + east) / 2];
  return [scale, p => [w / 2 + (p[1] - centre[1]) * scale, h / 2 - (p[0] - centre[0]) * scale], centre];
}

// Places up to a row, its own or those that a function gives for a row, with a break where nothing is known.
function pieces(way, end, at = i => way.p[i]) {
  const found = [];
  for (let i = 0; i <= end; i++) {
    if (i && way.t[i] - way.t[i - 1] > way.gap) found.push([null]);
    found.push(at(i));
  }
  return found;
}

function line(ctx, to, places, stroke, width, alpha) {
  ctx.beginPath();
  let open = false;
  for (const p of places) {
    if (p[0] === null) { open = false; continue; }
    const [x, y] = to(p);
    if (open) ctx.lineTo(x, y); else ctx.moveTo(x, y);
    open = true;
  }
  ctx.globalAlpha = alpha; ctx.strokeStyle = stroke; ctx.lineWidth = width; ctx.stroke(); ctx.globalAlpha = 1;
}

function dot(ctx, to, p, fill, radius) {
  if (p[0] === null) return;
  const [x, y] = to(p);
  ctx.beginPath(); ctx.arc(x, y, radius, 0, 2 * Math.PI); ctx.fillStyle = fill; ctx.fill();
}

function ellipse(ctx, to, scale, p, axes, stroke) {
  if (axes[0] === null || p[0] === null) return;
  const [x, y] = to(p);
  ctx.beginPath(); ctx.ellipse(x, y, axes[0] * scale, axes[1] * scale, axes[2], 0, 2 * Math.PI);
  ctx.strokeStyle = stroke; ctx.lineWidth = 1.3; ctx.stroke();
}

function drawMap() {
  const [ctx, w, h] = begin(map), [scale, to] = view(w, h), ink = colour("ink");
  if (scene.ground && loaded.ground) {
    const [south, west, north, east] = scene.ground.extent, [x, y] = to([north, west]), [right, low] = to([south, east]);
    ctx.globalAlpha = .7; ctx.drawImage(loaded.ground, x, y, right - x, low - y); ctx.globalAlpha = 1;
  }
  if (scene.path) line(ctx, to, pieces(scene.path, scene.path.t.length - 1), colour("flown"), 1.2, .5);
  for (const one of scene.truth) if (!one.still) line(ctx, to, pieces(one, one.t.length - 1), ink, 1, .45);
  if (frames) {
    const i = last(frames.t, now), ring = i < 0 || now > frames.t[i] + STAY ? [[null]] : frames.outlines[i];
    if (ring[0][0] !== null) line(ctx, to, [...ring, ring[0]], colour("seen"), 2, 1);
  }
  if (scene.points) {
    const fill = colour("points"), end = last(scene.points.t, now);
    ctx.fillStyle = fill; ctx.globalAlpha = .6;
    for (let i = 0; i <= end; i++) { const [x, y] = to(scene.points.p[i]); ctx.fillRect(x - 1.5, y - 1.5, 3, 3); }
    ctx.globalAlpha = 1;
    for (let i = end; i >= 0 && scene.points.t[i] > now - STAY; i--) {
      ctx.globalAlpha = (1 - (now - scene.points.t[i]) / STAY) ** 2;
      ellipse(ctx, to, scale, scene.points.p[i], scene.points.ellipses[i], fill);
    }
    ctx.globalAlpha = 1;
  }
  for (const one of shownTracks()) {
    const i = last(one.t, now);
    if (i < 0) continue;
    line(ctx, to, pieces(one, i), one.colour, 1.2, .6);
    if (now > one.t[i] + STAY) continue;
    dot(ctx, to, one.p[i], one.colour, 4);
    ellipse(ctx, to, scale, one.p[i], one.ellipses[i], one.colour);
  }
  const craft = scene.path && place(scene.path, now);
  if (craft) dot(ctx, to, craft, colour("flown"), 6);
  ctx.textAlign = "left";
  for (const one of scene.truth) {
    const p = place(one, now);
    if (!p) continue;
    dot(ctx, to, p, ink, 3.5);
    if (scene.truth.length <= 12) { const [x, y] = to(p); ctx.fillText(one.name, x + 7, y - 6); }
  }
  // Metres, by a bar of a round length, and where north is.
  const metres = [1, 2, 5].flatMap(k => [...Array(7).keys()].map(n => k * 10 ** (n - 1)))
    .sort((a, b) => a - b).filter(m => m * scale <= w / 4).pop() || .1;
  ctx.strokeStyle = ink; ctx.fillStyle = ink; ctx.lineWidth = 2;
  ctx.beginPath(); ctx.moveTo(14, h - 14); ctx.lineTo(14 + metres * scale, h - 14); ctx.stroke();
  ctx.fillText(metres + " m", 14, h - 20);
  ctx.textAlign = "center"; ctx.fillText("N", w - 18, 34);
  ctx.beginPath(); ctx.moveTo(w - 18, 8); ctx.lineTo(w - 23, 21); ctx.lineTo(w - 13, 21); ctx.fill();
}

// The latest frame: of those with a picture, where there are pictures.
function shownFrame() {
  if (!pictures.length) return last(frames.t, now);
  const i = last(pictures.map(one => frames.t[one[0]]), now);
  return i < 0 ? last(frames.t, now) : pictures[i][0];
}

function drawImage() {
  if (!frames || !scene.size || !(scene.seen || pictures.length)) return;
  const frame = shownFrame(), [width, height] = scene.size;
  image.style.height = image.clientWidth * height / width + "px";
  const [ctx, w, h] = begin(image), picture = loaded[frame];
  if (picture) ctx.drawImage(picture, 0, 0, w, h);
  if (frame < 0) { at("when").textContent = "No image yet"; return; }
  ctx.strokeStyle = ctx.fillStyle = picture ? "#ffb000" : colour("points"); ctx.lineWidth = 2; ctx.textAlign = "left";
  (scene.seen ? scene.seen.frame : []).forEach((one, k) => {
    if (one !== frame) return;
    const x = (scene.seen.uv[k][0] + .5) / width * w, y = (scene.seen.uv[k][1] + .5) / height * h;
    ctx.beginPath(); ctx.arc(x, y, 9, 0, 2 * Math.PI); ctx.stroke();
    ctx.fillText(scene.seen.names[k], x + 12, y - 6);
  });
  at("when").textContent = (picture ? "Image" : "Image, its picture not here") + ", " + told(frames.t[frame]);
}

const told = t => !scene.timed ? "image " + Math.round(t)
  : Math.floor(t / 60) + ":" + String(Math.floor(t % 60)).padStart(2, "0") + " min";

// All tracks, or those of the target and by the filter that were chosen.
const choices = ["target", "filter"].map(key => [key, at(key)]);
const shownTracks = () => scene.tracks.filter(one => choices.every(([key, box]) => !box.value || box.value === one[key]));

// Of each strip its name, the series in it, whether its scale is logarithmic, and a band.
function rows() {
  const judged = scene.tracks.length ? shownTracks() : scene.points ? [{...scene.points, colour: colour("points"), dots: true}] : [];
  const found = [["Error (m)", judged.map(one => [one, one.error]), true, null],
                 ["NEES, dashed: 95 %", judged.map(one => [one, one.nees]), true, scene.band]];
  if (scene.path) found.push(["Height above ground (m)", [[{...scene.path, colour: colour("flown")}, scene.path.height]], false, null]);
  return found.filter(row => row[1].some(([, values]) => values.some(v => v !== null)));
}

function drawStrips() {
  const all = rows(), each = 150, left = 44;
  strips.style.height = all.length * each + 18 + "px";
  const [ctx, w, h] = begin(strips);
  const x = t => left + t / (scene.length || 1) * (w - left - 8);
  strips.hidden = !all.length;
  all.forEach(([label, series, log, band], k) => {
    const known = series.flatMap(([, values]) => values.filter(v => v !== null)).concat(band || []);
    const most = known.reduce((a, b) => Math.max(a, b), log ? .1 : 0), least = known.reduce((a, b) => Math.min(a, b), most);
    const ends = log ? [Math.floor(Math.log10(Math.max(least, most / 1e4, 1e-3))), Math.ceil(Math.log10(most))] : [Math.min(least, 0), most * 1.05 || 1];
    const low = (k + 1) * each - 4, room = each - 26;
    const y = v => low - (Math.max(log ? Math.log10(Math.max(v, 1e-9)) : v, ends[0]) - ends[0]) / (ends[1] - ends[0] || 1) * room;
    const marks = log ? [...Array(ends[1] - ends[0] + 1).keys()].map(n => 10 ** (ends[0] + n)) : [ends[0], most];
    ctx.textAlign = "right"; ctx.lineWidth = 1;
    marks.forEach((v, n) => {
      ctx.strokeStyle = colour("line"); ctx.beginPath(); ctx.moveTo(left, y(v)); ctx.lineTo(w - 8, y(v)); ctx.stroke();
      ctx.fillStyle = colour("dim"); if (n === 0 || n === marks.length - 1) ctx.fillText(+v.toPrecision(3), left - 5, y(v) + 4);
    });
    ctx.setLineDash([5, 4]); ctx.strokeStyle = colour("dim");
    for (const v of band || []) { ctx.beginPath(); ctx.moveTo(left, y(v)); ctx.lineTo(w - 8, y(v)); ctx.stroke(); }
    ctx.setLineDash([]);
    for (const [one, values] of series) {
      if (one.dots) { ctx.fillStyle = one.colour; values.forEach((v, i) => { if (v !== null) ctx.fillRect(x(one.t[i]) - 1, y(v) - 1, 2.5, 2.5); }); }
      else line(ctx, p => p, pieces(one, values.length - 1, i => values[i] === null ? [null] : [x(one.t[i]), y(values[i])]), one.colour, 1.2, 1);
    }
    ctx.fillStyle = colour("ink"); ctx.textAlign = "left"; ctx.fillText(label, left, k * each + 15);
  });
  ctx.fillStyle = colour("dim"); ctx.textAlign = "left"; ctx.fillText(told(0), left, h - 3);
  ctx.textAlign = "right"; ctx.fillText(told(scene.length), w - 8, h - 3);
  ctx.strokeStyle = colour("ink"); ctx.lineWidth = 1.5;
  ctx.beginPath(); ctx.moveTo(x(now), 0); ctx.lineTo(x(now), h - 18); ctx.stroke();
}

function draw() {
  drawMap(); drawImage(); drawStrips();
  at("now").textContent = told(now);
}

function go(t) {
  now = Math.min(Math.max(t, 0), scene.length);
  slider.value = now;
  draw();
}

// The whole flight in a minute, or as fast as it was.
const speed = scene.timed ? Math.max(1, scene.length / 60) : Math.max(scene.length / 60, 2);
let before = 0;
function step(time) {
  if (!running) return;
  if (before) go(now + (time - before) / 1000 * speed);
  before = time;
  if (now >= scene.length) toggle(); else requestAnimationFrame(step);
}
function toggle() {
  running = !running; before = 0;
  play.textContent = running ? "Pause" : "Play";
  if (running) { if (now >= scene.length) go(0); requestAnimationFrame(step); }
}

function nearer(factor) {
  const focus = nowSeen();
  if (zoom * factor > 1 && !middle && focus) middle = focus;
  // No closer than a hundred pixels to the metre.
  zoom = Math.max(Math.min(zoom * factor, 100 / view(map.clientWidth, map.clientHeight)[0] * zoom), .5);
  draw();
}
// What one comes closer to: the latest estimate, target or detection, else the aircraft.
function nowSeen() {
  for (const one of [...shownTracks(), ...(scene.points ? [scene.points] : [])]) {
    const i = last(one.t, now);
    if (i >= 0) return one.p[i];
  }
  return scene.truth.map(one => place(one, now)).find(Boolean) || (scene.path && place(scene.path, now));
}

slider.max = scene.length || 1; slider.step = (scene.length || 1) / 2000;
slider.addEventListener("input", () => { now = Number(slider.value); draw(); });
play.addEventListener("click", toggle);
choices.forEach(([, box]) => box.addEventListener("change", draw));
at("closer").addEventListener("click", () => nearer(2));
at("farther").addEventListener("click", () => nearer(.5));
at("whole").addEventListener("click", () => { zoom = 1; middle = null; draw(); });
map.addEventListener("wheel", event => { if (event.ctrlKey) { event.preventDefault(); nearer(event.deltaY < 0 ? 1.25 : .8); } }, {passive: false});
map.addEventListener("pointermove", event => {
  if (!(event.buttons & 1)) return;
  const [scale, , centre] = view(map.clientWidth, map.clientHeight);
  middle = [centre[0] + event.movementY / scale, centre[1] - event.movementX / scale];
  draw();
});
const seek = event => { if (event.type === "pointerdown" || event.buttons & 1) go((event.offsetX - 44) / (strips.clientWidth - 52) * scene.length); };
strips.addEventListener("pointerdown", seek);
strips.addEventListener("pointermove", seek);
function load(name, address) { const one = new Image(); one.onload = () => { loaded[name] = one; draw(); }; one.src = address; }
pictures.forEach(([row, address]) => load(row, address));
if (scene.ground) load("ground", scene.ground.picture);
at("beside").className = frames && scene.size && (scene.seen || pictures.length) ? "" : "none";
addEventListener("resize", draw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
draw();
