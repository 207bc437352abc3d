"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const box = document.getElementById("panels"), tools = document.getElementById("tools");
const LEFT = 64, RIGHT = 8, FONT = "11px DejaVu Sans, Verdana, sans-serif", GROUPS = ["inputs", "residuals", "measured", "twin", "features"];
if (!data.count) return;
let view = [0, data.length];

// Each bucket has a point for its least value and one for its greatest.
const times = Array.from({ length: 2 * data.count }, (_, i) => i / 2 * data.bucket);
for (const s of GROUPS.flatMap(group => data[group])) {
  s.isConstant = !s.data;
  if (s.isConstant) { s.values = times.map(() => s.low); continue; }
  const bytes = Uint8Array.from(atob(s.data), c => c.charCodeAt(0)), step = (s.high - s.low) / 65534;
  s.values = Array.from(new Int16Array(bytes.buffer), short => short === -32768 ? null : s.low + (short + 32767) * step);
}
const number = v => v == null ? "–" : Math.abs(v) >= 1e5 || (v && Math.abs(v) < 1e-3)
  ? v.toExponential(2) : String(+v.toPrecision(5));
const time = at => {
  const [begin, starts] = data.stretches.findLast(([begin]) => begin <= at + 1e-9) ?? [0, 0];
  return starts + at - begin;
};
// As moment::shown of the program has it: a time that counts from 1970 as a date.
const moment = s => s > 1e8 ? new Date(Math.round(1e3 * s)).toISOString().replace("T", " ").replace("Z", "")
  : number(s) + " s";
const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name);

// The state as colored stretches with its words, behind the axis of time.
const drawStates = u => {
  const { ctx: g, bbox: { left: l, top, width, height } } = u, ratio = devicePixelRatio;
  g.save();
  g.beginPath(); g.rect(l, top, width, height); g.clip();
  g.font = FONT.replace("11", 11 * ratio);
  data.changes.forEach((change, k) => {
    const left = Math.max(l, u.valToPos(change.at, "x", true));
    const right = Math.min(l + width, u.valToPos(data.changes[k + 1]?.at ?? data.length, "x", true));
    if (right <= l || left >= l + width) return;
    g.fillStyle = colour(change.class);
    g.fillRect(left, top, Math.max(right - left, ratio), height);
    const ink = { nodata: colour("text"), isolated: "#fff", environment: "#fff" };
    g.fillStyle = ink[change.class] || "#000";
    // Words that do not fit are said by the legend and under the pointer.
    const [, plain] = data.legend.find(([name]) => name === change.class);
    const fits = [change.words, change.state, plain].find(words => g.measureText(words).width <= right - left - 9 * ratio);
    if (fits) { g.textAlign = "left"; g.textBaseline = "middle"; g.fillText(fits, left + 5 * ratio, top + height / 2); }
  });
  g.restore();
};
const drawBand = (u, band) => {
  const { ctx: g, bbox: { left, width } } = u, [high, low] = [band, -band].map(edge => u.valToPos(edge, "y", true));
  g.save();
  g.fillStyle = colour("band");
  g.fillRect(left, high, width, low - high);
  g.restore();
};
// Where the clock was set there is a line.
const drawBreaks = u => {
  const { ctx: g, bbox: { left, top, width, height } } = u;
  g.save();
  g.strokeStyle = colour("text");
  g.setLineDash([6, 6]);
  for (const [begin] of data.stretches.slice(1)) {
    const x = u.valToPos(begin, "x", true);
    if (x > left && x < left + width) { g.beginPath(); g.moveTo(x, top); g.lineTo(x, top + height); g.stroke(); }
  }
  g.restore();
};

// Each stretch has its own times, which are round at its marks.
const splits = (u, axis, min, max, incr) => {
  let free = -Infinity;
  return data.stretches.flatMap(([begin, starts], k) => {
    const to = Math.min(data.stretches[k + 1]?.[0] ?? data.length, max), shift = starts - begin, marks = [];
    for (let n = Math.ceil((Math.max(begin, min) + shift) / incr - 1e-6); n * incr - shift <= to + 1e-9; n++) marks.push(n * incr - shift);
    return marks.filter(at => at - free > 0.8 * incr && (free = at, true));
  });
};
const mark = at => {
  const s = time(at);
  return s > 1e8 ? moment(s).slice(11, 23) : number(+s.toPrecision(12)) + " s";
};

