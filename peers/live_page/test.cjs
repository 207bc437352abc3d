"use strict";
// A first visit to the live page: inject a leak, wait for the action by an attribute, compare page and server, and look
// at gaps, peaks, keyboard, dark mode and narrow screens. The flight is saved as a page, which "saved" opens from its
// file; "record" looks at the page of a log. With "embedded" the page is shown inside of others, as Jupyter does.
const { launch } = require("puppeteer-core");
const assert = require("node:assert");
const fs = require("node:fs");
const http = require("node:http");
const { pathToFileURL } = require("node:url");

const [, , name, link, out, what] = process.argv;
const path = { chromium: "/usr/bin/chromium", firefox: "/usr/bin/firefox-esr" }[name];
const PATIENCE_MS = 60_000;
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

/** How many pixels of twelve columns, whole dashes of the lines of a band, of the first residual's canvas have ink. */
async function inkAt(page, share) {
  return page.evaluate((at) => {
    const canvas = document.querySelector("#plots .residual canvas");
    const x = Math.round(canvas.width * at);
    const { data } = canvas.getContext("2d").getImageData(x - 6, 0, 12, canvas.height);
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

  // A fault, by keyboard alone: Tab to the drawing, an arrow to the leak, Enter, then the form.
  assert.equal(await page.$$eval("svg .touch[tabindex='0']", (list) => list.length), 1, "the drawing is one stop");
  await page.evaluate(() => document.querySelector('[data-component="actuator_1.cylinder"]').focus());
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => document.activeElement.id), "fault");
  assert.equal(await page.$eval("#fault", (list) => list.value), "actuator_1.leakage_a.leakage");
  await page.focus("#go");
  await page.keyboard.press("Enter");
  await page.waitForSelector('body[data-action="actuator_1 shut_down"]');
  const latency = await page.$eval("body", (body) => body.dataset.latency);
  const events = await page.evaluate(async () => (await fetch("events" + location.search)).json());
  const action = events.findLast((event) => event.kind === "action");
  assert.equal(action.action, "shut_down");
  // The headline stays when the diagnosis has nothing new to say, and the chart shows the sensor that was farthest out.
  await page.waitForSelector('body[data-finding="healthy"]');
  // What has failed follows where the evidence told it before the actuator was off.
  const headline = await page.$eval("#alarm", (one) => one.textContent);
  assert.match(headline, action.detail ? /^Actuator 1 shut down: / : /^Actuator 1 shut down$/);
  const shown = await page.$$eval("#plots .residual b", (list) => list.map((one) => one.textContent));
  assert.match(shown.join(), /^Residual of \S+_[AB]1$/);
  assert.ok(Math.abs(Number(latency) - action.after_s) < 0.02, `${latency} ${action.after_s}`);
  await page.screenshot({ path: `${out}/${name}-1280.png` });
  fs.writeFileSync(`${out}/${name}.latency`, latency);
  const html = await page.evaluate(async () => (await fetch(document.getElementById("save-page").href)).text());
  fs.writeFileSync(`${out}/${name}.html`, html);

  // A gap is a gap, and a peak of one sample is seen at any zoom.
  await page.evaluate(() => {
    document.getElementById("span").value = "60";
    const columns = data.columns;
    data.take = () => {};
    const length = 6000;
    columns.forEach((column) => { column.length = 0; });
    for (let k = 0; k < length; k++) columns.forEach((column, c) => column.push(c === 0 ? k * 0.01 : k > 2900 && k < 3500 ? null : 7));
    columns.forEach((column, c) => { if (c > 0) column[1500] = 50; });
  });
  await pause(500);
  const drawn = await page.evaluate(() => {
    const { plot } = player.panels.find(({ group, plot: own }) => group === "residual" && own);
    const values = plot.data[1];
    const at = (x) => Math.round(plot.valToPos(x, "x", true)) / plot.ctx.canvas.width;
    return { peak: Math.max(...values.filter((v) => v !== null)), gaps: values.filter((v) => v === null).length, gapAt: at(32), lineAt: at(45), peakAt: at(15) };
  });
  assert.equal(drawn.peak, 50);
  assert.ok(drawn.gaps > 10, `${drawn.gaps} gaps`);
  const [inGap, onLine, atPeak] = [await inkAt(page, drawn.gapAt), await inkAt(page, drawn.lineAt), await inkAt(page, drawn.peakAt)];
  assert.ok(inGap < onLine && onLine < atPeak, `ink: gap ${inGap}, line ${onLine}, peak ${atPeak}`);

  await page.reload();
  await page.waitForSelector('body[data-connected="yes"]');
  await pause(1500);
  await page.evaluate(() => { document.documentElement.style.colorScheme = "dark"; });
  await page.evaluate(() => player.draw(true));
  await pause(500);
  await page.screenshot({ path: `${out}/${name}-dark.png` });
  await page.setViewport({ width: 390, height: 844 });
  await pause(500);
  // A busy machine takes its time to lay the page out anew.
  await page.waitForFunction(() => document.documentElement.scrollWidth <= innerWidth).catch(() => {});
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(overflow <= 0, `the page is ${overflow} px too wide for 390 px`);
  await page.screenshot({ path: `${out}/${name}-390.png`, fullPage: true });
  const elsewhere = asked.filter((url) => url.startsWith("http") && new URL(url).host !== new URL(link).host);
  assert.deepEqual(elsewhere, [], "nothing else is asked");
  assert.deepEqual(problems, []);
  console.log(`${name}: action after ${latency} s as the server says; ink: gap ${inGap}, line ${onLine}, peak ${atPeak}`);
}

