"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const box = document.getElementById("panels"), tools = document.getElementById("tools");
const LEFT = 64, RIGHT = 8;
if (!data.count) return;
const view = { from: 0, to: data.length };

// Signals: least and greatest value of each bucket, or undefined.
for (const group of ["inputs", "residuals", "measured", "twin", "features"])
  for (const s of data[group]) {
    if (s.data) {
      const raw = atob(s.data), bytes = new Uint8Array(raw.length);
      for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
      s.shorts = new Int16Array(bytes.buffer);
      delete s.data;
    }
    const step = (s.high - s.low) / 65534;
    s.value = (i, end) => {
      if (!s.shorts) return s.low === null ? undefined : s.low;
      const short = s.shorts[2 * i + end];
      return short === -32768 || short === undefined ? undefined : s.low + (short + 32767) * step;
    };
  }
const constant = s => !s.shorts;
const number = v => v === undefined ? "–" : Math.abs(v) >= 1e5 || (v && Math.abs(v) < 1e-3)
  ? v.toExponential(2) : String(+v.toPrecision(5));
const time = at => {
  let last = [0, 0];
  for (const s of data.stretches) if (s[0] <= at + 1e-9) last = s;
  return last[1] + at - last[0];
};
// As moment::shown of the program has it: a time that counts from 1970 as a date.
const moment = s => s > 1e8 ? new Date(Math.round(1e3 * s)).toISOString().replace("T", " ").replace("Z", "")
  : number(s) + " s";
const bandOf = panel => data.bands[panel.band] ?? null;

// Panels.
const panels = [];
const add = (group, title, unit, signals, height, draw, band) => {
  const node = document.createElement("div");
  node.className = "panel";
  node.innerHTML = "<p><b></b><span></span><span></span></p><canvas></canvas>";
  const [name, says, reads] = node.querySelectorAll("b, span");
  name.textContent = title;
  says.textContent = unit;
  const canvas = node.querySelector("canvas");
  canvas.style.height = height + "px";
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", title + " over time");
  box.append(node);
  panels.push({ group, node, canvas, reads, signals, height, draw, band });
};
const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name);
const x = (at, w) => LEFT + (at - view.from) / (view.to - view.from) * (w - LEFT - RIGHT);

const states = (g, w, h) => {
  data.changes.forEach((change, k) => {
    const next = data.changes[k + 1], from = x(change.at, w), to = x(next ? next.at : data.length, w);
    const left = Math.max(from, LEFT), right = Math.min(to, w - RIGHT);
    if (right <= LEFT || left >= w - RIGHT) return;
    g.fillStyle = colour(change.class);
    g.fillRect(left, 0, Math.max(right - left, 1), h);
    if (right - left > 60) {
      g.save();
      g.beginPath(); g.rect(left, 0, right - left - 4, h); g.clip();
      const ink = { nodata: colour("text"), isolated: "#fff", environment: "#fff" };
      g.fillStyle = ink[change.class] || "#000";
      // Words that do not fit are said by the legend and under the pointer.
      const [, plain] = data.legend.find(([name]) => name === change.class);
      const fits = [change.words, change.state, plain].find(words => g.measureText(words).width <= right - left - 9);
      if (fits) g.fillText(fits, left + 5, h / 2 + 4);
      g.restore();
    }
  });
};

const NICE = [1, 2, 2.5, 4, 5];
// At most so many, but three or more: one value or two do not tell a scale. Then the coarsest that has three.
const ticks = (low, high, most) => {
  const raw = (high - low) / most;
  let power = Math.floor(Math.log10(raw)), k = NICE.findIndex(m => m * 10 ** power >= raw);
  if (k < 0) { k = 0; power++; }
  for (let tries = 0; ; tries++) {
    const step = NICE[k] * 10 ** power, all = [];
    for (let n = Math.ceil(low / step); n * step <= high; n++) all.push(n * step);
    if (all.length >= 3 || tries === 9) return all;
    if (--k < 0) { k = NICE.length - 1; power--; }
  }
};

