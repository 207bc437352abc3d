"use strict";
// Runs scripts of the page without a browser: everything that belongs to a document is a stand-in that accepts
// anything. `node page.cjs SCRIPTS…` sends an hour of frames, and reports how many samples the page keeps and draws.
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

/** The names that a page has. */
function pageContext() {
  const document = anything();
  return vm.createContext({ document, location: { search: "" }, URLSearchParams, Float32Array, ArrayBuffer, DataView, performance,
    setTimeout, setInterval, requestAnimationFrame: () => 0, matchMedia: anything(), ResizeObserver: anything(), uPlot: anything(),
    getComputedStyle: anything(), fetch: () => new Promise(() => {}), WebSocket: anything(), console });
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
  const context = pageContext();
  for (const script of scripts) vm.runInContext(fs.readFileSync(script, "utf8"), context);
  const data = vm.runInContext("data = new Samples(40, 0.01)", context);
  let most = 0;
  for (let first = 0; first < 360_000; first += 5) {
    if (first % 60_000 !== 30_000) data.take(frameOf(first, 40));
    most = Math.max(most, data.columns[0].length);
  }
  context.pixels = 700;
  const drawn = vm.runInContext("thinned(data.columns, 0, data.columns[0].length, pixels)", context);
  return { most, drawn: drawn[0].length, peak: Math.max(...drawn[1].filter((one) => one !== null)) };
}

fs.writeSync(1, JSON.stringify(hour(process.argv.slice(2))));
process.exit(0);