/** Opens a page from a file; what it asked for and what went wrong is collected. */
async function openFile(browser, file) {
  const page = await browser.newPage();
  await page.setViewport({ width: 1280, height: 720 });
  page.setDefaultTimeout(PATIENCE_MS);
  const asked = [];
  const problems = [];
  page.on("request", (request) => asked.push(request.url()));
  page.on("console", (message) => { if (message.type() === "error") problems.push(message.text()); });
  page.on("pageerror", (error) => problems.push(error.message));
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("#plots .residual canvas");
  return { page, asked, problems };
}

/** Looks at a flight in a page of its own, without a server. */
async function saved(browser) {
  const file = `${out}/${name}.html`;
  const { page, asked, problems } = await openFile(browser, file);
  assert.match(await page.$eval("#said", (one) => one.textContent), /^actuator 1, shut down/);
  const action = await page.$eval('#events [data-kind="action"]', (one) => one.textContent);
  assert.match(action, new RegExp(`after ${fs.readFileSync(`${out}/${name}.latency`, "utf8")} s`), "the same action after the same time");
  await page.screenshot({ path: `${out}/${name}-saved.png`, fullPage: true });
  const blocked = await page.evaluate(() => {
    const seen = new Set();
    document.addEventListener("securitypolicyviolation", (event) => seen.add(event.effectiveDirective));
    const script = document.createElement("script");
    script.textContent = "globalThis.isBreached = true";
    const image = document.createElement("img");
    image.src = "http://127.0.0.1:9/image";
    document.body.append(script, image);
    return new Promise((done) => setTimeout(() => done([...seen].sort()), 300));
  });
  assert.deepEqual(blocked, ["img-src", "script-src-elem"]);
  assert.equal(await page.evaluate(() => globalThis.isBreached), undefined);
  const elsewhere = asked.filter((url) => /^(http|ws)/.test(url) && !url.endsWith(":9/image"));
  assert.deepEqual(elsewhere, [], `asked is ${elsewhere}`);
  assert.deepEqual(problems.filter((problem) => !/Content.Security.Policy/i.test(problem)), []);
  await hostile(browser, file);
  console.log(`${name}: the page from a file has the action of the live page, and asks for nothing`);
}