const curves = (g, w, h, panel) => {
  const first = Math.max(0, Math.floor(view.from / data.bucket) - 1);
  const last = Math.min(data.count - 1, Math.ceil(view.to / data.bucket));
  let low = Infinity, high = -Infinity;
  for (const s of panel.signals)
    for (let i = first; i <= last; i++) {
      const a = s.value(i, 0), b = s.value(i, 1);
      if (a !== undefined) { low = Math.min(low, a); high = Math.max(high, b); }
    }
  if (low > high) { low = 0; high = 1; }
  const band = bandOf(panel);
  if (band) { low = Math.min(low, -1.2 * band); high = Math.max(high, 1.2 * band); }
  const margin = 0.06 * (high - low) || Math.abs(high) * 0.01 || 1;
  low -= margin; high += margin;
  const y = v => h - 2 - (v - low) / (high - low) * (h - 4);
  g.strokeStyle = colour("grid"); g.fillStyle = colour("soft"); g.textAlign = "right";
  g.beginPath();
  for (const v of ticks(low, high, Math.max(3, h / 20))) {
    g.moveTo(LEFT, Math.round(y(v)) + 0.5); g.lineTo(w - RIGHT, Math.round(y(v)) + 0.5);
    // No line without its number, also at the edges.
    g.fillText(number(+v.toPrecision(12)), LEFT - 6, Math.max(9, Math.min(y(v) + 4, h - 1)));
  }
  g.stroke();
  g.textAlign = "left";
  g.save();
  g.beginPath(); g.rect(LEFT, 0, w - LEFT - RIGHT, h); g.clip();
  if (band !== null) {
    const left = x(0, w);
    g.fillStyle = colour("band");
    g.fillRect(left, y(band), x(data.length, w) - left, y(-band) - y(band));
  }
  // Several buckets in a pixel are drawn as one.
  const step = Math.max(1, Math.floor((last - first) / (w - LEFT - RIGHT)));
  panel.signals.forEach((s, k) => {
    g.strokeStyle = colour(k ? "two" : "one");
    g.lineWidth = 1.3;
    if (k) g.setLineDash([5, 3]);
    g.beginPath();
    let pen = false;
    for (let i = first; i <= last; i += step) {
      let a, b;
      for (let j = i; j < Math.min(i + step, last + 1); j++) {
        const p = s.value(j, 0), q = s.value(j, 1);
        if (p !== undefined) { a = a < p ? a : p; b = b > q ? b : q; }
      }
      if (a === undefined) { pen = false; continue; }
      const at = x((i + step / 2) * data.bucket, w);
      if (pen) g.lineTo(at, y(a)); else g.moveTo(at, y(a));
      g.lineTo(at, y(b) + (pen || b > a ? 0 : 0.5));
      pen = true;
    }
    g.stroke();
    g.setLineDash([]);
  });
  g.lineWidth = 1;
  breaks(g, w, h);
  g.restore();
};

// Each stretch has its own times; where the clock was set there is a line.
const axis = (g, w, h) => {
  g.fillStyle = colour("soft"); g.textAlign = "center";
  let free = 0;
  data.stretches.forEach(([begin, starts], k) => {
    const next = data.stretches[k + 1];
    const from = Math.max(begin, view.from), to = Math.min(next ? next[0] : data.length, view.to);
    const wide = x(to, w) - x(from, w);
    if (to <= from || wide < 60) return;
    const shift = starts > 1e8 ? starts : 0, begins = time(from) - shift;
    for (const t of ticks(begins, begins + to - from, wide / 90)) {
      const text = shift ? moment(shift + t).slice(11, 23) : number(+t.toPrecision(12)) + " s", half = g.measureText(text).width / 2;
      const at = Math.min(x(t - begins + from, w), w - half);
      if (at - half < free) continue;
      g.fillText(text, at, h - 4);
      free = at + half + 8;
    }
  });
  g.textAlign = "left";
  breaks(g, w, h);
};
const breaks = (g, w, h) => {
  g.strokeStyle = colour("text");
  g.setLineDash([3, 3]);
  g.beginPath();
  for (const [begin] of data.stretches.slice(1))
    if (begin > view.from && begin < view.to) { g.moveTo(x(begin, w), 0); g.lineTo(x(begin, w), h); }
  g.stroke();
  g.setLineDash([]);
};

add("always", "State", "", [], 26, states);
add("always", "", "", [], 16, axis);
const still = data.inputs.filter(constant);
for (const s of data.inputs.filter(s => !constant(s)))
  add("inputs", s.label, s.unit, [s], 64, curves);
data.residuals.forEach((s, k) => add("residuals", "r′ " + s.label, s.unit, [s], 64, curves, k));
data.measured.forEach((s, k) =>
  add("measured", s.label, s.unit + " · measured, dashed: twin", [s, data.twin[k]], 74, curves));
for (const s of data.features) add("features", s.label, s.unit, [s], 64, curves);

const cursor = document.createElement("div"), select = document.createElement("div");
cursor.id = "cursor"; select.id = "select";
box.append(cursor, select);

// On paper everything is seen at once, and finer than on a screen.
let printing = false;
const paint = panel => {
  const w = panel.canvas.clientWidth, ratio = printing ? 3 : window.devicePixelRatio || 1;
  const area = panel.canvas.getBoundingClientRect(), is_far = area.bottom < -200 || area.top > innerHeight + 200;
  if (!w || (is_far && !printing)) { panel.stale = true; return; }
  panel.stale = false;
  panel.canvas.width = w * ratio; panel.canvas.height = panel.height * ratio;
  const g = panel.canvas.getContext("2d");
  g.scale(ratio, ratio);
  g.font = "11px DejaVu Sans, Verdana, sans-serif";
  panel.draw(g, w, panel.height, panel);
};
let due = false;
const redraw = () => {
  if (due) return;
  due = true;
  requestAnimationFrame(() => { due = false; panels.forEach(paint); });
};
const look = (from, to) => {
  const least = Math.min(data.length, 10 * data.bucket), length = Math.max(to - from, least);
  view.from = Math.max(0, Math.min(from, data.length - length));
  view.to = Math.min(data.length, view.from + length);
  redraw();
};
const zoom = (factor, about = (view.from + view.to) / 2) =>
  look(about - (about - view.from) * factor, about + (view.to - about) * factor);