const panels = [];
const add = (group, title, unit, signals, height, band = null) => {
  const node = document.createElement("div");
  node.className = "panel";
  node.setAttribute("role", "img");
  node.setAttribute("aria-label", title + " over time");
  node.innerHTML = "<p><b></b><span></span><span></span></p><div></div>";
  const [name, says, reads] = node.querySelectorAll("b, span");
  name.textContent = title;
  says.textContent = unit;
  box.append(node);
  panels.push({ group, node, reads, signals, height, band });
};
const range = ({ signals, band }) => (u, low, high) => {
  if (!signals.length) return [0, 1];
  if (band !== null) [low, high] = [Math.min(low ?? 0, -1.2 * band), Math.max(high ?? 0, 1.2 * band)];
  const margin = 0.06 * (high - low) || Math.abs(high) * 0.01 || 1;
  return [(low ?? 0) - margin, (high ?? 1) + margin];
};
const make = panel => {
  const { node, reads, signals, height, band } = panel, isState = !signals.length;
  const axis = { stroke: () => colour("soft"), font: FONT, grid: { stroke: () => colour("grid"), width: 1 }, ticks: { show: false } };
  const hover = u => {
    const i = u.cursor.idx;
    if (i == null) return;
    const said = data.changes.findLast(change => change.at <= times[i] + 1e-9)?.words ?? "";
    const texts = signals.map(s => {
      const [low, high] = [i - i % 2, i - i % 2 + 1].map(k => number(s.values[k]));
      return low === high ? low : low + " … " + high;
    });
    reads.textContent = isState ? moment(time(times[i])) + "  " + said : texts.join("  |  ");
  };
  const zoomed = u => {
    const { left, width } = u.select;
    if (width > 4) look(u.posToVal(left, "x"), u.posToVal(left + width, "x"));
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  };
  panel.plot = new uPlot({
    width: box.clientWidth, height, padding: [6, RIGHT, 6, 0], legend: { show: false },
    cursor: { y: false, points: { show: false }, sync: { key: "watch" }, drag: { x: true, y: false, setScale: false },
      bind: { dblclick: () => () => look(0, data.length) } },
    scales: { x: { time: false, range: () => view }, y: { range: range(panel) } },
    axes: [isState ? { ...axis, grid: { show: false }, size: 18, gap: 2, space: 90, splits, values: (u, all) => all.map(mark) } : { show: false },
      { ...axis, size: LEFT, space: 13, gap: 6, values: (u, all) => all.map(v => isState ? "" : number(+v.toPrecision(12))),
        ...(isState && { grid: { show: false } }) }],
    series: [{}, ...(isState ? [null] : signals).map((_, k) =>
      ({ stroke: () => colour(k ? "two" : "one"), width: 1.3, dash: k ? [5, 3] : undefined, points: { show: false } }))],
    hooks: { drawAxes: [u => isState ? drawStates(u) : band !== null && drawBand(u, band)], draw: [drawBreaks],
      setCursor: [hover], setSelect: [zoomed] },
  }, [times, ...(isState ? [times.map(() => null)] : signals.map(s => s.values))], node.lastChild);
};

const redraw = (width = box.clientWidth) => panels.filter(p => !p.node.hidden).forEach(p => {
  if (!p.plot) make(p);
  if (p.plot.width !== width) p.plot.setSize({ width, height: p.height });
  p.plot.setData(p.plot.data);
});
const look = (from, to) => {
  const least = Math.min(data.length, 10 * data.bucket), length = Math.max(to - from, least);
  const begin = Math.max(0, Math.min(from, data.length - length));
  view = [begin, Math.min(data.length, begin + length)];
  redraw();
};
const zoom = (factor, about = (view[0] + view[1]) / 2) =>
  look(about - (about - view[0]) * factor, about + (view[1] - about) * factor);

add("always", "State", "", [], 48);
const still = data.inputs.filter(s => s.isConstant);
for (const s of data.inputs.filter(s => !s.isConstant)) add("inputs", s.label, s.unit, [s], 64);
data.residuals.forEach((s, k) => add("residuals", "r′ " + s.label, s.unit, [s], 64, data.bands[k]));
data.measured.forEach((s, k) => add("measured", s.label, s.unit + " · measured, dashed: twin", [s, data.twin[k]], 74));
for (const s of data.features) add("features", s.label, s.unit, [s], 64);

// Groups, buttons and the legend of states.
const element = (tag, content) => Object.assign(document.createElement(tag), content);
const button = (textContent, onclick, title) => tools.append(element("button", { textContent, onclick, title }));
for (const [group, name, on] of [["inputs", "inputs", true], ["residuals", "residuals", true],
    ["measured", "measured and twin", false], ["features", "features", false]]) {
  const mine = panels.filter(p => p.group === group);
  if (!mine.length) continue;
  const check = element("input", { type: "checkbox", checked: on });
  check.onchange = () => { mine.forEach(p => p.node.hidden = !check.checked); redraw(); };
  const label = document.createElement("label");
  label.append(check, " " + name);
  tools.append(label);
  mine.forEach(p => p.node.hidden = !on);
}
button("+", () => zoom(0.5), "closer"); button("−", () => zoom(2), "further");
button("all", () => look(0, data.length), "the whole time");
tools.append(element("span", { textContent: "Drag: zoom. ← →: move. Ctrl and wheel, or + −: zoom. Double click: all."
  + (still.length ? " Constant: " + still.map(s => (s.label + " " + number(s.low) + " " + s.unit).trim()).join(", ") + "." : "") }));
const legend = element("p", { id: "legend" });
for (const [className, words] of data.legend) {
  const entry = document.createElement("span");
  entry.append(element("i", { className }), words);
  legend.append(entry);
}
tools.append(legend);

box.addEventListener("wheel", event => {
  if (!event.ctrlKey && !event.metaKey) return;
  event.preventDefault();
  const share = (event.clientX - box.getBoundingClientRect().left - LEFT) / (box.clientWidth - LEFT - RIGHT);
  zoom(event.deltaY > 0 ? 1.25 : 0.8, view[0] + share * (view[1] - view[0]));
}, { passive: false });
box.onkeydown = event => {
  const by = 0.2 * (view[1] - view[0]);
  const act = { ArrowLeft: () => look(view[0] - by, view[1] - by), ArrowRight: () => look(view[0] + by, view[1] + by),
    "+": () => zoom(0.5), "-": () => zoom(2), "0": () => look(0, data.length) }[event.key];
  if (act) { event.preventDefault(); act(); }
};
for (const row of document.querySelectorAll("#changes tbody tr"))
  row.onclick = () => { look(+row.dataset.at - 5, +row.dataset.at + 5); box.scrollIntoView(); };
// On paper: the width of a page, so that nothing is squeezed, and dark lines on white.
addEventListener("beforeprint", () => { document.documentElement.classList.add("paper"); redraw(680); });
addEventListener("afterprint", () => { document.documentElement.classList.remove("paper"); redraw(); });
addEventListener("resize", () => redraw());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw());
redraw();
})();
