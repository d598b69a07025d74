"use strict";
const base = location.pathname, el = id => document.getElementById(id), canvas = el("canvas");
const pen = canvas.getContext("2d"), pictures = new Map(), COLOUR = "#ffd23f", CHOSEN = "#56d4ff";
let state = null, at = 0, picture = null, chosen = -1, name = "", unsaved = new Map();
let scale = 1, left = 0, top_ = 0, saving = Promise.resolve(), asked = 0, changes = 0;

const points = () => state.points[at];
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
function show(text, bad) { el("saved").textContent = text; el("saved").className = bad ? "bad" : ""; }

// -- what is kept
function post(place, what) {
  const headers = {"Content-Type": "application/json"};
  return fetch(base + place, {method: "POST", headers, body: JSON.stringify(what)});
}
async function send(number) {
  // What is changed while this is under way is not saved by it.
  const change = unsaved.get(number);
  try {
    const answer = await post("clicks",
      {image: number, revision: state.revisions[number], points: state.points[number]});
    if (!answer.ok) throw new Error(await answer.text());
    state.revisions[number] = (await answer.json()).revision;
    if (unsaved.get(number) === change) unsaved.delete(number);
    show(unsaved.size ? "Saving" : "Saved");
  } catch (error) {
    show("Not saved: " + error.message, true);
  }
}
function save() {
  unsaved.set(at, ++changes);
  show("Saving");
  for (const number of unsaved.keys()) saving = saving.then(() => unsaved.has(number) ? send(number) : null);
  draw(); list();
}
addEventListener("beforeunload", event => { if (unsaved.size) event.preventDefault(); });

// -- what is seen
function fit() {
  if (!picture) return;
  const box = canvas.getBoundingClientRect();
  scale = Math.min(box.width / picture.width, box.height / picture.height);
  left = (box.width - picture.width * scale) / 2;
  top_ = (box.height - picture.height * scale) / 2;
  draw();
}
function zoom(by, x, y) {
  const now = clamp(scale * by, 0.02, 64);
  left = x - (x - left) * now / scale; top_ = y - (y - top_) * now / scale; scale = now;
  draw();
}
function focus_() {
  const box = canvas.getBoundingClientRect(), one = points()[chosen];
  return one ? [left + (one[1] + .5) * scale, top_ + (one[2] + .5) * scale] : [box.width / 2, box.height / 2];
}
function draw() {
  const box = canvas.getBoundingClientRect(), ratio = devicePixelRatio || 1;
  const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, box.width, box.height);
  Object.assign(canvas.dataset, {scale, left, top: top_, image: picture ? at : ""});
  if (!picture) return;
  pen.imageSmoothingEnabled = scale < 2;
  pen.drawImage(picture, left, top_, picture.width * scale, picture.height * scale);
  pen.font = "600 13px system-ui, sans-serif"; pen.textBaseline = "bottom";
  points().forEach((one, number) => {
    const x = left + (one[1] + .5) * scale, y = top_ + (one[2] + .5) * scale;
    for (const [colour, wide] of [["#000c", 4], [number === chosen ? CHOSEN : COLOUR, 1.6]]) {
      pen.strokeStyle = colour; pen.lineWidth = wide; pen.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        pen.moveTo(x + 4 * dx, y + 4 * dy); pen.lineTo(x + 13 * dx, y + 13 * dy);
      }
      if (number === chosen) { pen.moveTo(x + 17, y); pen.arc(x, y, 17, 0, 7); }
      pen.stroke();
    }
    pen.strokeStyle = "#000c"; pen.lineWidth = 4; pen.lineJoin = "round";
    pen.strokeText(one[0], x + 12, y - 8);
    pen.fillStyle = number === chosen ? CHOSEN : COLOUR; pen.fillText(one[0], x + 12, y - 8);
  });
}
function row(key, text, more, pressed, act) {
  const item = document.createElement("li"), button = document.createElement("button");
  for (const [kind, words] of [["kbd", key], ["b", text], ["i", more]]) {
    if (words === null) continue;
    const part = document.createElement(kind); part.textContent = words; button.append(part);
  }
  button.type = "button"; button.setAttribute("aria-pressed", pressed);
  button.addEventListener("click", () => { act(); canvas.focus(); });
  item.append(button);
  return item;
}
function list() {
  el("names").replaceChildren(...state.names.map((one, number) =>
    row(number < 9 ? number + 1 : "", one, null, one === name, () => call(one))));
  el("points").replaceChildren(...points().map((one, number) =>
    row(null, one[0] || "no name", one[1].toFixed(1) + ", " + one[2].toFixed(1), number === chosen,
      () => choose(number))));
  el("count").textContent = points().length ? "(" + points().length + ")" : "";
  el("arrows").textContent = chosen < 0 ? "image before, next image"
    : "move the point by 1 px, with Shift by 0.1 px";
}

