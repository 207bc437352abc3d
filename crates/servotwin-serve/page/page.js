"use strict";
// The page beside a running flight. It keeps the last minute of samples, draws them, and asks the server for faults.

const KEPT_S = 60;
const HEIGHT = 128;

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
/** What the charts show: they are drawn anew when this changes. */
let drawn = "";
/** What happened in this flight, to be marked in the charts: time in s, and kind. */
let marks = [];

function indices(group) {
  return about.signals.map((signal, k) => [signal, k]).filter(([signal]) => signal.group === group).map(([, k]) => k);
}

function chart(title, signals, { band = null, limit = null, isCentered = true, colors = ["--command", "--own", "--ghost"] } = {}) {
  const unit = about.signals[signals[0]].unit;
  const bandColor = color("--band");
  const markColors = { inject: color("--ghost"), remove: color("--faint"), action: color("--bad") };
  const axis = { stroke: color("--faint"), grid: { stroke: color("--line"), width: 1 }, ticks: { stroke: color("--line") } };
  const lines = signals.map((signal, k) => ({
    label: about.signals[signal].label,
    stroke: color(colors[k % colors.length]),
    width: 1.5,
    dash: about.signals[signal].id.endsWith("ghost") ? [6, 4] : undefined,
    points: { show: (u, series, from, to, gaps) => (to - from < 3 ? true : false) },
    value: (u, value) => (value === null ? "—" : rounded(value, 4)),
  }));
  const hooks = {
    draw: [(u) => {
      const edges = band !== null ? [-band, band] : limit !== null ? [limit] : [];
      const context = u.ctx;
      const { left, top, width, height } = u.bbox;
      const line = (fromX, fromY, toX, toY) => {
        context.beginPath();
        context.moveTo(fromX, fromY);
        context.lineTo(toX, toY);
        context.stroke();
      };
      context.save();
      context.strokeStyle = bandColor;
      context.setLineDash([4, 4]);
      for (const edge of edges) {
        const y = u.valToPos(edge, "y", true);
        line(left, y, left + width, y);
      }
      for (const { time, kind } of marks) {
        const x = u.valToPos(time, "x", true);
        if (x < left || x > left + width) continue;
        context.strokeStyle = markColors[kind];
        line(x, top, x, top + height);
      }
      context.restore();
    }],
    // A zoom would be lost with the next frame.
    setSelect: [(u) => { if (u.select.width > 0 && !isHeld) hold(true); }],
  };
  const widest = (u, low, high) => {
    if (limit !== null) return [0, Math.max(1.6 * limit, 1.1 * (high ?? 0))];
    if (!isCentered) {
      const pad = Math.max(0.1 * ((high ?? 0) - (low ?? 0)), 1e-3);
      return [(low ?? 0) - pad, (high ?? 0) + pad];
    }
    const least = band === null ? 1e-3 : 1.3 * band;
    const top = Math.max(Math.abs(low ?? 0), Math.abs(high ?? 0), least);
    return [-1.1 * top, 1.1 * top];
  };
  const options = {
    title: `${title} / ${unit}`,
    width: $("plots").clientWidth || 600,
    height: HEIGHT,
    legend: { show: true, live: true },
    cursor: { sync: { key: "flight" }, drag: { x: true, y: false } },
    scales: { x: { time: false }, y: { range: widest } },
    axes: [{ ...axis, size: 26, values: (u, splits) => splits.map((s) => `${s} s`) }, { ...axis, size: 62, space: 16 }],
    series: [{ label: "at", value: (u, time) => (time === null ? "—" : `${time.toFixed(2)} s`) }, ...lines],
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
  drawn = "";
  if (!about) return;
  const motion = indices("motion");
  if (motion.length) plots.push(chart("Command and answer", motion));
  const evidence = indices("evidence");
  const hues = ["--own", "--ghost", "--bad", "--band", "--second", "--third"];
  if (evidence.length) plots.push(chart("Evidence", evidence, { limit: 1, colors: hues }));
  const fight = indices("fight");
  if (fight.length) plots.push(chart("Force fight", fight, { colors: ["--own", "--ghost"] }));
  for (const k of chosen()) {
    const { group, label, band } = about.signals[k];
    const isCentered = group === "residual";
    const title = isCentered ? `Residual of ${label}` : label;
    plots.push(chart(title, [k], { band, isCentered, colors: ["--own"] }));
  }
}

/** Holds the charts of this viewer, or lets them go on. */
function hold(isToHold) {
  isHeld = isToHold;
  $("hold").setAttribute("aria-pressed", String(isHeld));
  $("hold").textContent = isHeld ? "Let the charts go on" : "Hold the charts";
}

/** Whether there is something else to draw than last time. */
function isNew() {
  if (isHeld || !data || !data.columns[0].length) return false;
  const times = data.columns[0];
  const now = `${times.length} ${times[times.length - 1]} ${$("span").value}`;
  const before = drawn;
  drawn = now;
  return now !== before;
}

function draw() {
  if (isNew()) {
    const times = data.columns[0];
    const from = times.findIndex((time) => time >= times[times.length - 1] - Number($("span").value));
    for (const { plot, signals } of plots) {
      const own = [times, ...signals.map((signal) => data.columns[signal + 1])];
      plot.setData(thinned(own, Math.max(0, from), plot.bbox.width / devicePixelRatio));
    }
    schematic.update();
    compareOnce(Math.floor(times[times.length - 1]), Math.max(0, from));
  }
  requestAnimationFrame(draw);
}

/** A number with a few digits; what rounding left of a zero is one. */
const rounded = (value, digits) => (Math.abs(value) < 1e-6 ? "0" : String(Number(value.toPrecision(digits))));

let compared = null;

/** Compares at most once a second of the flight: nobody reads numbers that change with every frame. */
function compareOnce(second, from) {
  const now = `${second} ${$("span").value}`;
  if (now !== compared) compare(from);
  compared = now;
}

/** Says in numbers what the diagnosis changes: the flight beside the same one without it, over the time that is shown. */
function compare(from) {
  const shown = (id) => data.columns[about.signals.findIndex((signal) => signal.id === id) + 1].slice(from);
  const unit = (id) => about.signals.find((signal) => signal.id === id).unit;
  const rms = (values) => {
    const known = values.filter((value) => value !== null);
    return Math.sqrt(known.reduce((sum, value) => sum + value * value, 0) / known.length);
  };
  const error = (id) => {
    const wanted = shown("command");
    return shown(id).map((value, k) => (value === null || wanted[k] === null ? null : value - wanted[k]));
  };
  const pairs = [
    ["tracking error", "position", error],
    ["force fight", "fight", shown],
  ].filter(([, id]) => about.signals.some((signal) => signal.id === `${id}_ghost`));
  const told = pairs.map(([name, id, of]) => {
    const [own, ghost] = [id, `${id}_ghost`].map((which) => rounded(rms(of(which)), 2));
    return `${name} ${own} ${unit(id)} (${ghost} ${unit(id)} without diagnosis)`;
  });
  const fluids = about.signals.filter(({ group, id }) => group === "fluid" && !id.endsWith("_ghost"));
  const left = fluids.map(({ id, label, unit: litres }) => {
    const [own, ghost] = [id, `${id}_ghost`].map((which) => (shown(which).at(-1) ?? NaN).toFixed(2));
    return `${label} ${own} ${litres} (${ghost} ${litres} without diagnosis)`;
  });
  const sentences = [["Root mean square of the time shown", told], ["Fluid left", left]];
  $("comparison").hidden = !told.length;
  $("comparison").textContent = sentences.filter(([, list]) => list.length)
    .map(([what, list]) => `${what}: ${list.join(", ")}.`).join(" ");
}

// ---------------------------------------------------------------- schematic

/** The drawing of the system. The server draws it, and the page colors its parts by their names. */
const schematic = {
  parts: [],

  build() {
    const drawn = new DOMParser().parseFromString(about.schematic || "", "image/svg+xml").documentElement;
    $("schematic").replaceChildren(...(drawn.nodeName === "svg" ? [drawn] : []));
    this.parts = [...$("schematic").querySelectorAll("[data-component]")];
    const takesFaults = (part) => about.components.some(({ id, faults }) => id === part.dataset.component && faults.length);
    this.walk(this.parts.filter(takesFaults));
  },

  /** The drawing is one stop of the Tab key; arrows lead from part to part, and Enter or a click chooses one. */
  walk(parts) {
    const steps = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1, Home: -Infinity, End: Infinity };
    parts.forEach((part, place) => {
      const id = part.dataset.component;
      const given = { class: "touch", role: "button", "aria-label": words(id), tabindex: place ? -1 : 0 };
      for (const [key, value] of Object.entries(given)) part.setAttribute(key, value);
      part.addEventListener("click", () => chooseComponent(id));
      part.addEventListener("focus", () => parts.forEach((one) => one.setAttribute("tabindex", one === part ? 0 : -1)));
      part.addEventListener("keydown", (event) => {
        const isChosen = event.key === "Enter" || event.key === " ";
        if (!isChosen && !(event.key in steps)) return;
        event.preventDefault();
        if (isChosen) chooseComponent(id);
        else parts[Math.max(0, Math.min(parts.length - 1, place + steps[event.key]))].focus();
      });
    });
  },

  update() {
    const faulty = new Set((state.injected || []).map((one) => one.fault.slice(0, one.fault.lastIndexOf("."))));
    const isOff = (k) => (data.last(k) ?? 1) < 0.5;
    const names = indices("mode").filter(isOff).map((k) => about.actuators[about.signals[k].actuator]);
    const off = names.map((name) => (name ? `${name}.` : ""));
    for (const { classList, dataset } of this.parts) {
      classList.toggle("faulty", faulty.has(dataset.component));
      classList.toggle("off", off.some((name) => dataset.component.startsWith(name)));
    }
  },
};

