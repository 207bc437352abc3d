"use strict";
// The page beside a running flight. It keeps the last minute of samples, shows them, and asks the server for faults.

const KEPT_S = 60;

const token = new URLSearchParams(location.search).get("token");
/** What every address of the server ends with. */
const query = token ? `?token=${encodeURIComponent(token)}` : "";

/** An action and its cause in words. */
const answerInWords = ({ action, detail }) => `${words(action)}${detail ? `: ${words(detail)}` : ""}`;
/** The actions that stand: the last one of each kind for each actuator, until a new flight begins. */
const standing = (state) =>
  [...new Map((state?.actions || []).map((action) => [`${action.actuator} ${action.action}`, action])).values()];
/** What stands in one line: "Actuator 1 shut down: external leakage". */
const headline = (state) => {
  const line = standing(state).map((action) => `${words(action.actuator)} ${answerInWords(action)}`.trim()).join("; ");
  return line.charAt(0).toUpperCase() + line.slice(1);
};

/** The alarm of a state; undefined as long as nobody knows it. A silent stream says nothing about its actuator. */
const alarmOf = (state) => (state?.is_silent ? "no_data" : state?.alarm);

let about = null;
let socket = null;
let data = null;
let player = null;
let state = {};
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

/** The signals of a group, by their places. */
const indices = (group) => about.signals.map((signal, k) => (signal.group === group ? k : -1)).filter((k) => k >= 0);

/** What was drawn last: the charts are drawn anew when something else is to be seen. */
let drawn = "";

function draw() {
  const times = data?.columns[0] ?? [];
  const now = `${times.length} ${times.at(-1)} ${$("span").value}`;
  if (times.length && now !== drawn && !player.view) {
    drawn = now;
    [player.columns, player.spanS] = [data.columns, Number($("span").value)];
    player.draw();
    schematic.update();
    const from = times.findIndex((time) => time >= times.at(-1) - player.spanS);
    compareOnce(Math.floor(times.at(-1)), Math.max(0, from));
  }
  requestAnimationFrame(draw);
}

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
    const [own, ghost] = [id, `${id}_ghost`].map((which) => number(rms(of(which)), 2));
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

const option = (value, textContent) => element("option", { value, textContent });

function fillForm() {
  const faulty = about.components.filter((component) => component.faults.length);
  $("component").replaceChildren(...faulty.map((component) => option(component.id, words(component.id))));
  const first = faulty.find((component) => component.id.endsWith("leakage_a")) || faulty[0];
  if (first) chooseComponent(first.id, false);
}

/** Chooses the residual of the sensor that the diagnosis found farthest outside of its band, or else the worst one. */
function showWorst({ worst_sensor: worst, finding }) {
  if (finding === "healthy") return;
  const isWorst = ({ group, lines }) => group === "residual" && about.signals[lines[0]].label === worst;
  player.showResiduals(about.kind === "stream" ? player.worst().slice(0, 1) : player.panels.filter(isWorst));
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
  const alarm = alarmOf(state);
  const actions = state.actions || [];
  document.body.dataset.alarm = actions.length ? "raised" : alarm || "unknown";
  document.body.dataset.finding = state.finding || "";
  // What an action found stays, though the diagnosis has nothing new to say after it.
  const now = words(alarm || "…");
  $("alarm").textContent = headline(state) || now;
  $("finding").textContent = words(`${actions.length ? `now ${now}, ` : ""}${state.finding || ""}`);
  const last = actions[actions.length - 1];
  document.body.dataset.action = last ? `${last.actuator} ${last.action}` : "";
  showActions();
  showWorst(state);
  const injected = state.injected || [];
  const onset = Math.min(...injected.map((one) => one.since_s));
  const latency = last && Number.isFinite(onset) && last.time_s >= onset ? last.time_s - onset : null;
  document.body.dataset.latency = latency === null ? "" : latency.toFixed(2);
  showInjected();
  if (socket.readyState === WebSocket.OPEN && !lost) {
    $("connection").textContent = state.is_paused ? "paused for all viewers" : "live";
  }
  $("pause").textContent = state.is_paused ? "Go on" : "Pause";
  if (data) schematic.update();
}

/** Each action of an actuator stands until a new flight, whatever the diagnosis says of the present. */
function showActions() {
  const items = standing(state).map(({ actuator, action, detail, time_s: time }) => {
    const item = element("p");
    const strong = element("strong", { textContent: `${words(actuator) || "the actuator"}: ${words(action)}` });
    const effect = (about.effects || {})[action];
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
function besideStudy(fault, { action, detail }) {
  const known = about.components.flatMap(({ faults }) => faults).find(({ id }) => id === fault);
  if (!known?.answer) return "; the study has no such fault";
  const isRight = known.answer.action === action && (!detail || known.answer.detail === detail);
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
  const [item, text, what, outcome] = ["li", "span", "span", "small"].map((name) => element(name));
  const remove = element("button", { type: "button", textContent: "Remove" });
  remove.setAttribute("aria-label", `Remove ${words(fault)}`);
  remove.addEventListener("click", () => ask({ remove: fault }));
  text.append(what, outcome);
  item.append(text, remove);
  $("injected").append(item);
  return { item, what, outcome };
}

function showEvidence() {
  if (!about || !data) return;
  const rows = indices("evidence").map((k) => {
    const row = element("label", { className: "bar" });
    const title = "evidence, in parts of the limit";
    row.append(about.signals[k].label, element("meter", { max: 1.5, high: 1, value: data.last(k) ?? 0, title }));
    return row;
  });
  $("evidence").replaceChildren(...rows);
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
    if (said.events) data = new Samples(about.signals.length, about.period_s);
    const events = said.events ?? said.all_events;
    if (events) {
      player.forget();
      player.take(events);
    }
    if (said.event) player.take([said.event]);
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
  // What is measured takes no faults.
  for (const id of ["inject", "hint", "pause", "restart"]) $(id).hidden = about.kind === "stream";
  const isShown = (end) => about.signals.some(({ id }) => id.endsWith(end));
  $("ghost-hint").hidden = !isShown("_ghost");
  $("fight-hint").hidden = !isShown("fight");
  document.title = `servotwin: ${about.title}`;
  fillForm();
  schematic.build();
  player = new Player(about, Number($("span").value));
  player.showResiduals(player.panels.filter(({ group }) => group === "residual").slice(0, 1));
  connect();
  setInterval(showEvidence, 200);
  setInterval(showInjected, 500);
  requestAnimationFrame(draw);
}

$("component").addEventListener("change", () => chooseComponent($("component").value));
$("intensity").addEventListener("input", () => { $("intensity-value").textContent = Number($("intensity").value).toFixed(2); });
$("form").addEventListener("submit", (event) => {
  event.preventDefault();
  ask({ inject: { fault: $("fault").value, intensity: Number($("intensity").value), onset: $("onset").value } });
});
$("pause").addEventListener("click", () => ask({ pause: !state.is_paused }));
$("save").href = `session${query}`;
$("save-page").href = `page.html${query}`;
$("restart").addEventListener("click", () => ask({ restart: true }));
begin();
