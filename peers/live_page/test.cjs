"use strict";
// A first visit to the live page: inject a leak, wait for the action by an attribute, compare page and server, and look
// at gaps, peaks, keyboard, dark mode and narrow screens. The flight is saved; with "replay" a second visit looks at that
// session, which has to end with the same action after the same time.
const { launch } = require("puppeteer-core");
const assert = require("node:assert");
const fs = require("node:fs");

const [, , name, link, out, what] = process.argv;
const path = { chromium: "/usr/bin/chromium", firefox: "/usr/bin/firefox-esr" }[name];
const PATIENCE_MS = 60_000;
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

/** Colors of a column of pixels of a chart's canvas, from top to bottom. */
async function inkAt(page, share) {
  return page.evaluate((at) => {
    const canvas = document.querySelectorAll("#plots canvas")[2];
    const x = Math.round(canvas.width * at);
    const { data } = canvas.getContext("2d").getImageData(x, 0, 3, canvas.height);
    let inked = 0;
    for (let k = 3; k < data.length; k += 4) inked += data[k] > 0 ? 1 : 0;
    return inked;
  }, share);
}

async function visit(browser) {
  const page = await browser.newPage();
  await page.setViewport({ width: 1280, height: 720 });
  const asked = [];
  const problems = [];
  page.on("request", (request) => asked.push(request.url()));
  page.on("console", (message) => { if (message.type() === "error") problems.push(message.text()); });
  page.on("pageerror", (error) => problems.push(error.message));
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(link);
  await page.waitForSelector('body[data-connected="yes"][data-finding="healthy"]');

  await page.click("#restart");
  await page.waitForSelector('body[data-action=""][data-finding="not judged"]');
  await page.waitForSelector('body[data-action=""][data-finding="healthy"]');

  // A fault, by keyboard alone: Tab to the leak in the drawing, Enter, then the form.
  await page.evaluate(() => document.querySelector('[data-component="actuator_1.leakage_a"]').focus());
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => document.activeElement.id), "fault");
  assert.equal(await page.$eval("#fault", (list) => list.value), "actuator_1.leakage_a.leakage");
  await page.focus("#go");
  await page.keyboard.press("Enter");
  await page.waitForSelector('body[data-action="actuator_1 shut_down"]');
  const latency = await page.$eval("body", (body) => body.dataset.latency);
  const events = await page.evaluate(async () => (await fetch("events" + location.search)).json());
  const action = events.findLast((event) => event.kind === "action");
  assert.equal(action.command, "shut_down");
  assert.ok(Math.abs(Number(latency) - action.after_s) < 0.02, `${latency} ${action.after_s}`);
  await page.screenshot({ path: `${out}/${name}-1280.png` });
  const bytes = await page.evaluate(async () => {
    const session = await fetch(document.getElementById("save").href);
    return Array.from(new Uint8Array(await session.arrayBuffer()));
  });
  fs.writeFileSync(`${out}/${name}.parquet`, Buffer.from(bytes));
  fs.writeFileSync(`${out}/${name}.latency`, latency);

  // A gap is a gap, and a peak of one sample is seen at any zoom.
  await page.evaluate(() => {
    document.getElementById("span").value = "60";
    const columns = data.columns;
    data.take = () => {};
    const length = 6000;
    columns.forEach((column) => { column.length = 0; });
    for (let k = 0; k < length; k++) columns.forEach((column, c) => column.push(c === 0 ? k * 0.01 : k > 2900 && k < 3500 ? null : 0));
    columns.forEach((column, c) => { if (c > 0) column[1500] = 50; });
  });
  await pause(500);
  const drawn = await page.evaluate(() => {
    const { plot } = plots[2];
    const values = plot.data[1];
    const area = plot.bbox;
    const at = (x) => Math.round(plot.valToPos(x, "x", true)) / plot.ctx.canvas.width;
    return { peak: Math.max(...values.filter((v) => v !== null)), gaps: values.filter((v) => v === null).length, gapAt: at(32), lineAt: at(45), peakAt: at(15), area };
  });
  assert.equal(drawn.peak, 50);
  assert.ok(drawn.gaps > 10, `${drawn.gaps} gaps`);
  const [inGap, onLine, atPeak] = [await inkAt(page, drawn.gapAt), await inkAt(page, drawn.lineAt), await inkAt(page, drawn.peakAt)];
  assert.ok(inGap < onLine && onLine < atPeak, `ink: gap ${inGap}, line ${onLine}, peak ${atPeak}`);

  await page.reload();
  await page.waitForSelector('body[data-connected="yes"]');
  await pause(1500);
  await page.evaluate(() => { document.documentElement.style.colorScheme = "dark"; });
  await page.evaluate(() => makeCharts());
  await pause(500);
  await page.screenshot({ path: `${out}/${name}-dark.png` });
  await page.setViewport({ width: 390, height: 844 });
  await pause(500);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(overflow <= 0, `the page is ${overflow} px too wide for 390 px`);
  await page.screenshot({ path: `${out}/${name}-390.png`, fullPage: true });
  const elsewhere = asked.filter((url) => url.startsWith("http") && new URL(url).host !== new URL(link).host);
  assert.deepEqual(elsewhere, [], "nothing else is asked");
  assert.deepEqual(problems, []);
  console.log(`${name}: action after ${latency} s as the server says; ink: gap ${inGap}, line ${onLine}, peak ${atPeak}`);
}

/** Looks at a saved session. */
async function replay(browser) {
  const page = await browser.newPage();
  await page.setViewport({ width: 1280, height: 720 });
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(link);
  await page.waitForSelector('body[data-connected="yes"][data-mode="replay"]');
  assert.equal(await page.$eval("#inject", (form) => form.hidden), true, "a replay takes no faults");
  await page.select("#speed", "16");
  await page.waitForSelector('body[data-action="actuator_1 shut_down"]');
  const latency = await page.$eval("body", (body) => body.dataset.latency);
  assert.equal(latency, fs.readFileSync(`${out}/${name}.latency`, "utf8"), "the same action after the same time");
  await page.screenshot({ path: `${out}/${name}-replay.png` });
  await page.click("#restart");
  await page.waitForSelector('body[data-action=""]');
  await page.setViewport({ width: 390, height: 844 });
  await pause(500);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(overflow <= 0, `a replay is ${overflow} px too wide for 390 px`);
  await page.screenshot({ path: `${out}/${name}-replay-390.png` });
  console.log(`${name}: the replayed session has its action after ${latency} s too`);
}

(async () => {
  const args = name === "chromium" ? ["--no-sandbox"] : [];
  const browser = await launch({ browser: name === "chromium" ? "chrome" : name, executablePath: path, headless: true, args });
  try { await (what === "replay" ? replay : visit)(browser); } finally { await browser.close(); }
})().catch((error) => { console.error(error); process.exit(1); });