// -- what is done
function call(one) { name = one.trim(); el("name").value = name; list(); }
function choose(number) { chosen = number; draw(); list(); }
function mark(x, y) {
  if (!picture) return;
  const u = (x - left) / scale - .5, v = (y - top_) / scale - .5;
  if (u < -.5 || v < -.5 || u > picture.width - .5 || v > picture.height - .5) return;
  points().push([name, +u.toFixed(2), +v.toFixed(2)]);
  if (name && !state.names.includes(name)) state.names.push(name);
  chosen = points().length - 1;
  save();
}
function nudge(u, v) {
  const one = points()[chosen];
  one[1] = +clamp(one[1] + u, -.5, picture.width - .5).toFixed(2);
  one[2] = +clamp(one[2] + v, -.5, picture.height - .5).toFixed(2);
  save();
}
function drop() {
  if (chosen < 0) return;
  points().splice(chosen, 1);
  chosen = Math.min(chosen, points().length - 1);
  save();
}
async function load(number) {
  if (!pictures.has(number)) {
    pictures.set(number, fetch(base + "image/" + number).then(async answer => {
      if (!answer.ok) throw new Error(await answer.text());
      return createImageBitmap(await answer.blob());
    }));
    pictures.get(number).catch(() => pictures.delete(number));
    for (const old of pictures.keys()) if (pictures.size > 6 && Math.abs(old - at) > 2) pictures.delete(old);
  }
  return pictures.get(number);
}
async function go(number) {
  const own = ++asked, size = picture && [picture.width, picture.height].join();
  at = clamp(number, 0, state.images.length - 1); chosen = -1; picture = null;
  el("image").textContent = state.images[at]; el("image").title = state.images[at];
  el("jump").value = at + 1; el("problem").textContent = ""; list(); draw();
  try {
    const found = await load(at);
    if (own !== asked) return;
    picture = found;
    if (size === [found.width, found.height].join()) draw(); else fit();
    if (at + 1 < state.images.length) load(at + 1).catch(() => null);
  } catch (error) {
    if (own === asked) el("problem").textContent = error.message;
  }
}

// -- mouse and keys
let pressed = null;
canvas.addEventListener("pointerdown", event => {
  pressed = {x: event.clientX, y: event.clientY, left, top: top_, moved: false, button: event.button};
  canvas.setPointerCapture(event.pointerId); canvas.focus();
});
canvas.addEventListener("pointermove", event => {
  const box = canvas.getBoundingClientRect();
  if (pressed) {
    const dx = event.clientX - pressed.x, dy = event.clientY - pressed.y;
    pressed.moved = pressed.moved || Math.hypot(dx, dy) > 4;
    if (pressed.moved) { left = pressed.left + dx; top_ = pressed.top + dy; draw(); }
  }
  const u = (event.clientX - box.left - left) / scale - .5, v = (event.clientY - box.top - top_) / scale - .5;
  el("where").textContent = picture ? "Pointer at " + u.toFixed(1) + ", " + v.toFixed(1) : "";
});
canvas.addEventListener("pointerup", event => {
  const box = canvas.getBoundingClientRect();
  const meant = pressed && !pressed.moved && pressed.button === 0;
  pressed = null;
  if (meant) mark(event.clientX - box.left, event.clientY - box.top);
});
canvas.addEventListener("wheel", event => {
  const box = canvas.getBoundingClientRect();
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
}, {passive: false});
addEventListener("keydown", event => {
  if (!state || event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = event.target.tagName === "INPUT", key = event.key, box = canvas.getBoundingClientRect();
  if (typing) {
    if (key === "Enter" || key === "Escape") {
      if (event.target === el("name") && key === "Enter") call(el("name").value);
      if (event.target === el("jump") && key === "Enter") go(el("jump").valueAsNumber - 1 || 0);
      canvas.focus(); event.preventDefault();
    }
    return;
  }
  if (event.target.tagName === "BUTTON" && (key === "Enter" || key === " ")) return;
  const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
  const view = {a: [60, 0], d: [-60, 0], w: [0, 60], s: [0, -60]}[key.toLowerCase()];
  if (key in arrows) {
    const by = event.shiftKey ? .1 : 1, [u, v] = arrows[key];
    if (chosen >= 0 && picture) nudge(u * by, v * by); else if (u) go(at + u);
  } else if (key === "PageDown" || key === "PageUp") go(at + (key === "PageDown" ? 1 : -1));
  else if (key === "Enter") mark(box.width / 2, box.height / 2);
  else if (key === "Delete" || key === "Backspace") drop();
  else if (key === "Escape") choose(-1);
  else if (key === "[" || key === "]") {
    const count = points().length;
    if (count) choose((chosen + (key === "]" ? 1 : chosen < 0 ? 0 : -1) + count) % count);
  } else if (key === "+" || key === "=") zoom(1.5, ...focus_());
  else if (key === "-") zoom(1 / 1.5, ...focus_());
  else if (key === "0") fit();
  else if (key >= "1" && key <= "9" && key.length === 1) {
    if (state.names[key - 1] !== undefined) call(state.names[key - 1]);
  } else if (key.toLowerCase() === "n") { el("name").focus(); el("name").select(); }
  else if (view) { left += view[0]; top_ += view[1]; draw(); }
  else return;
  event.preventDefault();
});
el("name").addEventListener("input", () => { name = el("name").value.trim(); list(); });
el("jump").addEventListener("change", () => go(el("jump").valueAsNumber - 1 || 0));
el("before").addEventListener("click", () => go(at - 1));
el("after").addEventListener("click", () => go(at + 1));
el("finish").addEventListener("click", async () => {
  await saving;
  if (unsaved.size) { show("Not saved: try again, or look at the terminal", true); return; }
  try {
    await post("finish", {});
    document.body.textContent = "Finished and saved. The terminal shows what comes next; close this page.";
    document.body.style.padding = "2rem";
  } catch (error) { show("The server has ended already", true); }
});
new ResizeObserver(() => { if (picture) draw(); }).observe(el("area"));

fetch(base + "state").then(answer => answer.json()).then(found => {
  state = found;
  document.title = "Marks: " + state.title; el("title").textContent = state.title;
  el("of").textContent = "of " + state.images.length; el("jump").max = state.images.length;
  if (state.names.length) call(state.names[0]);
  show("Saved at every click");
  canvas.focus();
  const next = state.points.findIndex(one => !one.length);
  return go(next < 0 ? 0 : next);
}).catch(error => show("Cannot be loaded: " + error.message, true));
