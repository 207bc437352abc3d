"use strict";
// The page beside a running flight. It keeps the last minute of samples, draws them, and asks the server for faults.

const KEPT_S = 60;
const HEIGHT = 128;
const token = new URLSearchParams(location.search).get("token");
const query = token ? `?token=${encodeURIComponent(token)}` : "";
const $ = (id) => document.getElementById(id);

let about = null;
let socket = null;
let data = null;
let state = {};
let playback = null;
let isHeld = false;
let lost = 0;

// ---------------------------------------------------------------- samples

/** The last samples of all signals: a column of times and one column for each signal; null is a gap. */
class Samples {
  constructor(width, periodS) {
    this.periodS = periodS;
    this.keep = Math.round(KEPT_S / periodS);
    this.columns = Array.from({ length: width + 1 }, () => []);
    this.next = null;
  }

  /** Takes a frame. What is missing between two frames becomes a gap, and a number that begins anew a new flight. */
  take(buffer) {
    const view = new DataView(buffer);
    const first = Number(view.getBigUint64(0, true));
    const count = view.getUint32(8, true);
    const width = view.getUint32(12, true);
    const values = new Float32Array(buffer, 16);
    if (this.next !== null && first < this.next) this.columns.forEach((column) => { column.length = 0; });
    else if (this.next !== null && first > this.next) this.row(this.next, () => null);
    for (let k = 0; k < count; k++) {
      this.row(first + k, (signal) => {
        const value = values[k * width + signal];
        return Number.isFinite(value) ? value : null;
      });
    }
    this.next = first + count;
    const over = this.columns[0].length - this.keep;
    if (over > this.keep / 4) this.columns.forEach((column) => column.splice(0, over));
  }

  row(sample, value) {
    this.columns[0].push(sample * this.periodS);
    for (let signal = 1; signal < this.columns.length; signal++) this.columns[signal].push(value(signal - 1));
  }

  last(signal) {
    const column = this.columns[signal + 1];
    return column[column.length - 1] ?? null;
  }
}

/**
 * Thins a span to at most two samples a pixel: the smallest and the largest of each, so that no peak is lost. A null
 * stays, so that a gap stays a gap.
 */
function thinned(columns, from, pixels) {
  const total = columns[0].length - from;
  const size = Math.ceil(total / Math.max(1, pixels));
  if (size <= 2) return columns.map((column) => column.slice(from));
  const out = columns.map(() => []);
  for (let begin = from; begin < columns[0].length; begin += size) {
    const end = Math.min(begin + size, columns[0].length);
    out[0].push(columns[0][begin], columns[0][end - 1]);
    for (let c = 1; c < columns.length; c++) {
      let low = Infinity, high = -Infinity, lowAt = begin, highAt = begin, isGap = false;
      for (let k = begin; k < end; k++) {
        const value = columns[c][k];
        if (value === null) isGap = true;
        else {
          if (value < low) { low = value; lowAt = k; }
          if (value > high) { high = value; highAt = k; }
        }
      }
      const pair = lowAt <= highAt ? [low, high] : [high, low];
      out[c].push(...(Number.isFinite(low) ? pair : [null, null]));
      if (isGap && Number.isFinite(low)) out[c][out[c].length - 1] = null;
    }
  }
  return out;
}

// ---------------------------------------------------------------- charts

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** A color that depends on the theme, computed by the browser. */
function color(name) {
  const probe = document.createElement("span");
  probe.style.color = `var(${name})`;
  document.body.append(probe);
  const found = getComputedStyle(probe).color;
  probe.remove();
  return found;
}

let plots = [];

function indices(group) {
  return about.signals.map((signal, k) => [signal, k]).filter(([signal]) => signal.group === group).map(([, k]) => k);
}

