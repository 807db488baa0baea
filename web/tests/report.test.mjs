// The page that `vnca evaluate` writes: it shows, fits a phone, and asks for nothing outside.
import assert from "node:assert/strict";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, MATERIAL, open, PATIENCE, serve } from "./browser.mjs";

let browser, server;

before(async () => {
  [browser, server] = await Promise.all([launch(), serve(join(MATERIAL, "evaluation"))]);
}, { timeout: PATIENCE });

after(async () => {
  await browser?.close();
  server?.close();
});

for (const [what, size] of [["a phone", [390, 800]], ["a screen", [1280, 800]]]) {
  test(`the report of vnca evaluate is readable on ${what}`, { timeout: PATIENCE }, async () => {
    const { page, foreign, errors, close } = await open(browser, `${server.address}report.html`, { size });
    assert.ok((await page.textContent("h1")).length > 3);
    const found = await page.evaluate(() => {
      const pictures = [...document.querySelectorAll("img")];
      const small = [...document.querySelectorAll("p, td, div, figcaption, li")].filter(
        (each) => each.textContent.trim() && parseFloat(getComputedStyle(each).fontSize) < 11,
      );
      return {
        pictures: pictures.length,
        blank: pictures.filter((each) => !each.complete || each.naturalWidth === 0).length,
        wide: document.documentElement.scrollWidth - innerWidth,
        small: small.length,
        numbers: document.querySelectorAll("td.number").length,
      };
    });
    assert.ok(found.pictures > 2 && found.numbers > 4, JSON.stringify(found));
    assert.deepEqual([found.blank, found.small], [0, 0]);
    assert.ok(found.wide <= 0, `${found.wide} pixels too wide`);
    assert.deepEqual([foreign, errors], [[], []]);
    await close();
  });
}