// ---------------------------------------------------------------- faults

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
  fillChooser();
}

/** Whether the viewer has chosen charts: then no other choice is made for it. */
let isChosenByHand = false;

/** Chooses the residual of the sensor that is farthest outside of its band. */
function showWorst({ worst_sensor: worst, finding }) {
  if (isChosenByHand || !worst || finding === "healthy") return;
  const boxes = [...$("choices").querySelectorAll("input")];
  const isWorst = ({ value }) => about.signals[value].group === "residual" && about.signals[value].label === worst;
  const box = boxes.find(isWorst);
  if (!box || box.checked) return;
  boxes.forEach((one) => { one.checked = one === box; });
  makeCharts();
}

/** A box for each residual and each reading; the first residual is chosen. */
function fillChooser() {
  const fields = [["residual", "Residuals"], ["reading", "Readings"]].map(([group, title]) => {
    const field = document.createElement("fieldset");
    const legend = document.createElement("legend");
    legend.textContent = title;
    const boxes = indices(group).map((k, place) => {
      const label = document.createElement("label");
      const box = document.createElement("input");
      box.type = "checkbox";
      box.value = k;
      box.checked = group === "residual" && place === 0;
      box.addEventListener("change", () => { isChosenByHand = true; makeCharts(); });
      label.append(box, ` ${about.signals[k].label}`);
      return label;
    });
    field.append(legend, ...boxes);
    return field;
  });
  $("choices").replaceChildren(...fields);
}

