// Opens a report in headless Chromium, tries what a reader would, and saves screenshots.
// Usage: node check.mjs REPORT.html SCREENSHOT_DIR [--width=1280] [--without-webgl]. CHROMIUM names another browser than /usr/bin/chromium.

import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [report, shots] = process.argv.slice(2);
const withoutWebgl = process.argv.includes("--without-webgl");
const width = Number(process.argv.find((arg) => arg.startsWith("--width="))?.slice(8) ?? 1280);
if (!report || !shots) {
  console.error("usage: node check.mjs REPORT.html SCREENSHOT_DIR [--width=1280] [--without-webgl]");
  process.exit(2);
}
mkdirSync(shots, { recursive: true });

const failures = [];
const check = (name, good, detail = "") => {
  console.log(`${good ? "ok  " : "FAIL"} ${name}${detail ? `: ${detail}` : ""}`);
  if (!good) failures.push(name);
};

const profile = mkdtempSync(join(tmpdir(), "vmao-viewer-"));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  headless: true,
  viewport: { width, height: 900 },
  args: ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    ...(withoutWebgl ? ["--disable-3d-apis"] : ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"])],
});

/** Share of a canvas that differs from its own corner, and the number of distinct colours. */
const picture = (canvas) => canvas.evaluate((node) => {
  const { width: w, height: h } = node;
  const { data } = node.getContext("2d").getImageData(0, 0, w, h);
  const colors = new Set();
  let solid = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 8) solid += 1;
    colors.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
  }
  return { filled: solid / (w * h), colors: colors.size };
});

const settle = async (canvas) => {
  await canvas.scrollIntoViewIfNeeded();
  await canvas.evaluate(async (node) => {
    for (let tries = 0; tries < 200 && !node.dataset.painted; tries++) await new Promise((done) => setTimeout(done, 50));
  });
};

