// Makes the pictures of the page in `docs/guide/view.md`, in Chromium on the CPU:
//
//     node docs/images/view.mjs [NAME ...]
//
// after `npm ci` in web/. A screenshot of a WebGPU canvas is blank there: what is on it is read back
// and laid under the buttons as a plain picture. It takes minutes.
import { execFileSync } from "node:child_process";
import { existsSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { launch, open, ROOT, serve, VNCA } from "../../web/tests/browser.mjs";

const HERE = dirname(fileURLToPath(import.meta.url));
const MADE = join(ROOT, "build/view");
const SMOKE = join(MADE, "plume");
const SITE = join(MADE, "site");
const QUALITY = 0.86;
const LAST = 33;
const SEEN = `frame=${LAST}&warmup=300&detail=2&azimuth=335`;
const PHONE = { size: [390, 780], isMobile: true, hasTouch: true };
const PICTURES = {
  view: { size: [1120, 720], told: SEEN },
  view_beside: { size: [1120, 720], told: `${SEEN}&wipe=0.5` },
  view_phone: { ...PHONE, told: `${SEEN}&with=frost&mix=0.5` },
};

if (!existsSync(join(SITE, "index.html"))) {
  const vnca = (...given) => execFileSync(VNCA, given, { stdio: "inherit" });
  vnca("simulate", "plume", "--resolution", "44", "--frames", String(LAST + 1), "--out", SMOKE);
  vnca("view", "cafe", SMOKE, "--export", SITE);
}
const asked = process.argv.slice(2);
const [browser, server] = [await launch(), await serve(SITE)];
for (const [name, { told, ...context }] of Object.entries(PICTURES)) {
  if (asked.length > 0 && !asked.includes(name)) continue;
  const { page, errors, close } = await open(browser, `${server.address}#${told}`, context);
  await page.waitForSelector("body.ready");
  await page.evaluate(layDown);
  const taken = await page.screenshot({ animations: "disabled" });
  const made = await page.evaluate(asWebp, [[...taken], QUALITY]);
  writeFileSync(join(HERE, `${name}.webp`), Buffer.from(made));
  if (errors.length > 0) throw new Error(`${name}: ${errors.join("; ")}`);
  console.log(`${name}.webp`);
  await close();
}
await browser.close();
server.close();

/** In the page: what the canvas shows, as a plain picture in its place. */
async function layDown() {
  viewer.pause();
  viewer.isAlive = false;
  viewer.adapt = () => undefined;
  viewer.stage.samples = 0;
  const [width, height] = [innerWidth, innerHeight];
  const pixels = await viewer.stage.pixels(width, height);
  const picture = document.createElement("canvas");
  Object.assign(picture, { width, height });
  picture.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
  viewer.canvas.after(picture);
}

async function asWebp([bytes, quality]) {
  const bitmap = await createImageBitmap(new Blob([new Uint8Array(bytes)]));
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  canvas.getContext("2d").drawImage(bitmap, 0, 0);
  const blob = await canvas.convertToBlob({ type: "image/webp", quality });
  return [...new Uint8Array(await blob.arrayBuffer())];
}