/** The signals whose boxes are checked. */
const chosen = () => [...$("choices").querySelectorAll("input:checked")].map((box) => Number(box.value));

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
  const alarm = alarmOf(state);
  const actions = state.actions || [];
  document.body.dataset.alarm = actions.length ? "raised" : alarm || "unknown";
  document.body.dataset.finding = state.finding || "";
  // What an action found stays, though the diagnosis has nothing new to say after it.
  const now = words(alarm || "…");
  $("alarm").textContent = headline(state) || now;
  $("finding").textContent = words(`${actions.length ? `now ${now}, ` : ""}${state.finding || ""}`);
  const last = actions[actions.length - 1];
  document.body.dataset.action = last ? `${last.actuator} ${last.command}` : "";
  showActions();
  showWorst(state);
  const injected = state.injected || [];
  const onset = Math.min(...injected.map((one) => one.since_s));
  const latency = last && Number.isFinite(onset) && last.time_s >= onset ? last.time_s - onset : null;
  document.body.dataset.latency = latency === null ? "" : latency.toFixed(2);
  showInjected();
  if (!playback && socket && socket.readyState === WebSocket.OPEN && !lost) {
    $("connection").textContent = state.is_paused ? "paused for all viewers" : "live";
  }
  if (!playback) $("pause").textContent = state.is_paused ? "Go on" : "Pause";
  if (data) schematic.update();
  showPath(state.path);
}

/** Each action of an actuator stands until a new flight, whatever the diagnosis says of the present. */
function showActions() {
  const items = standing(state).map(({ actuator, command, detail, time_s: time }) => {
    const item = document.createElement("p");
    const strong = document.createElement("strong");
    strong.textContent = `${words(actuator) || "the actuator"}: ${words(command)}`;
    const effect = (about.effects || {})[command];
    item.append(strong, ` at ${time.toFixed(2)} s${detail ? `, because of ${words(detail)}` : ""}.${effect ? ` ${effect}` : ""}`);
    return item;
  });
  $("action").replaceChildren(...items);
  if (!items.length) $("action").textContent = "No action so far.";
}

/** The rows of faults that act, by name: a row stays, so that it can be clicked while the state changes. */
const rows = new Map();

/** What became of a fault: the answer of its actuator beside the one of the study, or for how long there is none. */
function outcomeOf({ fault, since_s: since }) {
  const own = (action) => action.time_s >= since && (!action.actuator || fault.startsWith(`${action.actuator}.`));
  const answer = (state.actions || []).find(own);
  if (answer) {
    return `answered after ${(answer.time_s - since).toFixed(2)} s: ${answerInWords(answer)}${besideStudy(fault, answer)}`;
  }
  const now = data && data.next !== null ? data.next * data.periodS : since;
  const isAlone = (state.injected || []).length < 2;
  return `no answer for ${Math.max(0, now - since).toFixed(0)} s${isAlone ? "" : "; the diagnosis learned one fault at a time"}`;
}