function chart(title, signals, { band = null, limit = null, colors = ["--command", "--own", "--ghost"] } = {}) {
  const unit = about.signals[signals[0]].unit;
  const axis = { stroke: color("--faint"), grid: { stroke: color("--line"), width: 1 }, ticks: { stroke: color("--line") } };
  const lines = signals.map((signal, k) => ({
    label: about.signals[signal].label,
    stroke: color(colors[k % colors.length]),
    width: 1.5,
    dash: about.signals[signal].id.endsWith("ghost") ? [6, 4] : undefined,
    points: { show: (u, series, from, to, gaps) => (to - from < 3 ? true : false) },
    value: (u, value) => (value === null ? "—" : value.toPrecision(4)),
  }));
  const hooks = {
    draw: [(u) => {
      const edges = band !== null ? [-band, band] : limit !== null ? [limit] : [];
      const context = u.ctx;
      context.save();
      context.strokeStyle = color("--band");
      context.setLineDash([4, 4]);
      for (const edge of edges) {
        const y = u.valToPos(edge, "y", true);
        context.beginPath();
        context.moveTo(u.bbox.left, y);
        context.lineTo(u.bbox.left + u.bbox.width, y);
        context.stroke();
      }
      context.restore();
    }],
  };
  const widest = (u, low, high) => {
    if (limit !== null) return [0, Math.max(1.6 * limit, 1.1 * (high ?? 0))];
    const least = band === null ? 1e-3 : 1.3 * band;
    const top = Math.max(Math.abs(low ?? 0), Math.abs(high ?? 0), least);
    return [-1.1 * top, 1.1 * top];
  };
  const options = {
    title: `${title} / ${unit}`,
    width: $("plots").clientWidth || 600,
    height: HEIGHT,
    legend: { show: true, live: false },
    cursor: { sync: { key: "flight" }, drag: { x: true, y: false } },
    scales: { x: { time: false }, y: { range: widest } },
    axes: [{ ...axis, values: (u, splits) => splits.map((s) => `${s} s`) }, { ...axis, space: 18 }],
    series: [{ label: "time / s" }, ...lines],
    hooks,
  };
  const holder = document.createElement("div");
  $("plots").append(holder);
  return { plot: new uPlot(options, [[], ...signals.map(() => [])], holder), signals };
}

function makeCharts() {
  plots.forEach(({ plot }) => plot.destroy());
  $("plots").replaceChildren();
  plots = [];
  if (!about) return;
  const motion = indices("motion");
  if (motion.length) plots.push(chart("Command and answer", motion));
  const fight = indices("fight");
  if (fight.length) plots.push(chart("Force fight", fight, { colors: ["--own", "--ghost"] }));
  const chosen = Number($("residual").value);
  if (about.signals[chosen]) {
    const signal = about.signals[chosen];
    plots.push(chart(`Residual of ${signal.label}`, [chosen], { band: signal.band, colors: ["--own"] }));
  }
  const evidence = indices("evidence");
  const hues = ["--own", "--ghost", "--bad", "--band", "--second", "--third"];
  if (evidence.length) plots.push(chart("Evidence", evidence, { limit: 1, colors: hues }));
}

/** What the charts showed last, and what they depend on: a frame comes every 50 ms, a browser draws every 17 ms. */
let shown = [];
const toShow = () => [data, data.next, data.columns[0].length, state, $("span").value, plots[0]];

function isNews() {
  const next = toShow();
  const isNew = next.some((value, k) => value !== shown[k]);
  shown = next;
  return isNew;
}

function draw() {
  if (!isHeld && data && data.columns[0].length && isNews()) {
    const times = data.columns[0];
    const from = times.findIndex((time) => time >= times[times.length - 1] - Number($("span").value));
    for (const { plot, signals } of plots) {
      const own = [times, ...signals.map((signal) => data.columns[signal + 1])];
      plot.setData(thinned(own, Math.max(0, from), plot.bbox.width / devicePixelRatio));
    }
    schematic.update();
  }
  requestAnimationFrame(draw);
}

// ---------------------------------------------------------------- schematic

const SVG = "http://www.w3.org/2000/svg";

