"use strict";
// Watches a flight for minutes, and measures what the page holds, what it loses and how late it draws.
//   node soak.cjs chromium|firefox LINK SERVER_PID MINUTES
// A sample counts as drawn when the browser has run the frame in which the page drew it, without the compositor. The
// server says when it published a sample (`/counts`), and both read the clock of this machine. The last sample of a
// frame waits for nothing; the first one waits for the others, which is counted too.
const { launch } = require("puppeteer-core");
const fs = require("node:fs");

const [, , name, link, server, minutesText] = process.argv;
const minutes = Number(minutesText ?? 60);
const path = { chromium: "/usr/bin/chromium", firefox: "/usr/bin/firefox-esr" }[name];
const POLL_MS = 100;
/** The memory is compared with that after this share of the run, five minutes of an hour at least. */
const SETTLED_MIN = Math.min(5, minutes / 2);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

/** Notes in the page when it has drawn which sample. */
function instrument() {
  globalThis.drawnAt = [];
  const channel = new MessageChannel();
  let last = null;
  channel.port1.onmessage = ({ data: sample }) => globalThis.drawnAt.push([sample, Date.now()]);
  const look = () => {
    if (data && data.next !== last) { last = data.next; channel.port2.postMessage(last - 1); }
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}

/** Processor time of the server so far, s. */
function serverCpuS() {
  const fields = fs.readFileSync(`/proc/${server}/stat`, "utf8").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

/** Parents of all processes. */
function parents() {
  const found = new Map();
  for (const entry of fs.readdirSync("/proc").filter((one) => /^\d+$/.test(one))) {
    try {
      found.set(Number(entry), Number(fs.readFileSync(`/proc/${entry}/stat`, "utf8").split(") ")[1].split(" ")[1]));
    } catch { /* it has ended */ }
  }
  return found;
}

/** Private memory of the largest process that shows pages, MB. */
function privateMb(root) {
  const above = parents();
  const isBelow = (pid) => { for (; pid; pid = above.get(pid)) if (pid === root) return true; return false; };
  const sizes = [...above.keys()].filter(isBelow).map((pid) => {
    try {
      const command = fs.readFileSync(`/proc/${pid}/cmdline`, "utf8");
      if (!/--type=renderer|-contentproc[^]*tab/.test(command)) return 0;
      const memory = fs.readFileSync(`/proc/${pid}/smaps_rollup`, "utf8");
      return [...memory.matchAll(/^Private_\w+:\s+(\d+) kB/gm)].reduce((sum, [, kb]) => sum + Number(kb), 0) / 1024;
    } catch { return 0; }
  });
  return Math.max(0, ...sizes);
}

/** The heap of the page after garbage was collected, MB; null where the browser does not say. */
async function heapMb(page) {
  if (name !== "chromium") return null;
  const client = await page.createCDPSession();
  await client.send("HeapProfiler.collectGarbage");
  const { usedSize } = await client.send("Runtime.getHeapUsage");
  await client.detach();
  return usedSize / 2 ** 20;
}

/** Latencies of samples that were published and drawn, ms; forgets them. */
function latencies(published, drawn) {
  const found = [];
  for (const [sample, ms] of drawn) {
    while (published.length && published[0].sample <= sample) found.push(ms - published.shift().unix_ms);
  }
  return found;
}

const quantile = (sorted, share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? NaN;

/** What the page holds. */
const held = (page) => page.evaluate(() => ({
  points: data.columns[0].length, columns: data.columns.length, lost,
  lines: player.panels.reduce((sum, { plot, lines }) => sum + (plot ? lines.length : 0), 0), nodes: document.querySelectorAll("*").length,
}));

async function soak(browser) {
  const page = await browser.newPage();
  await page.setViewport({ width: 1280, height: 720 });
  page.setDefaultTimeout(120_000);
  await page.goto(link);
  await page.waitForSelector('body[data-connected="yes"][data-finding="healthy"]');
  await page.evaluate(() => { document.getElementById("span").value = "60"; });
  await page.evaluate(instrument);
  const counts = async () => (await fetch(`${link}counts`)).json();
  const root = browser.process().pid;
  const begin = { ms: Date.now(), cpu: serverCpuS(), newest: (await counts()).newest };
  let published = [], all = [], newest = begin.newest, samples = 0, settled = null, least = [];
  const measure = async () => {
    // Least of a few seconds: between two collections the memory of a process grows.
    return { heap: await heapMb(page), memory: Math.min(...least.slice(-12)), ...(await held(page)) };
  };
  for (let poll = 0; Date.now() - begin.ms < minutes * 60_000; poll++) {
    await pause(POLL_MS);
    const now = (await counts()).newest;
    if (now && now.sample < newest.sample) { published = []; newest = { sample: -1 }; }
    if (now && now.sample > newest.sample) { samples += now.sample - newest.sample; published.push(now); newest = now; }
    if (poll % 10 === 9) all.push(...latencies(published, await page.evaluate(() => drawnAt.splice(0))));
    if (poll % 50 === 49) least.push(privateMb(root));
    if (settled === null && Date.now() - begin.ms >= SETTLED_MIN * 60_000) settled = await measure();
  }
  const end = { ...(await measure()), cpu: serverCpuS(), ms: Date.now(), counts: await counts() };
  const events = await (await fetch(`${link}events`)).json();
  const late = events.filter((event) => event.kind === "late").length;
  const period = await page.evaluate(() => about.period_s * 1000);
  const whole = all.flatMap((latency) => [0, 1, 2, 3, 4].map((before) => latency + before * period)).sort((a, b) => a - b);
  const frames = all.sort((a, b) => a - b);
  const percent = (before, after) => before && after ? Number((100 * (after / before - 1)).toFixed(1)) : null;
  const mb = (value) => (value === null ? null : Number(value.toFixed(1)));
  return {
    browser: await browser.version(), minutes, settled_min: SETTLED_MIN,
    signals: end.columns - 1, lines_drawn: end.lines, points_kept: [settled.points, end.points], nodes: [settled.nodes, end.nodes],
    heap_mb: [mb(settled.heap), mb(end.heap)], heap_growth_percent: percent(settled.heap, end.heap),
    process_mb: [mb(settled.memory), mb(end.memory)], process_growth_percent: percent(settled.memory, end.memory),
    samples, samples_behind_the_clock: Math.round((newest.unix_ms - begin.newest.unix_ms) / period) - samples, late_events: late,
    frames_lost_by_the_page: end.lost, frames_lost_by_all: end.counts.frames_lost,
    latency_ms: { frames: frames.length, last_sample_p50: quantile(frames, 0.5), last_sample_p99: quantile(frames, 0.99),
      any_sample_p50: quantile(whole, 0.5), any_sample_p99: quantile(whole, 0.99), worst: Math.max(...whole.slice(-1)) },
    server_cpu_percent: Number((100_000 * (end.cpu - begin.cpu) / (end.ms - begin.ms)).toFixed(1)),
  };
}

(async () => {
  const args = name === "chromium" ? ["--no-sandbox"] : [];
  const browser = await launch({ browser: name === "chromium" ? "chrome" : name, executablePath: path, headless: true, args });
  try { console.log(JSON.stringify(await soak(browser), null, 1)); } finally { await browser.close(); }
})().catch((error) => { console.error(error); process.exit(1); });