/** Opens the same page with texts that try to be HTML. */
async function hostile(browser, file) {
  const text = "</script><script>globalThis.isBreached = true</script><img src=x onerror='globalThis.isBreached = true'>";
  const html = fs.readFileSync(file, "utf8");
  const [, data] = html.match(/id="record">([^]*?)<\/script>/);
  const record = JSON.parse(data);
  for (const signal of record.signals) { signal.label = text; signal.unit = text; }
  record.events.unshift({ time_s: 0, kind: text, why: text }, { time_s: 0, kind: "finding", alarm: text, finding: text });
  const spoiled = `${out}/${name}-hostile.html`;
  fs.writeFileSync(spoiled, html.replace(data, () => JSON.stringify(record).replaceAll("<", "\\u003c")));
  const { page, problems } = await openFile(browser, spoiled);
  assert.equal(await page.$$eval("img, #events script, #plots script", (list) => list.length), 0);
  assert.equal(await page.evaluate(() => globalThis.isBreached), undefined);
  assert.deepEqual(problems, []);
}

/** Looks at the page of a log: the verdict, the worst residual first, a zoom, and all of it on paper. */
async function record(browser) {
  const { page, asked, problems } = await openFile(browser, link);
  const heads = await page.$$eval("#plots .residual p", (list) => list.map((one) => one.children[1].textContent));
  const times = heads.map((text) => Number(/up to (\S+) times/.exec(text)?.[1] ?? 0));
  assert.ok(times[0] > 1 && times.every((one, k) => !k || times[k - 1] >= one), `${heads}`);
  await page.screenshot({ path: `${out}/${name}-record.png` });
  const [first, kept] = await page.evaluate(() => {
    window.scrollTo(0, document.body.scrollHeight);
    const { top, height } = document.querySelector("#plots .state").getBoundingClientRect();
    return [player.window(), top >= 0 && height > 0];
  });
  assert.ok(kept, "the axis of time stays in sight");
  await page.evaluate(() => window.scrollTo(0, 0));
  const chart = await page.$("#plots .residual .u-over");
  const { x, y, width } = await chart.boundingBox();
  await page.mouse.move(x + 0.2 * width, y + 20);
  await page.mouse.down();
  await page.mouse.move(x + 0.4 * width, y + 20, { steps: 5 });
  await page.mouse.up();
  const [from, to] = await page.evaluate(() => player.window());
  assert.ok(Math.abs((to - from) / (first[1] - first[0]) - 0.2) < 0.02, `${from} to ${to} of ${first}`);
  await page.pdf({ path: `${out}/${name}-record.pdf` });
  await page.setViewport({ width: 390, height: 844 });
  await pause(500);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(overflow <= 0, `the page is ${overflow} px too wide for 390 px`);
  assert.deepEqual([asked.filter((url) => /^(http|ws)/.test(url)), problems], [[], []]);
  console.log(`${name}: the page of a log; ${heads[0]}`);
}

/** Shows the page inside of a page of another port, as Jupyter does, and inside of one that is not of this machine. */
async function embedded(browser) {
  const outer = http.createServer((request, answer) => {
    answer.setHeader("content-type", "text/html");
    answer.end(`<!doctype html><iframe src="${link}" width="1200" height="700"></iframe>`);
  });
  await new Promise((done) => outer.listen(0, "127.0.0.1", done));
  const { port } = outer.address();
  const inner = async (host) => {
    const page = await browser.newPage();
    page.setDefaultTimeout(PATIENCE_MS);
    await page.goto(`http://${host}:${port}/`);
    await page.waitForFunction(() => document.readyState === "complete");
    return page.frames().find((frame) => frame !== page.mainFrame());
  };
  const shown = await inner("127.0.0.1");
  await shown.waitForSelector('body[data-connected="yes"][data-finding="healthy"]');
  const refused = await inner("elsewhere.localhost");
  await pause(2000);
  assert.equal(await refused.evaluate(() => document.getElementById("title")).catch(() => null), null);
  outer.close();
  console.log(`${name}: shown inside of a page of this machine, refused inside of another one`);
}

const VISITS = { flight: visit, saved, record, embedded };

(async () => {
  const args = name === "chromium" ? ["--no-sandbox"] : [];
  const browser = await launch({ browser: name === "chromium" ? "chrome" : name, executablePath: path, headless: true, args });
  try { await VISITS[what](browser); } finally { await browser.close(); }
})().catch((error) => { console.error(error); process.exit(1); });