function element(name, attributes, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/** The parts of a hydraulic actuator, each at its place: x, y, width, height and words. */
const PARTS = [
  ["supply_valve", 10, 22, 100, 34, "supply valve"],
  ["tank_valve", 190, 22, 100, 34, "return valve"],
  ["leakage_supply", 10, 60, 100, 20, "supply leak"],
  ["leakage_tank", 190, 60, 100, 20, "return leak"],
  ["servo_valve", 60, 92, 180, 34, "servo valve"],
  ["mode_valve", 60, 134, 180, 22, "mode valve"],
  ["leakage_a", 10, 166, 60, 20, "leak A"],
  ["leakage_b", 230, 166, 60, 20, "leak B"],
  ["cylinder", 40, 194, 220, 46, ""],
  ["sensor_pressure_a", 10, 248, 66, 20, "p_A s."],
  ["sensor_pressure_b", 82, 248, 66, 20, "p_B s."],
  ["sensor_ram", 154, 248, 66, 20, "ram s."],
  ["sensor_spool", 226, 248, 66, 20, "spool s."],
  ["sensor_supply", 10, 272, 138, 20, "p_S sensor"],
  ["sensor_tank", 154, 272, 138, 20, "p_T sensor"],
];

const schematic = {
  views: [],

  build() {
    this.views = [];
    $("schematic").replaceChildren();
    about.actuators.forEach((name, actuator) => {
      const view = this.actuator(name, actuator);
      if (view) this.views.push(view);
    });
  },

  actuator(name, actuator) {
    const id = (part) => (name ? `${name}.${part}` : part);
    const known = PARTS.filter(([part]) => about.components.some((component) => component.id === id(part)));
    if (!known.length) return null;
    const svg = element("svg", { viewBox: "0 0 300 300", role: "group", "aria-label": name || "actuator" });
    svg.append(element("text", { x: 10, y: 16, "font-weight": 700 }, name.replace("_", " ") || "actuator"));
    svg.append(element("path", { class: "pipe", d: "M60 56V92M240 56V92M90 126V194M210 126V194" }));
    const parts = known.map(([part, x, y, width, height, words]) => {
      const touch = element("g", { class: "touch", tabindex: 0, role: "button", "data-component": id(part),
        "aria-label": `${name} ${part}`.replaceAll("_", " ") });
      touch.append(element("rect", { class: "part", x, y, width, height, rx: 3 }));
      touch.append(element("text", { x: x + 5, y: y + 14 }, words));
      const choose = () => chooseComponent(id(part));
      touch.addEventListener("click", choose);
      touch.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(); }
      });
      svg.append(touch);
      return touch;
    });
    const ram = element("rect", { x: 146, y: 196, width: 8, height: 42, fill: "currentColor" });
    const spool = element("rect", { x: 142, y: 113, width: 16, height: 10, fill: "currentColor" });
    svg.append(ram, spool);
    const readings = {};
    const place = { pressure_a: [46, 222], pressure_b: [200, 222], supply: [15, 50], return: [195, 50], ram: [112, 207], spool: [160, 107] };
    for (const [quantity, [x, y]] of Object.entries(place)) {
      const signal = this.signal(actuator, quantity);
      if (signal === null) continue;
      const text = element("text", { x, y });
      svg.append(text);
      readings[quantity] = { signal, text };
    }
    const mode = about.signals.findIndex((signal) => signal.group === "mode" && signal.actuator === actuator);
    const modeText = element("text", { x: 150, y: 149 });
    svg.append(modeText);
    $("schematic").append(svg);
    return { svg, parts, ram, spool, readings, mode, modeText };
  },

  signal(actuator, quantity) {
    const found = about.signals.findIndex((signal) =>
      signal.group === "reading" && signal.actuator === actuator && signal.quantity === quantity);
    return found < 0 ? null : found;
  },

  update() {
    const faulty = new Set((state.injected || []).map((one) => one.fault.slice(0, one.fault.lastIndexOf("."))));
    for (const { parts, ram, spool, readings, mode, modeText, svg } of this.views) {
      for (const part of parts) part.classList.toggle("faulty", faulty.has(part.dataset.component));
      for (const { signal, text } of Object.values(readings)) {
        const value = data.last(signal);
        text.textContent = value === null ? "—" : `${value.toFixed(1)} ${about.signals[signal].unit}`;
      }
      const share = (name) => {
        const reading = readings[name];
        const value = reading ? data.last(reading.signal) : null;
        return value === null ? 0 : Math.max(-1, Math.min(1, value / about.signals[reading.signal].scale));
      };
      ram.setAttribute("x", 146 + 90 * share("ram"));
      spool.setAttribute("x", 142 + 60 * share("spool"));
      const isOn = mode < 0 ? null : data.last(mode);
      modeText.textContent = isOn === null ? "" : isOn > 0.5 ? "active" : "off, damped";
      svg.querySelectorAll("rect").forEach((rect) => rect.classList.toggle("off", isOn !== null && isOn < 0.5));
    }
  },
};