// Groups and buttons.
const button = (text, press, title) => {
  const b = document.createElement("button");
  b.textContent = text; b.onclick = press; b.title = title;
  tools.append(b);
};
for (const [group, name, on] of [["inputs", "inputs", true], ["residuals", "residuals", true],
    ["measured", "measured and twin", false], ["features", "features", false]]) {
  const mine = panels.filter(p => p.group === group);
  if (!mine.length) continue;
  const label = document.createElement("label"), check = document.createElement("input");
  check.type = "checkbox"; check.checked = on;
  check.onchange = () => { mine.forEach(p => p.node.hidden = !check.checked); redraw(); };
  label.append(check, " " + name);
  tools.append(label);
  mine.forEach(p => p.node.hidden = !on);
}
button("+", () => zoom(0.5), "closer"); button("−", () => zoom(2), "further");
button("all", () => look(0, data.length), "the whole time");
const hint = document.createElement("span");
hint.textContent = "Drag: zoom. Shift and drag, or ← →: move. Ctrl and wheel, or + −: zoom. Double click: all."
  + (still.length ? " Constant: " + still.map(s => (s.label + " " + number(s.value(0, 0)) + " " + s.unit).trim()).join(", ") + "." : "");
tools.append(hint);
const legend = document.createElement("p");
legend.id = "legend";
for (const [name, words] of data.legend) {
  const entry = document.createElement("span"), mark = document.createElement("i");
  mark.className = name;
  entry.append(mark, words);
  legend.append(entry);
}
tools.append(legend);

// Pointer and keys.
const at = event => {
  const area = box.getBoundingClientRect(), inner = area.width - LEFT - RIGHT;
  const share = Math.max(0, Math.min(1, (event.clientX - area.left - LEFT) / inner));
  return view.from + share * (view.to - view.from);
};
let drag = null;
const hover = now => {
  const i = Math.min(data.count - 1, Math.floor(now / data.bucket)), w = box.clientWidth;
  cursor.style.display = "block"; cursor.style.left = x(now, w) + "px";
  for (const p of panels) {
    const texts = p.signals.map(s => {
      const a = s.value(i, 0), b = s.value(i, 1);
      return number(a) === number(b) ? number(a) : number(a) + " … " + number(b);
    });
    p.reads.textContent = texts.join("  |  ");
  }
  let said = "";
  for (const change of data.changes) if (change.at <= now + 1e-9) said = change.words;
  panels[0].reads.textContent = moment(time(now)) + "  " + said;
};
box.onpointerdown = event => {
  if (event.button) return;
  drag = { from: at(event), shift: event.shiftKey, view: { ...view }, start: event.clientX };
  box.setPointerCapture(event.pointerId);
};
box.onpointermove = event => {
  const now = at(event);
  hover(now);
  if (!drag) return;
  if (drag.shift) {
    const inner = box.clientWidth - LEFT - RIGHT, long = drag.view.to - drag.view.from;
    const by = (drag.start - event.clientX) / inner * long;
    look(drag.view.from + by, drag.view.to + by);
  } else {
    const [a, b] = [drag.from, now].sort((p, q) => p - q), w = box.clientWidth;
    select.style.display = "block";
    select.style.left = x(a, w) + "px"; select.style.width = x(b, w) - x(a, w) + "px";
  }
};
box.onpointerup = event => {
  if (drag && !drag.shift && Math.abs(event.clientX - drag.start) > 4) {
    const now = at(event);
    look(Math.min(drag.from, now), Math.max(drag.from, now));
  }
  drag = null; select.style.display = "none";
};
box.onpointercancel = () => { drag = null; select.style.display = "none"; };
box.onpointerleave = () => { if (!drag) cursor.style.display = "none"; };
box.ondblclick = () => look(0, data.length);
box.addEventListener("wheel", event => {
  if (!event.ctrlKey && !event.metaKey) return;
  event.preventDefault();
  zoom(event.deltaY > 0 ? 1.25 : 0.8, at(event));
}, { passive: false });
box.onkeydown = event => {
  const by = 0.2 * (view.to - view.from);
  const act = { ArrowLeft: () => look(view.from - by, view.to - by),
    ArrowRight: () => look(view.from + by, view.to + by),
    "+": () => zoom(0.5), "-": () => zoom(2), "0": () => look(0, data.length) }[event.key];
  if (act) { event.preventDefault(); act(); }
};
for (const row of document.querySelectorAll("#changes tbody tr"))
  row.onclick = () => { look(+row.dataset.at - 5, +row.dataset.at + 5); box.scrollIntoView(); };
addEventListener("beforeprint", () => {
  printing = true;
  // The width of a page, so that nothing is squeezed, and dark lines on white.
  document.documentElement.classList.add("paper");
  panels.forEach(paint);
});
addEventListener("afterprint", () => {
  printing = false;
  document.documentElement.classList.remove("paper");
  redraw();
});
addEventListener("resize", redraw);
addEventListener("scroll", () => panels.some(p => p.stale) && redraw(), { passive: true });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
redraw();
})();