/** Whether an answer to a fault is the one that the study calls for. */
function besideStudy(fault, { command, detail }) {
  const known = about.components.flatMap(({ faults }) => faults).find(({ id }) => id === fault);
  if (!known?.answer) return "; the study has no such fault";
  const isRight = known.answer.command === command && (!detail || known.answer.detail === detail);
  return isRight ? ", which is right" : `; right would be ${answerInWords(known.answer)}`;
}

function showInjected() {
  const injected = state.injected || [];
  for (const [name, row] of rows) {
    if (!injected.some((one) => one.fault === name)) { row.item.remove(); rows.delete(name); }
  }
  for (const one of injected) {
    if (!rows.has(one.fault)) rows.set(one.fault, injectedRow(one.fault));
    const { what, outcome } = rows.get(one.fault);
    what.textContent = `${words(one.fault)}, ${one.intensity.toFixed(2)}, ${one.onset}`;
    outcome.textContent = outcomeOf(one);
  }
}

function injectedRow(fault) {
  const item = document.createElement("li");
  const [text, what, outcome] = ["span", "span", "small"].map((name) => document.createElement(name));
  const remove = document.createElement("button");
  remove.type = "button";
  remove.textContent = "Remove";
  remove.setAttribute("aria-label", `Remove ${words(fault)}`);
  remove.addEventListener("click", () => ask({ remove: fault }));
  text.append(what, outcome);
  item.append(text, remove);
  $("injected").append(item);
  return { item, what, outcome };
}

/** Speed, pause and length of a replay, which takes no faults; null for a flight and for a stream, which has no controls. */
function showPlayback(next) {
  playback = next;
  document.body.dataset.mode = playback ? "replay" : "flight";
  $("playback").hidden = !playback;
  // A saved stream is replayed like any session.
  const isMeasured = about.kind === "stream" && !playback;
  $("inject").hidden = $("hint").hidden = Boolean(playback) || isMeasured;
  $("pause").hidden = $("restart").hidden = isMeasured;
  $("save").hidden = $("save-page").hidden = Boolean(playback) && about.kind !== "log";
  $("save-mcap").hidden = $("save").hidden || !about.formats?.includes("session.mcap");
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

/** A value of an event as viewers read it. */
function told(key, value) {
  if (key === "confidence") return `${Math.round(100 * value)} % sure`;
  if (key === "after_s") return `after ${value.toFixed(2)} s`;
  if (key === "at") return value;
  return typeof value === "number" ? Number(value.toPrecision(3)) : words(String(value));
}

function showEvents(list) {
  for (const event of list) {
    if (event.kind === "begin") marks = [];
    if (["inject", "remove", "action"].includes(event.kind)) marks.push({ time: event.time_s, kind: event.kind });
    const item = document.createElement("li");
    const { time_s: time, kind, ...more } = event;
    const given = Object.entries(more).filter(([, value]) => value !== null && value !== "");
    const about = given.map(([key, value]) => told(key, value));
    item.textContent = `${time.toFixed(2)} s  ${words(kind)}  ${about.join(", ")}`;
    item.dataset.kind = kind;
    $("events").prepend(item);
  }
  while ($("events").childElementCount > 500) $("events").lastElementChild.remove();
}

// ---------------------------------------------------------------- the connection

function connect() {
  const target = new URL(`live${query}`, location.href);
  target.protocol = target.protocol.replace("http", "ws");
  socket = new WebSocket(target);
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
    if (said.all_events) {
      $("events").replaceChildren();
      showEvents(said.all_events);
    }
    if (said.events) {
      data = new Samples(about.signals.length, about.period_s);
      $("events").replaceChildren();
      marks = [];
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
  $("save-mcap").href = `session.mcap${query}`;
  const isShown = (end) => about.signals.some(({ id }) => id.endsWith(end));
  $("ghost-hint").hidden = !isShown("_ghost");
  $("fight-hint").hidden = !isShown("fight");
  $("fleet").hidden = !/^\/\d+\/$/.test(location.pathname);
  $("fleet").href = `../${query}`;
  document.title = `servotwin: ${about.title}`;
  fillForm();
  schematic.build();
  makeCharts();
  connect();
  setInterval(showEvidence, 200);
  setInterval(showPosition, 100);
  setInterval(showInjected, 500);
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
$("hold").addEventListener("click", () => hold(!isHeld));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", makeCharts);
new ResizeObserver(() => plots.forEach(({ plot }) => plot.setSize({ width: $("plots").clientWidth, height: HEIGHT })))
  .observe($("plots"));
begin();