try {
  const page = await browser.newPage();
  const problems = [];
  const requests = [];
  page.on("console", (message) => { if (["error", "warning"].includes(message.type()) && !/GPU stall|swiftshader/i.test(message.text())) problems.push(message.text()); });
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("dialog", async (dialog) => { problems.push(`dialog: ${dialog.message()}`); await dialog.dismiss(); });
  page.on("request", (request) => { if (!/^(file|data|blob):/.test(request.url())) requests.push(request.url()); });
  await page.goto(pathToFileURL(resolve(report)).href);
  await page.waitForSelector("h1");
  await page.screenshot({ path: join(shots, "top.png") });

  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  check("the page is no wider than the window", overflow <= 0, `${overflow} px over`);

  const views = page.locator("canvas.view");
  if (withoutWebgl) {
    const notices = await page.locator(".notice").allTextContents();
    check("a line says that WebGL is missing", notices.length > 0 && notices.every((text) => text.includes("WebGL")));
    check("no blank canvas stands in for a view", await views.count() === 0);
  }
  for (let i = 0; i < await views.count(); i++) {
    await settle(views.nth(i));
    const { filled, colors } = await picture(views.nth(i));
    check(`view ${i + 1} is not blank`, filled > 0.02 && colors > 50, `${(100 * filled).toFixed(0)} % filled, ${colors} colours`);
  }

  const maps = page.locator(".map .view");
  if (await maps.count() > 1) {
    const painted = (i) => maps.nth(i).evaluate((node) => Number(node.dataset.painted));
    await settle(maps.first());
    const before = await painted(1);
    await maps.first().focus();
    await page.keyboard.press("ArrowLeft");
    await page.waitForTimeout(400);
    check("arrow keys turn all maps together", await painted(1) > before);
    await page.keyboard.press("0");
    await page.waitForTimeout(900);
    await page.locator(".map .code").nth(1).click();
    check("a code can be chosen", await page.locator(".map").nth(1).evaluate((node) => node.classList.contains("chosen")));
    await page.waitForTimeout(1000); // what the code leads to is loaded before it is tried below
  }

  const loaded = (player) => player.locator("canvas").evaluate(async (node) => {
    for (let tries = 0; tries < 200 && !node.dataset.loaded; tries++) await new Promise((done) => setTimeout(done, 50));
    return node.dataset.loaded ?? "";
  });
  const players = page.locator(".player");
  for (let i = 0; i < await players.count(); i++) {
    const player = players.nth(i);
    await loaded(player);
    const slider = player.locator("input[type=range]");
    const time = async () => Number(await slider.inputValue());
    const end = Number(await slider.getAttribute("max"));
    await player.locator("canvas").scrollIntoViewIfNeeded();
    await player.locator("canvas").focus();
    const start = await time();
    const painted = () => player.locator("canvas").evaluate((node) => Number(node.dataset.painted));
    const drawn = await painted();
    await page.keyboard.press(" ");
    // Frames that the browser offers and pictures drawn in the same time; told, not judged: the machine decides.
    const offered = await page.evaluate(() => new Promise((done) => {
      let frames = 0;
      const began = performance.now();
      const next = (now) => { frames += 1; if (now - began < 1500) requestAnimationFrame(next); else done((1000 * frames) / (now - began)); };
      requestAnimationFrame(next);
    }));
    const later = await time();
    await page.keyboard.press(" ");
    await page.waitForTimeout(200);
    const paused = await time();
    await page.waitForTimeout(400);
    check(`player ${i + 1}: space plays`, later > start, `${start.toFixed(2)} → ${later.toFixed(2)} s, ${((await painted() - drawn) / 1.5).toFixed(0)} pictures/s of ${offered.toFixed(0)} frames/s`);
    check(`player ${i + 1}: space pauses`, await time() === paused);
    await slider.evaluate((node, value) => { node.value = value; node.dispatchEvent(new Event("input", { bubbles: true })); }, String(end * 0.62));
    await page.waitForTimeout(600);
    check(`player ${i + 1}: the slider seeks`, Math.abs(await time() - end * 0.62) < 0.05 && (await player.locator(".clock").textContent()).startsWith((end * 0.62).toFixed(2)));
    await player.locator("canvas").focus();
    const frame = await time();
    await page.keyboard.press(".");
    const next = await time();
    await page.keyboard.press(",");
    check(`player ${i + 1}: full stop and comma step a frame`, next > frame && Math.abs(await time() - frame) < 1e-6, `${(1000 * (next - frame)).toFixed(0)} ms`);
    const forces = await player.locator(".forces").textContent();
    check(`player ${i + 1}: forces are told in newtons or said to be missing`, /press [\d.]+ and [\d.]+\u2009N|without forces/.test(forces), forces.slice(0, 80));
    await page.keyboard.press("f");
    check(`player ${i + 1}: F hides the forces`, !(await player.locator('[data-layer=forces]').isChecked()) || /without/.test(forces));
    await page.keyboard.press("f");
    await page.keyboard.press("Home");
    check(`player ${i + 1}: Home is the start`, await time() === 0);
    await page.keyboard.press("End");
    check(`player ${i + 1}: End is the end`, Math.abs(await time() - end) < 1e-6);
    for (const camera of ["Front", "Side", "Top", "Close", "Reset"]) {
      await player.getByRole("button", { name: camera, exact: true }).click();
      await page.waitForTimeout(1200);
      await player.screenshot({ path: join(shots, `player-${i + 1}-${camera.toLowerCase()}.png`) });
    }
    const solid = player.getByLabel("Solid arms");
    await solid.uncheck();
    await player.getByRole("button", { name: "Close", exact: true }).click();
    await page.waitForTimeout(1200);
    await player.screenshot({ path: join(shots, `player-${i + 1}-glass.png`) });
    await solid.check();
    await player.getByRole("button", { name: "Reset", exact: true }).click();
    await page.waitForTimeout(1200);
    for (const [name, share] of [["start", 0], ["end", 1]]) {
      await slider.evaluate((node, value) => { node.value = value; node.dispatchEvent(new Event("input", { bubbles: true })); }, String(end * share));
      await page.waitForTimeout(600);
      await player.screenshot({ path: join(shots, `player-${i + 1}-${name}.png`) });
    }
    await slider.evaluate((node, value) => { node.value = value; node.dispatchEvent(new Event("input", { bubbles: true })); }, String(end * 0.5));
  }

  const trials = page.locator("select.trials");
  if (await trials.count()) {
    const player = page.locator("#rollouts .player");
    const many = await trials.locator("option").count();
    const before = await loaded(player);
    await player.locator("canvas").focus();
    await page.keyboard.press("]");
    await page.waitForTimeout(1500);
    check("] plays the next trial", await loaded(player) !== before && await trials.evaluate((node) => node.selectedIndex) === 1 % many, `${many} trials`);
    // Every trial of the page must come through unpacking and building without a word.
    let [broken, began] = [0, Date.now()];
    for (let k = 0; k < many; k++) {
      const last = await loaded(player);
      await trials.selectOption({ index: k });
      const good = await player.locator("canvas").evaluate(async (node, last) => {
        for (let tries = 0; tries < 400 && node.dataset.loaded === last; tries++) await new Promise((done) => setTimeout(done, 10));
        return node.dataset.loaded !== last;
      }, last);
      if (!good) broken += 1;
    }
    check("every trial loads", broken === 0, `${many} in ${((Date.now() - began) / 1000).toFixed(1)} s`);
  }
  const examples = page.locator("button.example");
  for (let i = 0; i < await examples.count(); i++) {
    await examples.nth(i).click();
    await page.waitForTimeout(1200);
    const badge = await page.locator("#rollouts .player-head .badge").textContent();
    const heading = (await page.locator(".failure h4").nth(i).textContent()).split(/ \d/)[0].trim();
    check(`the example of "${heading}" is one`, badge === `Failed: ${heading}`, badge);
  }
  const classes = await page.locator(".failure").count();
  check("every failure class has an example", classes === await examples.count(), `${classes} classes`);
  const scenes = page.locator("#contact-maps select[aria-label=Scene]");
  if (await scenes.count()) {
    const codes = page.locator("#contact-maps .map .code");
    const live = page.locator("#contact-maps .player");
    if (await live.count()) {
      const before = await loaded(live);
      await codes.nth(2).click();
      await page.waitForTimeout(1500);
      check("a code plays what it leads to", await loaded(live) !== before && (await page.locator("#contact-maps .player-head h3").textContent()).startsWith("Code 3"));
    }
    const title = await page.locator("#contact-maps figure h3").first().textContent();
    await scenes.selectOption({ index: 1 });
    await page.waitForTimeout(1500);
    check("another scene can be picked", await page.locator("#contact-maps figure h3").first().textContent() !== title);
  }

  const chart = page.locator(".chart svg").first();
  if (await chart.count()) {
    await chart.focus();
    await page.keyboard.press("ArrowRight");
    check("arrow keys read chart values", await page.locator(".chart .readout").first().isVisible());
    await chart.blur();
  }
  await page.evaluate(() => { document.querySelector("details")?.setAttribute("open", ""); });

  await page.addStyleTag({ content: "nav { position: static !important; }" }).catch(() => {});
  for (const section of await page.locator("section").all()) {
    await section.scrollIntoViewIfNeeded();
    await page.waitForTimeout(500);
    await section.screenshot({ path: join(shots, `section-${await section.getAttribute("id")}.png`) });
  }
  await page.evaluate(() => scrollTo(0, 0));
  await page.waitForTimeout(300);
  await page.screenshot({ path: join(shots, "page.png"), fullPage: true });
  check("no console message above info", problems.length === 0, problems.slice(0, 5).join(" | "));
  check("no request leaves the machine", requests.length === 0, requests.slice(0, 5).join(" "));
} finally {
  await browser.close();
  rmSync(profile, { recursive: true, force: true });
}
console.log(failures.length ? `${failures.length} failed` : "all passed");
process.exitCode = failures.length ? 1 : 0;
