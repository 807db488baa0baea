// Chromium with WebGPU on the CPU, pages in it, and what they ask for and complain of.
import { spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const ROOT = join(dirname(fileURLToPath(import.meta.url)), "../..");
export const MATERIAL = process.env.VNCA_MATERIAL ?? join(ROOT, "build/browser");
const PYTHON = process.env.VNCA_PYTHON ?? join(ROOT, ".venv/bin/python");
export const VNCA = join(dirname(PYTHON), "vnca");
const PLACES = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const FLAGS = [
  "--headless",
  "--no-sandbox",
  "--enable-unsafe-webgpu",
  "--enable-features=Vulkan",
  "--use-vulkan=swiftshader",
  "--use-angle=swiftshader",
  "--ignore-gpu-blocklist",
];
export const PATIENCE = 240_000; // ms: shaders run on a CPU that others use, too

export function launch() {
  const executablePath = process.env.VNCA_CHROMIUM ?? PLACES.find(existsSync);
  if (executablePath === undefined) throw new Error("no Chromium: apt-get install chromium");
  return chromium.launch({ executablePath, args: FLAGS });
}

/** Python's plain server, which knows no ranges, on a folder. */
export async function serve(folder) {
  const code =
    "import functools, http.server, sys\n" +
    "handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=sys.argv[1])\n" +
    "server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), handler)\n" +
    "print(server.server_port, flush=True)\nserver.serve_forever()\n";
  const child = spawn(PYTHON, ["-c", code, folder], { stdio: ["ignore", "pipe", "ignore"] });
  const port = await new Promise((done) => child.stdout.once("data", (data) => done(Number(data))));
  return { address: `http://127.0.0.1:${port}/`, close: () => child.kill() };
}

/** A page, and lists of what it asked of others and of what went wrong in it. */
export async function open(browser, address, { size = [200, 240], script, ...context } = {}) {
  const [width, height] = size;
  const own = await browser.newContext({ viewport: { width, height }, ...context });
  const page = await own.newPage();
  page.setDefaultTimeout(PATIENCE);
  const foreign = [];
  const errors = [];
  page.on("request", (request) => {
    const url = request.url();
    if (!url.startsWith(new URL(address).origin) && !/^(blob|data):/.test(url)) foreign.push(url);
  });
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type())) errors.push(message.text());
  });
  if (script) await page.addInitScript(script);
  await page.goto(address);
  return { page, foreign, errors, close: () => own.close() };
}

/** A page on which nothing happens but what is asked for. */
export async function openStill(browser, address, options) {
  const opened = await open(browser, `${address}#frame=0`, options);
  await opened.page.waitForSelector("body.ready");
  await opened.page.evaluate(() => {
    viewer.pause();
    viewer.isAlive = false;
  });
  return opened;
}
