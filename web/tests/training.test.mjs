// `vnca view RUN`: a training is watched while it goes on.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { copyFileSync, cpSync, readdirSync, rmSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, MATERIAL, open, PATIENCE, VNCA } from "./browser.mjs";

let browser, command, address;
const run = join(MATERIAL, "run_watched");

before(async () => {
  rmSync(run, { recursive: true, force: true });
  cpSync(join(MATERIAL, "run"), run, { recursive: true });
  command = spawn(VNCA, ["view", run, "--no-browser"]);
  const said = new Promise((done, failed) => {
    let text = "";
    const hear = (data) => {
      text += data;
      const found = /the page is at (\S+)/.exec(text);
      if (found) done(found[1]);
    };
    command.stdout.on("data", hear);
    command.stderr.on("data", hear);
    command.on("exit", () => failed(new Error(text)));
  });
  [browser, address] = await Promise.all([launch(), said]);
}, { timeout: 2 * PATIENCE });

after(async () => {
  await browser?.close();
  command?.kill("SIGINT");
});

test("curves are drawn and the rule is taken over as it learns", { timeout: 4 * PATIENCE }, async () => {
  const { page, foreign, errors, close } = await open(browser, address, { size: [320, 300] });
  await page.waitForSelector("#curves path.mean");
  await page.evaluate(() => (viewer.isAlive = false)); // so that pictures leave time for the rest
  const seen = () =>
    page.evaluate(() => ({
      title: document.querySelector("#curves h2").textContent,
      names: [...document.querySelectorAll("#curves figcaption")].map((each) => each.firstChild.textContent),
      lengths: [...document.querySelectorAll("#curves path.mean")].map((each) => each.getTotalLength()),
      inside: document.getElementById("curves").getBoundingClientRect().right <= innerWidth,
      weights: [...viewer.stage.layers[0].rule.hidden.values.slice(0, 8)],
    }));
  const early = await seen();
  assert.equal(early.title, "Iteration 40 of 80");
  assert.deepEqual(early.names.sort(), ["appearance", "overflow", "total"]);
  assert.ok(early.lengths.every((length) => length > 100) && early.inside, JSON.stringify(early));

  const later = join(MATERIAL, "later");
  const [events] = readdirSync(later).filter((name) => name.startsWith("events"));
  copyFileSync(join(later, events), join(run, `${events}.more`));
  copyFileSync(join(later, "model.safetensors"), join(run, "model.safetensors"));
  await page.waitForFunction(() => document.querySelector("#curves h2").textContent.includes("60"));
  await page.waitForFunction((first) => viewer.stage.layers[0].rule.hidden.values[0] !== first, early.weights[0]);
  const late = await seen();
  assert.notDeepEqual(late.weights, early.weights);
  assert.equal(await page.evaluate(() => viewer.names[0]), "run_watched");

  const brightest = await page.evaluate(async () => {
    const pixels = await viewer.stage.pixels(64, 64);
    return Math.max(...pixels.filter((_, at) => at % 4 < 3));
  });
  assert.ok(brightest > 60, "there is a picture");
  assert.deepEqual([foreign, errors], [[], []]);
  await close();
});
