"use strict";
// Runs scripts of the page without a browser: everything that belongs to a document is a stand-in that accepts
// anything. `node page.cjs hour SCRIPTS…` sends an hour of frames, and reports how many samples the page keeps and draws.
// `node page.cjs saved HTML` plays the session of a page, and reports what it shows, as JSON: values, and texts with
// the number of samples before them.
const fs = require("node:fs");
const vm = require("node:vm");

/** Accepts any access, call and assignment. */
function anything() {
  const target = function () {};
  const proxy = new Proxy(target, {
    get: (own, key) => (key === Symbol.toPrimitive ? () => "" : key === "then" ? undefined : own[key] ?? proxy),
    apply: () => proxy,
    construct: () => proxy,
    set: () => true,
  });
  return proxy;
}

/** The names that a page has, with `more` of them. */
function pageContext(more) {
  const document = anything();
  const names = { document, location: { search: "", protocol: "file:", host: "" }, URLSearchParams, Float32Array, Uint32Array,
    ArrayBuffer, DataView, TextDecoder, Blob, Response, DecompressionStream, atob, performance, setTimeout, setInterval,
    requestAnimationFrame: () => 0, matchMedia: anything(), ResizeObserver: anything(), uPlot: anything(),
    getComputedStyle: anything(), fetch: () => new Promise(() => {}), WebSocket: anything(), console };
  return vm.createContext({ ...names, ...more });
}

/** A frame of five samples, with a peak of one sample now and then. */
function frameOf(first, width) {
  const buffer = new ArrayBuffer(16 + 4 * 5 * width);
  const view = new DataView(buffer);
  view.setBigUint64(0, BigInt(first), true);
  view.setUint32(8, 5, true);
  view.setUint32(12, width, true);
  new Float32Array(buffer, 16).fill(first % 1000 === 0 ? 7 : 1);
  return buffer;
}

/** An hour at 100 Hz and 40 signals, with a lost frame every ten minutes. */
function hour(scripts) {
  const context = pageContext({});
  for (const script of scripts) vm.runInContext(fs.readFileSync(script, "utf8"), context);
  const data = vm.runInContext("data = new Samples(40, 0.01)", context);
  let most = 0;
  for (let first = 0; first < 360_000; first += 5) {
    if (first % 60_000 !== 30_000) data.take(frameOf(first, 40));
    most = Math.max(most, data.columns[0].length);
  }
  context.pixels = 700;
  const drawn = vm.runInContext("thinned(data.columns, 0, pixels)", context);
  return { most, drawn: drawn[0].length, peak: Math.max(...drawn[1].filter((one) => one !== null)) };
}

/** Plays the session of a page to its end, with a jump, and reports samples, events and states. */
async function saved(file) {
  const html = fs.readFileSync(file, "utf8");
  const session = html.match(/id="session">([^<]*)</)[1];
  const script = html.match(/<script>("use strict";\n\/\/ Stands in[^]*?)<\/script>/)[1];
  const context = pageContext({ document: { getElementById: () => ({ textContent: session }) } });
  vm.runInContext(script, context);
  const about = await (await context.fetch("about")).json();
  const socket = vm.runInContext("new WebSocket()", context);
  const texts = [], values = [];
  let restarted = 0;
  socket.onopen = () => {};
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") {
      const first = Number(new DataView(data).getBigUint64(0, true));
      if (first === 0) { values.length = 0; restarted++; }
      values.push(...new Uint32Array(data, 16));
    } else texts.push([JSON.parse(data), values.length / about.signals.length]);
  };
  await new Promise((done) => setTimeout(done, 100));
  socket.send(JSON.stringify({ jump: 1e9 }));
  const jumped = values.length;
  socket.send(JSON.stringify({ inject: {} }));
  socket.send(JSON.stringify({ restart: true }));
  socket.send(JSON.stringify({ speed: 16 }));
  const width = about.signals.length;
  const end = Date.now() + 20_000;
  while (values.length < jumped && Date.now() < end) await new Promise((done) => setTimeout(done, 20));
  const isRefused = texts.some(([one]) => one.playback?.refused);
  return { title: about.title, width, jumped, values, texts, isRefused, restarted };
}

const [, , what, ...files] = process.argv;
Promise.resolve(what === "hour" ? hour(files) : saved(files[0])).then((found) => {
  fs.writeSync(1, JSON.stringify(found));
  process.exit(0);
});