// ---------------------------------------------------------------- faults

const words = (id) => id.replaceAll("_", " ").replaceAll(".", ": ");

function option(value, text) {
  const made = document.createElement("option");
  made.value = value;
  made.textContent = text;
  return made;
}

function fillForm() {
  const faulty = about.components.filter((component) => component.faults.length);
  $("component").replaceChildren(...faulty.map((component) => option(component.id, words(component.id))));
  const first = faulty.find((component) => component.id.endsWith("leakage_a")) || faulty[0];
  if (first) chooseComponent(first.id, false);
  const residuals = indices("residual");
  $("residual").replaceChildren(...residuals.map((k) => option(k, about.signals[k].label)));
}

function chooseComponent(id, isFocused = true) {
  const component = about.components.find((one) => one.id === id);
  if (!component || !component.faults.length) return;
  $("component").value = id;
  const names = component.faults.map((fault) => option(fault.id, `${words(fault.id.split(".").pop())}: ${fault.summary}`));
  $("fault").replaceChildren(...names);
  if (isFocused) $("fault").focus();
}

function ask(request) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
}

function showState(next) {
  state = next;
  document.body.dataset.alarm = state.alarm || "unknown";
  document.body.dataset.finding = state.finding || "";
  $("alarm").textContent = (state.alarm || "…").replaceAll("_", " ");
  $("finding").textContent = words(state.finding || "");
  const actions = state.actions || [];
  const last = actions[actions.length - 1];
  document.body.dataset.action = last ? `${last.actuator} ${last.command}` : "";
  $("action").textContent = last
    ? `Action: ${words(last.command)}${last.actuator ? ` of ${words(last.actuator)}` : ""}${last.detail ? `, ${words(last.detail)}` : ""}.`
    : "No action so far.";
  const injected = state.injected || [];
  const onset = Math.min(...injected.map((one) => one.since_s));
  const latency = last && Number.isFinite(onset) && last.time_s >= onset ? last.time_s - onset : null;
  document.body.dataset.latency = latency === null ? "" : latency.toFixed(2);
  $("reaction-time").textContent = latency === null ? "" : `${latency.toFixed(2)} s after the fault was injected.`;
  $("injected").replaceChildren(...injected.map((one) => {
    const item = document.createElement("li");
    const remove = document.createElement("button");
    remove.type = "button";
    remove.textContent = "Remove";
    remove.setAttribute("aria-label", `Remove ${words(one.fault)}`);
    remove.addEventListener("click", () => ask({ remove: one.fault }));
    item.append(`${words(one.fault)}, ${one.intensity.toFixed(2)}, ${one.onset}`, remove);
    return item;
  }));
  if (!playback) $("pause").textContent = state.is_paused ? "Go on" : "Pause";
  showPath(state.path);
}

/** Speed, pause and length of a replay, which takes no faults; null for a flight. */
function showPlayback(next) {
  playback = next;
  document.body.dataset.mode = playback ? "replay" : "flight";
  $("playback").hidden = !playback;
  $("inject").hidden = $("save").hidden = $("save-page").hidden = $("hint").hidden = Boolean(playback);
  $("restart").textContent = playback ? "From the beginning" : "New flight";
  if (!playback) return;
  $("speed").value = String(playback.speed);
  $("position").max = playback.duration_s;
  $("pause").textContent = playback.is_paused ? "Go on" : "Pause";
  $("connection").textContent = playback.refused ? `refused: ${playback.refused}` : "replay";
}

function showPosition() {
  if (!playback || !data || data.next === null) return;
  const time = data.next * data.periodS;
  if (document.activeElement !== $("position")) $("position").value = time;
  $("position-value").textContent = `${time.toFixed(1)} of ${playback.duration_s.toFixed(1)} s`;
  document.body.dataset.position = time.toFixed(2);
}

