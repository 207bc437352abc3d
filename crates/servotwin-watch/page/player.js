"use strict";
// Draws signals over time: one axis with the states of the diagnosis on top, which stays in sight, and charts below. A
// finished record is shown whole. A live page shows its last seconds, until its viewer zooms.

const $ = (id) => document.getElementById(id);
/** A name as readers read it. */
const words = (id) => id.replaceAll("_", " ").replaceAll(".", ": ");
const element = (tag, content = {}) => Object.assign(document.createElement(tag), content);
const number = (v, digits = 4) => (v === null || !Number.isFinite(v) ? "—" : Math.abs(v) < 1e-6 ? "0"
  : Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3 ? v.toExponential(2) : String(+v.toPrecision(digits)));
/** A time, s, as the program writes it: as a date if it counts from 1970. */
const moment = (s) => (s > 1e8 ? new Date(Math.round(1e3 * s)).toISOString().replace("T", " ").replace("Z", "") : `${s.toFixed(2)} s`);

const LEFT = 64, RIGHT = 8, FONT = "11px system-ui, sans-serif";
/** Groups whose signals are in one chart. */
const TOGETHER = { motion: "Command and answer", evidence: "Evidence", fight: "Force fight", fluid: "Fluid left" };
const GROUPS = { motion: "Motion", evidence: "Evidence", fight: "Force fight", input: "Inputs", residual: "Residuals",
  reading: "Readings", fluid: "Fluid" };
const HUES = ["--own", "--ghost", "--bad", "--band", "--second", "--third"];
const MARKS = { inject: "--ghost", remove: "--faint", action: "--bad", finding: "--second", clock: "--ink" };

const colors = new Map();
/** A color that depends on the theme, computed by the browser: a variable, or the one of a state. */
function color(name) {
  if (colors.has(name)) return colors.get(name);
  const probe = element("span", name.startsWith("--") ? {} : { className: `state ${name}` });
  if (name.startsWith("--")) probe.style.color = `var(${name})`;
  document.body.append(probe);
  const found = getComputedStyle(probe).color;
  probe.remove();
  colors.set(name, found);
  return found;
}

/**
 * Thins a span to at most two samples a pixel: the smallest and the largest of each, so that no peak is lost. A null
 * stays, so that a gap stays a gap.
 */