function showPath(path) {
  const steps = (path || []).flatMap((stage) => stage.steps.map((step) => ({ ...step, stage: stage.stage })));
  $("path").replaceChildren(...steps.map((step) => {
    const item = document.createElement("li");
    const sign = step.value > step.threshold ? ">" : "≤";
    item.textContent = `${step.stage}: ${step.feature} = ${step.value.toPrecision(3)} ${sign} ${step.threshold.toPrecision(3)}`;
    return item;
  }));
  if (!steps.length) $("path").textContent = "No window has been outside of its bands.";
}

function showEvidence() {
  if (!about || !data) return;
  const rows = indices("evidence").map((k) => {
    const row = document.createElement("label");
    row.className = "bar";
    const meter = document.createElement("meter");
    meter.max = 1.5;
    meter.high = 1;
    meter.value = data.last(k) ?? 0;
    meter.title = "evidence, in parts of the limit";
    row.append(about.signals[k].label, meter);
    return row;
  });
  $("evidence").replaceChildren(...rows);
}

function showEvents(list) {
  for (const event of list) {
    const item = document.createElement("li");
    const { time_s: time, kind, ...more } = event;
    const about = Object.values(more).filter((value) => value !== null && value !== "").map((value) =>
      typeof value === "number" ? Number(value.toPrecision(3)) : words(String(value)));
    item.textContent = `${time.toFixed(2)} s  ${words(kind)}  ${about.join(", ")}`;
    item.dataset.kind = kind;
    $("events").prepend(item);
  }
  while ($("events").childElementCount > 500) $("events").lastElementChild.remove();
}

// ---------------------------------------------------------------- the connection

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/live${query}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    document.body.dataset.connected = "yes";
    $("connection").textContent = "live";
  };
  socket.onmessage = ({ data: message }) => {
    if (message instanceof ArrayBuffer) { data.take(message); return; }
    const said = JSON.parse(message);
    if (said.lost) {
      lost += said.lost;
      $("connection").textContent = `live, ${lost} frames lost: this browser is too slow`;
    }
    if (said.events) {
      data = new Samples(about.signals.length, about.period_s);
      $("events").replaceChildren();
      showEvents(said.events);
    }
    if (said.playback !== undefined) showPlayback(said.playback);
    if (said.event) showEvents([said.event]);
    if (said.state !== undefined) showState(said.state ?? {});
    if (said.refused) $("connection").textContent = `refused: ${said.refused}`;
  };
  socket.onclose = () => {
    document.body.dataset.connected = "no";
    $("connection").textContent = "The connection is lost. Trying again …";
    setTimeout(connect, 1000);
  };
}

async function begin() {
  try {
    const answer = await fetch(`about${query}`);
    if (!answer.ok) throw new Error(await answer.text());
    about = await answer.json();
  } catch (error) {
    $("connection").textContent = `${error.message || error}`;
    setTimeout(begin, 1000);
    return;
  }
  $("title").textContent = about.title;
  document.title = `servotwin: ${about.title}`;
  fillForm();
  schematic.build();
  makeCharts();
  connect();
  setInterval(showEvidence, 200);
  setInterval(showPosition, 100);
  requestAnimationFrame(draw);
}

$("component").addEventListener("change", () => chooseComponent($("component").value));
$("intensity").addEventListener("input", () => { $("intensity-value").textContent = Number($("intensity").value).toFixed(2); });
$("form").addEventListener("submit", (event) => {
  event.preventDefault();
  ask({ inject: { fault: $("fault").value, intensity: Number($("intensity").value), onset: $("onset").value } });
});
$("pause").addEventListener("click", () => ask({ pause: !(playback || state).is_paused }));
$("speed").addEventListener("change", () => ask({ speed: Number($("speed").value) }));
$("position").addEventListener("change", () => { ask({ jump: Number($("position").value) }); $("position").blur(); });
$("save").href = `session${query}`;
$("save-page").href = `page.html${query}`;
$("restart").addEventListener("click", () => ask({ restart: true }));
$("hold").addEventListener("click", () => {
  isHeld = !isHeld;
  $("hold").setAttribute("aria-pressed", String(isHeld));
  $("hold").textContent = isHeld ? "Let the charts go on" : "Hold the charts";
});
$("residual").addEventListener("change", makeCharts);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", makeCharts);
new ResizeObserver(() => plots.forEach(({ plot }) => plot.setSize({ width: $("plots").clientWidth, height: HEIGHT })))
  .observe($("plots"));
begin();