function thinned(columns, from, to, pixels) {
  const size = Math.ceil((to - from) / Math.max(1, pixels));
  if (size <= 2) return columns.map((column) => column.slice(from, to));
  const out = columns.map(() => []);
  for (let begin = from; begin < to; begin += size) {
    const end = Math.min(begin + size, to);
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

/** A value of an event as readers read it. */
function told(key, value) {
  if (key === "confidence") return value > 0 ? `${Math.round(100 * value)} % sure` : "";
  if (key === "after_s") return `after ${value.toFixed(2)} s`;
  if (Array.isArray(value)) return value.join("; ");
  if (typeof value === "number") return number(value, 3);
  return /^[\w.]+$/.test(value) ? words(value) : String(value);
}

/** The charts of a record or a flight. `columns` holds the times, then the values of each signal; null is a gap. */
class Player {
  /** `spanS` is how much of the end is shown; `stretches` are the beginnings of parts with a clock of their own. */
  constructor({ signals, stretches = [[0, 0]] }, spanS = Infinity) {
    Object.assign(this, { signals, stretches, spanS, columns: [[], ...signals.map(() => [])] });
    Object.assign(this, { view: null, explainedMs: 0, isPaper: false, isChosen: false });
    this.forget();
    this.panels = [{ group: "state", title: "State", unit: "", lines: [], isShown: true }];
    signals.forEach((signal, k) => this.add(signal, k));
    $("plots").onkeydown = (event) => this.key(event);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(true));
    new ResizeObserver(() => { if (this.width !== $("plots").clientWidth) this.draw(true); }).observe($("plots"));
    const button = (textContent, title, onclick) =>
      $("tools").append(element("button", { type: "button", textContent, title, onclick }));
    button("+", "closer", () => this.zoom(0.5));
    button("−", "further", () => this.zoom(2));
    button("all", "everything, and what comes", () => this.look(null));
    this.choices();
  }

  /** Adds a signal to its chart: with others of its group, or with its twin. */
  add(signal, k) {
    const { group, label, unit, band } = signal;
    if (group === "mode") return;
    const title = TOGETHER[group] ?? (group === "residual" ? `Residual of ${label}` : label);
    const known = this.panels.find((panel) => panel.title === title && (TOGETHER[group] || group === "twin"));
    if (known) known.lines.push(k);
    else this.panels.push({ group, title, unit, band, lines: [k], isShown: ["motion", "evidence", "fight"].includes(group) });
  }

  /** A box for each chart. What is chosen by hand stays. */
  choices() {
    const fields = Object.entries(GROUPS).map(([group, title]) => {
      const field = element("fieldset");
      field.append(element("legend", { textContent: title }));
      for (const panel of this.panels.filter((one) => one.group === group)) {
        panel.box = element("input", { type: "checkbox", checked: panel.isShown });
        panel.box.onchange = () => { panel.isShown = panel.box.checked; this.isChosen = true; this.draw(true); };
        const label = element("label");
        label.append(panel.box, ` ${panel.title}`);
        field.append(label);
      }
      return field;
    });
    $("choices").replaceChildren(...fields.filter((field) => field.childElementCount > 1));
  }

  /** Shows these residuals alone, unless the viewer has chosen. */
  showResiduals(chosen) {
    const residuals = this.panels.filter(({ group }) => group === "residual");
    if (this.isChosen || !chosen.length || residuals.every((panel) => panel.isShown === chosen.includes(panel))) return;
    for (const panel of residuals) {
      panel.isShown = panel.box.checked = chosen.includes(panel);
    }
    this.draw(true);
  }

  /** The residuals, the one farthest outside of its band first. */
  worst() {
    const residuals = this.panels.filter(({ group }) => group === "residual");
    const largest = (values) => values.reduce((most, value) => Math.max(most, Math.abs(value ?? 0)), 0);
    const share = ({ lines, band }) => largest(this.columns[lines[0] + 1]) / (band ?? 1);
    return residuals.map((panel) => [panel, share(panel)]).sort(([, one], [, other]) => other - one).map(([panel]) => panel);
  }

  /** Before the first event of a flight. */
  begin() {
    this.states = [];
    this.marks = this.stretches.slice(1).map(([time]) => ({ time, kind: "clock" }));
  }

  forget() {
    this.begin();
    $("events").replaceChildren();
  }

  /** Lists events, and marks what they say in the charts: states, the first finding of a fault, faults and actions. */
  take(events) {
    for (const event of events) {
      const { time_s: time, kind, at, ...more } = event;
      if (kind === "begin" && !time) this.begin();
      // What is not judged is not healthy.
      const state = more.finding === "not judged" ? "no_data" : more.state ?? more.alarm;
      if (kind === "finding") {
        const isQuiet = (name) => !["detected", "isolated", "unknown", "pending", "raised"].includes(name);
        if (isQuiet(this.states.at(-1)?.state) && !isQuiet(state)) this.marks.push({ time, kind });
        this.states.push({ time, state, words: told("finding", more.finding || state) });
      } else if (kind in MARKS) this.marks.push({ time, kind });
      const given = Object.entries(more).filter(([key, value]) => value !== null && value !== "" && key !== "state");
      const text = given.map(([key, value]) => told(key, value)).filter(Boolean).join(", ");
      const item = element("li", { textContent: `${at ?? `${time.toFixed(2)} s`}  ${words(kind)}  ${text}` });
      item.dataset.kind = kind;
      item.onclick = () => this.look([time - 5, time + 5]);
      $("events").prepend(item);
    }
    while ($("events").childElementCount > 1000) $("events").lastElementChild.remove();
  }

  /** The first and the last time that is shown, s. */
  window() {
    const times = this.columns[0], [first, last] = [times[0] ?? 0, times.at(-1) ?? 1];
    if (!this.view) return [Math.max(first, last - this.spanS), Math.max(last, first + 0.01)];
    const length = Math.max(0.05, Math.min(this.view[1] - this.view[0], last - first));
    const begin = Math.max(first, Math.min(this.view[0], last - length));
    return [begin, begin + length];
  }

  look(view) {
    [this.view, this.explainedMs] = [view, 0];
    this.draw();
  }

  zoom(factor, by = 0) {
    const [from, to] = this.window(), middle = (from + to) / 2 + by * (to - from), half = factor * (to - from) / 2;
    this.look([middle - half, middle + half]);
  }

  key(event) {
    const act = { ArrowLeft: () => this.zoom(1, -0.2), ArrowRight: () => this.zoom(1, 0.2), "+": () => this.zoom(0.5),
      "-": () => this.zoom(2), 0: () => this.look(null) }[event.key];
    if (act) { event.preventDefault(); act(); }
  }

  /** Draws what is chosen. A chart that is drawn anew takes the size and the colors of its page. */
  draw(isNew = false) {
    const [from, to] = this.window(), times = this.columns[0];
    const found = [times.findIndex((time) => time >= from), times.findLastIndex((time) => time <= to)];
    const [first, end] = [Math.max(0, found[0] - 1), Math.min(times.length, found[1] + 2)];
    const wide = $("plots").clientWidth || 600;
    isNew ||= this.width !== wide;
    this.width = wide;
    const width = this.isPaper ? 680 : wide;
    if (isNew) colors.clear();
    if (isNew || performance.now() - this.explainedMs > 1000) this.explainedMs = 0;
    for (const panel of this.panels) {
      const isShown = panel.isShown || (this.isPaper && panel.group === "residual");
      if (panel.plot && (isNew || !isShown)) { panel.plot.destroy(); panel.node.remove(); panel.plot = null; }
      if (!isShown) continue;
      if (!panel.plot) this.make(panel, width);
      const own = panel.lines.length ? panel.lines.map((k) => this.columns[k + 1] ?? []) : [times.map(() => null)];
      panel.plot.setData(thinned([times, ...own], first, end, width - LEFT - RIGHT));
      if (!this.explainedMs) this.explain(panel, first, end);
    }
    this.explainedMs ||= performance.now();
  }

  /** Says what a residual is: how far the sensor is from its twin, and on which side. */
  explain({ group, lines, band, says, unit }, first, end) {
    if (group !== "residual" || !band) return;
    const values = this.columns[lines[0] + 1];
    let worst = first;
    for (let k = first; k < end; k++) if (Math.abs(values[k] ?? 0) > Math.abs(values[worst] ?? 0)) worst = k;
    const share = (values[worst] ?? 0) / band, side = share > 0 ? "above" : "below";
    const [label, when] = [this.signals[lines[0]].label, moment(this.time(this.columns[0][worst] ?? 0))];
    says.textContent = Math.abs(share) <= 1 ? `${unit} · ${label} stays within its band of the twin`
      : `${unit} · ${label} is up to ${number(Math.abs(share), 2)} times its band ${side} what the twin expects, at ${when}`;
  }

  /** The time on the clock of the record. */
  time(at) {
    const [begin, starts] = this.stretches.findLast(([time]) => time <= at + 1e-9) ?? [0, 0];
    return starts + at - begin;
  }

  /** Marks of the axis of time: each stretch has its own times, which are round. */
  splits(min, max, step) {
    let free = -Infinity;
    return this.stretches.flatMap(([begin, starts], k) => {
      const to = Math.min(this.stretches[k + 1]?.[0] ?? Infinity, max), shift = starts - begin, all = [];
      for (let n = Math.ceil((Math.max(begin, min) + shift) / step - 1e-6); n * step - shift <= to + 1e-9; n++) all.push(n * step - shift);
      return all.filter((at) => at - free > 0.8 * step && (free = at, true));
    });
  }

  mark(at) {
    const time = this.time(at);
    return time > 1e8 ? moment(time).slice(11, 23) : `${number(time, 12)} s`;
  }

  make(panel, width) {
    const { group, title, unit, band, lines } = panel, isState = !lines.length;
    const node = panel.node = element("div", { className: `panel ${group}` });
    node.setAttribute("role", "img");
    node.setAttribute("aria-label", `${title} over time`);
    const [head, chart] = [element("p"), element("div")];
    panel.says = element("span", { textContent: unit });
    panel.reads = element("span");
    head.append(element("b", { textContent: title }), panel.says, panel.reads);
    node.append(head, chart);
    const after = this.panels.slice(this.panels.indexOf(panel) + 1).find((one) => one.plot);
    $("plots").insertBefore(node, after?.node ?? null);
    const stroke = color("--faint"), grid = { stroke: color("--line"), width: 1, show: !isState };
    const axis = { stroke, font: FONT, grid, ticks: { show: false } };
    const name = (k) => this.signals[k].group === "twin" ? "twin" : this.signals[k].label;
    const read = (u) => {
      const k = u.cursor.idx ?? u.data[0].length - 1, at = u.data[0][k];
      // Of many lines the highest is read.
      const value = (own) => u.data[own + 1][k] ?? null, all = lines.map((line, own) => own);
      const shown = all.length > 3 ? all.sort((one, other) => value(other) - value(one)).slice(0, 1) : all;
      const values = shown.map((own) => `${lines.length > 1 ? `${name(lines[own])} ` : ""}${number(value(own))}`);
      const state = this.states.findLast(({ time }) => time <= at + 1e-9)?.words ?? "";
      panel.reads.textContent = at === undefined ? "" : isState ? `${moment(this.time(at))}  ${state}` : values.join("  |  ");
    };
    const select = (u) => {
      const { left, width: wide } = u.select;
      if (wide > 4) this.look([u.posToVal(left, "x"), u.posToVal(left + wide, "x")]);
      else u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    };
    const dash = (k) => (/ghost$|^twin/.test(this.signals[k].id) || this.signals[k].group === "twin" ? [6, 4] : undefined);
    const marks = { ...axis, size: 18, gap: 2, space: 90, values: (u, all) => all.map((at) => this.mark(at)),
      splits: (u, place, min, max, step) => this.splits(min, max, step) };
    const values = { ...axis, size: LEFT, space: 13, gap: 6, values: (u, all) => all.map((v) => (isState ? "" : number(v, 12))) };
    const line = (k, own) => ({ stroke: color(HUES[own % HUES.length]), width: 1.4, dash: dash(k), points: { show: false } });
    const edges = group === "evidence" ? [1] : band ? [-band, band] : [];
    panel.plot = new uPlot({
      width, height: isState ? 48 : lines.length > 1 ? 96 : 68, padding: [6, RIGHT, 6, 0], legend: { show: false },
      cursor: { y: false, points: { show: false }, sync: { key: "player" }, drag: { x: true, y: false, setScale: false },
        bind: { dblclick: () => () => this.look(null) } },
      scales: { x: { time: false, range: () => this.window() }, y: { range: (u, low, high) => this.range(panel, low, high) } },
      axes: [isState ? marks : { show: false }, values],
      series: [{}, ...(isState ? [{}] : lines.map(line))],
      hooks: { drawAxes: isState ? [(u) => this.drawStates(u)] : [], draw: [(u) => this.drawMarks(u, edges)],
        setCursor: [read], setData: [read], setSelect: [select] },
    }, [[], ...(isState ? [[]] : lines.map(() => []))], chart);
  }

  range({ group, band, lines }, low, high) {
    if (!lines.length) return [0, 1];
    if (group === "evidence") return [0, Math.max(1.6, 1.1 * (high ?? 0))];
    if (band) [low, high] = [Math.min(low ?? 0, -1.2 * band), Math.max(high ?? 0, 1.2 * band)];
    const margin = Math.max(0.06 * (high - low), 0.01 * Math.abs(high), 1e-3);
    return [(low ?? 0) - margin, (high ?? 1) + margin];
  }

  /** The states as colored stretches with their words. */
  drawStates(u) {
    const { ctx, bbox: { left, top, width, height } } = u, ratio = devicePixelRatio;
    ctx.save();
    ctx.beginPath(); ctx.rect(left, top, width, height); ctx.clip();
    ctx.font = FONT.replace("11", 11 * ratio);
    [ctx.textAlign, ctx.textBaseline] = ["left", "middle"];
    this.states.forEach(({ time, state, words: said }, k) => {
      const from = Math.max(left, u.valToPos(time, "x", true));
      const to = Math.min(left + width, u.valToPos(this.states[k + 1]?.time ?? this.columns[0].at(-1) ?? time, "x", true));
      if (to <= from) return;
      ctx.fillStyle = color(state);
      ctx.fillRect(from, top, Math.max(to - from, ratio), height);
      ctx.fillStyle = ["isolated", "raised", "environment_invalid"].includes(state) ? "#fff" : "#000";
      // Words that do not fit are under the pointer and in the list of events.
      const fits = [said, words(state)].find((text) => ctx.measureText(text).width <= to - from - 9 * ratio);
      if (fits) ctx.fillText(fits, from + 5 * ratio, top + height / 2);
    });
    ctx.restore();
  }

  /** The edges of a band, and what happened, across a chart. */
  drawMarks(u, edges) {
    const { ctx, bbox: { left, top, width, height } } = u;
    const line = (...points) => { ctx.beginPath(); ctx.moveTo(points[0], points[1]); ctx.lineTo(points[2], points[3]); ctx.stroke(); };
    ctx.save();
    ctx.setLineDash([4, 4]);
    ctx.strokeStyle = color("--band");
    for (const y of edges.map((edge) => u.valToPos(edge, "y", true))) if (y > top && y < top + height) line(left, y, left + width, y);
    for (const { time, kind } of this.marks) {
      const x = u.valToPos(time, "x", true);
      ctx.strokeStyle = color(MARKS[kind]);
      if (x >= left && x <= left + width) line(x, top, x, top + height);
    }
    ctx.restore();
  }
}

/** Shows the record that the page holds, the worst residuals first. */
function showRecord({ signals, stretches, events, bucket_s: bucketS, count }) {
  const times = Array.from({ length: 2 * count }, (_, k) => Math.floor(k / 2) * bucketS);
  const values = ({ data, low, high }) => {
    if (!data) return times.map(() => low);
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0)), step = (high - low) / 65534;
    return Array.from(new Int16Array(bytes.buffer), (short) => (short === -32768 ? null : low + (short + 32767) * step));
  };
  const player = new Player({ signals, stretches });
  player.columns = [times, ...signals.map(values)];
  player.take(events);
  player.panels = [...player.panels.filter(({ group }) => group !== "residual"), ...player.worst()];
  player.showResiduals(player.worst().slice(0, 4));
  player.draw(true);
  for (const [event, isPaper] of [["beforeprint", true], ["afterprint", false]]) {
    addEventListener(event, () => { document.documentElement.classList.toggle("paper", player.isPaper = isPaper); player.draw(true); });
  }
  return player;
}
