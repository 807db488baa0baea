// The page in a browser: what it computes, shows and does. `make test-browser` makes its material.
import assert from "node:assert/strict";
import { cpSync, readFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { launch, MATERIAL, open, openStill, PATIENCE, serve } from "./browser.mjs";

let browser, server, still;
const slow = { timeout: 2 * PATIENCE };

before(async () => {
  [browser, server] = await Promise.all([launch(), serve(join(MATERIAL, "site"))]);
  still = await openStill(browser, server.address);
}, slow);

after(async () => {
  await browser?.close();
  server?.close();
});

const floats = (name) => new Float32Array(new Uint8Array(readFileSync(join(MATERIAL, name))).buffer);

function fromHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const part = bits & 1023;
  return exponent === 0 ? sign * part * 2 ** -24 : sign * (1 + part / 1024) * 2 ** (exponent - 15);
}

const srgb = (value) =>
  value <= 0.0031308 ? 12.92 * value : 1.055 * Math.min(value, 1) ** (1 / 2.4) - 0.055;

/** Mean difference of two pictures of bytes. */
function apart(one, other) {
  return one.reduce((sum, value, at) => sum + Math.abs(value - other[at]), 0) / one.length;
}

const pixels = (page, size = 64) =>
  page.evaluate(async (size) => [...(await viewer.stage.pixels(size, size))], size);

const told = JSON.parse(readFileSync(join(MATERIAL, "reference.json")));
const same = [["ink", 1], ["church", 1], ["ink", 2], ["carried", 1]];
for (const [style, refine] of same) {
  test(`${style} at detail ${refine} steps and looks as vnca's own painting`, slow, async () => {
    const got = await still.page.evaluate(paintAll, [style, refine, told.config, told.size]);
    const { cells, channels } = told.styles[style][refine];
    assert.deepEqual(got.cells, cells);
    const states = floats(`${style}_${refine}.state`);
    assert.equal(channels, 12);
    assertSame(got.states, states);
    assert.ok(Math.max(...states.map(Math.abs)) > 0.1);
    const pictures = floats(`${style}_${refine}.pictures`);
    const count = told.size ** 2;
    got.pictures.forEach((picture, at) => {
      const expected = pictures.subarray(7 * count * at, 7 * count * (at + 1));
      let linear = 0;
      let shown = 0;
      let seen = 0;
      for (let k = 0; k < 4 * count; k++) {
        linear = Math.max(linear, Math.abs(fromHalf(picture[k]) - expected[k]));
      }
      for (let k = 0; k < count; k++) {
        seen = Math.max(seen, expected[4 * k + 3]);
        for (let c = 0; c < 3; c++) {
          const value = Math.round(255 * srgb(expected[4 * count + 3 * k + c]));
          shown = Math.max(shown, Math.abs(got.shown[at][4 * k + c] - value));
        }
      }
      assert.ok(seen > 0.9, "there is smoke in the picture");
      assert.ok(linear <= 2 / 255, `linear colour and opacity are ${255 * linear}/255 apart`);
      assert.ok(shown <= 2, `sRGB bytes are ${shown} apart`);
    });
  });
}

/** In the page: every frame of a style, as the reference paints it. */
async function paintAll([style, refine, config, size]) {
  const { stage } = viewer;
  const { warmup, steps_per_frame: steps, seed } = config;
  viewer.adapt = () => undefined; // or it looks at fewer points where pictures come late
  stage.samples = 0;
  Object.assign(stage.settings, { warmup, steps, seed, detail: refine });
  await viewer.use(style, 0);
  stage.camera = stage.framed(1);
  stage.layers[0].reset();
  const result = { states: [], cells: [], pictures: [], shown: [] };
  for (let at = 0; at < stage.smoke.length; at++) {
    await viewer.goTo(at);
    const [layer] = stage.layers;
    const { cells } = layer.sites;
    result.cells.push(cells);
    const state = new Float32Array(await layer.state.read());
    result.states.push(...state.subarray(0, 12 * cells));
    const picture = stage.take(size, size);
    result.pictures.push([...new Uint16Array(await stage.gpu.pixels(picture, 8))]);
    result.shown.push([...(await stage.pixels(size, size))]);
  }
  Object.assign(stage.settings, viewer.defaults);
  delete viewer.adapt;
  viewer.reframe();
  return result;
}

/** In the page: the states of all that paint, at frames one after the other. */
async function statesAt([first, second, at, { warmup, steps_per_frame: steps, seed }, patternSpeed]) {
  const { stage } = viewer;
  Object.assign(stage.settings, { warmup, steps, seed, patternSpeed });
  await viewer.use(first, 0);
  await viewer.use(second, 1);
  for (const layer of stage.layers) layer.reset();
  const result = stage.layers.map(() => []);
  for (const place of at) {
    await viewer.goTo(place);
    for (const [number, layer] of stage.layers.entries()) {
      const state = new Float32Array(await layer.state.read());
      result[number].push(...state.subarray(0, 12 * layer.sites.cells));
    }
  }
  await viewer.use("", 1);
  Object.assign(stage.settings, viewer.defaults);
  return result;
}

function assertSame(states, expected) {
  assert.equal(states.length, expected.length);
  const worst = expected.reduce((most, value, at) => Math.max(most, Math.abs(value - states[at])), 0);
  assert.ok(worst < 1e-5, `states are ${worst} apart`);
}

test("the velocity carries each rule of a mix as it was taught", slow, async () => {
  const asked = ["carried", "standing", [0, 1, 2, 3], told.config, -1];
  const [carried, standing] = await still.page.evaluate(statesAt, asked);
  assertSame(carried, floats("carried_1.state"));
  assertSame(standing, floats("standing_1.state"));
  const first = 12 * told.styles.carried[1].cells[0];
  assert.ok(apart(carried.slice(first), standing.slice(first)) > 1e-3);
});

test("it carries over frames that are skipped, as fast as is asked for", slow, async () => {
  const { at, speed } = told.leaps;
  const [states] = await still.page.evaluate(statesAt, ["standing", "", at, told.config, speed]);
  assertSame(states, floats("leaps.state"));
});

test("a rule is told of fields of the smoke, and refused where they are not", slow, async () => {
  const warm = await serve(join(MATERIAL, "fields"));
  const { page, errors, close } = await openStill(browser, warm.address);
  const [states] = await page.evaluate(statesAt, ["warm", "", [0, 1, 2, 3], told.config, -1]);
  assertSame(states, floats("fields.state"));
  const plain = await page.evaluate(statesAt, ["ink", "", [0, 1, 2, 3], told.config, -1]);
  assert.ok(apart(states, plain[0]) > 1e-3, "it matters to the rule");
  assert.deepEqual(errors, []);
  await close();
  warm.close();
  const refused = await still.page.evaluate(async () => {
    const before = viewer.names[0];
    [...document.querySelectorAll("#styles button")].at(-1).click();
    while (!document.querySelector("#notice.shown")) await new Promise((done) => setTimeout(done, 50));
    return [document.getElementById("notice").textContent, viewer.names[0] === before];
  });
  const line = "warm: the rule is conditioned on temperature, which this sequence does not have";
  assert.deepEqual(refused, [line, true]);
});

test("back and forth a carried pattern comes to where it was", slow, async () => {
  const found = await still.page.evaluate(async () => {
    const { stage } = viewer;
    await viewer.use("carried", 0);
    const [layer] = stage.layers;
    const taught = stage.patternSpeed(layer);
    const seen = async () => {
      const state = new Float32Array(await layer.state.read());
      return Array.from({ length: layer.sites.cells }, (_, row) => state[12 * row]);
    };
    // How far the first channel is from what it was once it has been a frame ahead, without a step.
    const changed = async (ahead, back) => {
      stage.settings.warmup = 32;
      layer.reset();
      await viewer.goTo(2);
      const before = await seen();
      layer.step = () => undefined;
      stage.settings.patternSpeed = ahead;
      await viewer.goTo(3);
      stage.settings.patternSpeed = back;
      await viewer.goTo(2);
      delete layer.step;
      const after = await seen();
      return before.reduce((sum, value, k) => sum + Math.abs(value - after[k]), 0) / before.length;
    };
    const result = { taught, both: await changed(1, 1), ahead: await changed(1, 0), none: await changed(0, 0) };
    Object.assign(stage.settings, viewer.defaults);
    return result;
  });
  assert.equal(found.taught, 1);
  assert.ok(found.none < found.both && found.both < 0.9 * found.ahead, JSON.stringify(found));
});

test("it plays to the end", slow, async () => {
  const { page } = still;
  await page.evaluate(() => {
    viewer.speed = 2;
    globalThis.ended = new Promise((done) => viewer.addEventListener("ended", done, { once: true }));
  });
  await page.keyboard.press("r");
  await page.waitForFunction(() => viewer.stage.at === 0);
  await page.keyboard.press("Space");
  await page.evaluate(() => globalThis.ended);
  const [at, length, fineness] = await page.evaluate(() => [
    viewer.stage.at, viewer.smoke.length, viewer.fineness,
  ]);
  assert.equal(at, length - 1);
  assert.ok(fineness < 1, "on a CPU pictures come late, so they get coarser");
  assert.equal(await page.textContent("#frame"), "16");
});

test("another style paints when it is chosen", slow, async () => {
  const { page } = still;
  await page.evaluate(() => viewer.use("ink", 0));
  const ink = await pixels(page);
  await page.evaluate(() => document.querySelectorAll("#styles button")[3].click());
  await page.waitForFunction(() => viewer.names[0] === "embers");
  assert.ok(apart(ink, await pixels(page)) > 2);
  assert.equal(await page.textContent("#painted"), "embers");
});

test("what is erased heals", slow, async () => {
  const { page } = still;
  const found = await page.evaluate(async () => {
    await viewer.use("ink", 0);
    viewer.tool = "erase";
    viewer.stage.settings.brush = 3;
    const whole = [...(await viewer.stage.pixels(64, 64))];
    const zeros = async () => {
      const [layer] = viewer.stage.layers;
      const state = new Float32Array(await layer.state.read());
      let count = 0;
      for (let row = 0; row < layer.sites.cells; row++) {
        if (state.subarray(12 * row, 12 * row + 12).every((value) => value === 0)) count++;
      }
      return count;
    };
    const before = await zeros();
    await viewer.touch(0.5, 0.42);
    const erased = [...(await viewer.stage.pixels(64, 64))];
    const after = await zeros();
    viewer.stage.step(64);
    const healed = [...(await viewer.stage.pixels(64, 64))];
    const last = await zeros();
    viewer.tool = "orbit";
    return { whole, erased, healed, before, after, last };
  });
  assert.ok(found.after > found.before + 20, `${found.after - found.before} cells erased`);
  assert.ok(found.last <= found.before);
  assert.ok(apart(found.whole, found.erased) > 0.3, "the hole is seen");
  assert.ok(apart(found.erased, found.healed) > 0.3, "and what grows in it");
});

test("two styles are mixed by slider and by brush", slow, async () => {
  const { page } = still;
  const found = await page.evaluate(async () => {
    const shot = async () => [...(await viewer.stage.pixels(48, 48))];
    await viewer.use("ink", 0);
    const ink = await shot();
    await viewer.use("frost", 1);
    const half = await shot();
    viewer.set("mix", 0);
    const none = await shot();
    viewer.tool = "more";
    await viewer.touch(0.5, 0.42);
    const brushed = await shot();
    viewer.set("mix", 1);
    const all = await shot();
    await viewer.use("", 1);
    viewer.tool = "orbit";
    return { ink, half, none, brushed, all };
  });
  assert.deepEqual(found.none, found.ink);
  const [half, all] = [apart(found.half, found.ink), apart(found.all, found.ink)];
  assert.ok(half > 0.5 && all > half, `${half} and ${all} from the first`);
  assert.ok(apart(found.brushed, found.ink) > 0.1);
});

test("beside the plain smoke one half is white", slow, async () => {
  const { page } = still;
  await page.keyboard.press("b");
  const seen = await pixels(page);
  await page.mouse.move(100, 40);
  await page.mouse.down();
  await page.mouse.move(150, 40, { steps: 2 });
  await page.mouse.up();
  assert.equal(await page.evaluate(() => viewer.stage.settings.wipe), 0.75);
  await page.keyboard.press("b");
  const painted = await pixels(page);
  const saturation = (from, to) => {
    let most = 0;
    for (let y = 0; y < 64; y++) {
      for (let x = from; x < to; x++) {
        const [r, g, b] = seen.slice(4 * (64 * y + x), 4 * (64 * y + x) + 3);
        most = Math.max(most, Math.max(r, g, b) - Math.min(r, g, b));
      }
    }
    return most;
  };
  assert.ok(saturation(0, 31) > 20);
  assert.ok(saturation(33, 64) < 12, "grey but for the background");
  assert.notDeepEqual(seen, painted);
});

test("a lost device is opened again, with all that was set", slow, async () => {
  const { page } = still;
  const before = await page.evaluate(async () => {
    await viewer.use("church", 0);
    viewer.set("exposure", 0.5);
    await viewer.goTo(2);
    const recovered = new Promise((done) => viewer.addEventListener("recovered", done, { once: true }));
    const old = viewer.gpu;
    viewer.gpu.device.destroy();
    await recovered;
    return old !== viewer.gpu;
  });
  assert.ok(before);
  const found = await page.evaluate(() => [viewer.names[0], viewer.stage.settings.exposure, viewer.stage.at]);
  assert.deepEqual(found, ["church", 0.5, 2]);
  assert.ok(Math.max(...(await pixels(page)).filter((_, at) => at % 4 < 3)) > 100);
  await page.evaluate(() => viewer.set("exposure", 0));
});

test("the canvas follows the window", slow, async () => {
  const { page } = still;
  await page.setViewportSize({ width: 230, height: 140 });
  await page.waitForFunction(() => document.getElementById("canvas").width === 230);
  await page.setViewportSize({ width: 200, height: 240 });
  await page.waitForFunction(() => document.getElementById("canvas").height === 240);
});

test("keys, wheel and fingers move the camera and choose tools", slow, async () => {
  const { page } = still;
  const camera = () => page.evaluate(() => ({ ...viewer.stage.camera, at: viewer.stage.at, tool: viewer.tool }));
  const before = await camera();
  await page.keyboard.press("Shift+ArrowRight");
  await page.keyboard.press("2");
  await page.keyboard.press("ArrowLeft");
  await page.waitForFunction((at) => viewer.stage.at === at - 1, before.at);
  const turned = await camera();
  assert.equal(turned.azimuth, before.azimuth + 4);
  assert.equal(turned.tool, "erase");
  await page.keyboard.press("1");
  await page.mouse.move(130, 40);
  await page.mouse.wheel(0, -300);
  const near = await camera();
  assert.ok(near.distance < turned.distance);
  await page.mouse.down();
  await page.mouse.move(150, 50, { steps: 3 });
  await page.mouse.up();
  const orbited = await camera();
  assert.ok(orbited.elevation > near.elevation && orbited.azimuth !== near.azimuth);
  await page.evaluate(() => {
    const canvas = document.getElementById("canvas");
    canvas.setPointerCapture = () => undefined;
    const finger = (type, pointerId, clientX) =>
      canvas.dispatchEvent(
        new PointerEvent(type, { pointerId, clientX, clientY: 80, pointerType: "touch", bubbles: true }),
      );
    finger("pointerdown", 11, 70);
    finger("pointerdown", 12, 90);
    finger("pointermove", 12, 130);
    finger("pointerup", 11, 70);
    finger("pointerup", 12, 130);
  });
  assert.ok((await camera()).distance < 0.5 * orbited.distance);
  await page.keyboard.press("f");
});

test("a link restores what is seen", slow, async () => {
  const { page } = still;
  const asked = { strength: 0.7, patternSpeed: 0.5, lightAzimuth: 30, mix: 0.25, detail: 1 };
  const address = await page.evaluate(async (asked) => {
    Object.assign(viewer.stage.settings, asked);
    await viewer.use("frost", 0);
    await viewer.use("ink", 1);
    viewer.stage.settings.mix = asked.mix;
    await viewer.goTo(2);
    viewer.look((camera) => Object.assign(camera, { azimuth: 33, elevation: 12 }));
    document.querySelector("[aria-label^='Copy a link']").click();
    return location.href;
  }, asked);
  const other = await open(browser, address);
  await other.page.waitForSelector("body.ready");
  const found = await other.page.evaluate(() => ({
    names: viewer.names, at: viewer.stage.at, camera: viewer.stage.camera, settings: viewer.stage.settings,
  }));
  assert.deepEqual(found.names, ["frost", "ink"]);
  assert.equal(found.at, 2);
  assert.equal(found.camera.azimuth, 33);
  for (const [name, value] of Object.entries(asked)) assert.equal(found.settings[name], value);
  assert.deepEqual([other.foreign, other.errors], [[], []]);
  await other.close();
  await page.evaluate(() => viewer.use("", 1));
});

test("pictures and films are saved", slow, async () => {
  const { page } = still;
  const saved = async (label) => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.evaluate((label) => document.querySelector(`[aria-label^='${label}']`).click(), label),
    ]);
    return [download.suggestedFilename(), readFileSync(await download.path())];
  };
  const [name, png] = await saved("Save a picture");
  assert.match(name, /^smoke_.*\.png$/);
  assert.equal(png.subarray(1, 4).toString(), "PNG");
  assert.deepEqual([png.readUInt32BE(16), png.readUInt32BE(20)], [200, 240]);
  const [film, webm] = await saved("Save a film");
  assert.match(film, /\.webm$/);
  assert.equal(webm.readUInt32BE(0), 0x1a45dfa3);
  assert.ok(webm.length > 1000);
});

test("after all that it asked for nothing outside and complained of nothing", () => {
  assert.deepEqual(still.foreign, []);
  assert.deepEqual(still.errors, []);
});

test("a folder of another name is a site as well", slow, async () => {
  const moved = join(MATERIAL, "elsewhere");
  rmSync(moved, { recursive: true, force: true });
  cpSync(join(MATERIAL, "site"), join(moved, "a folder, ünlike"), { recursive: true });
  const other = await serve(moved);
  const opened = await open(browser, `${other.address}a%20folder,%20%C3%BCnlike/`);
  await opened.page.waitForSelector("body.ready");
  assert.equal(await opened.page.evaluate(() => viewer.stage.at >= 0), true);
  assert.deepEqual([opened.foreign, opened.errors], [[], []]);
  await opened.close();
  other.close();
});

test("a phone sees all of it", slow, async () => {
  const phone = { size: [390, 760], hasTouch: true, isMobile: true, deviceScaleFactor: 1 };
  const opened = await open(browser, `${server.address}#frame=0`, phone);
  await opened.page.waitForSelector("body.ready");
  const found = await opened.page.evaluate(() => {
    viewer.isAlive = false;
    const outside = [...document.querySelectorAll("#transport, #transport button, #tools, header")].filter(
      (each) => {
        const { left, right, top, bottom } = each.getBoundingClientRect();
        return left < 0 || right > innerWidth || top < 0 || bottom > innerHeight;
      },
    );
    return [document.documentElement.scrollWidth, outside.map((each) => each.id || each.title)];
  });
  assert.deepEqual(found, [390, []]);
  assert.deepEqual(opened.errors, []);
  await opened.close();
});

test("what cannot be shown is refused in one line", { timeout: 10 * PATIENCE }, async (each) => {
  const other = await serve(join(MATERIAL, "hostile"));
  const names = JSON.parse(readFileSync(join(MATERIAL, "hostile/cases.json")));
  assert.ok(names.length > 30);
  for (const name of names) {
    await each.test(name, slow, async () => {
      const opened = await open(browser, `${other.address}${name}/`);
      await opened.page.waitForSelector("#stopped");
      const line = await opened.page.textContent("#reason");
      assert.ok(line.length > 10 && line.length <= 301 && !line.includes("\n"), line);
      assert.doesNotMatch(line, /undefined|null|Error|Cannot|function|NaN/);
      assert.equal(await opened.page.locator("#stopped script").count(), 0);
      const missing = name.endsWith("missing") ? 1 : 0; // the browser itself tells of what is not there
      assert.deepEqual([opened.errors.length, opened.foreign], [missing, []]);
      await opened.close();
    });
  }
  other.close();
});

test("models with any byte changed are refused in one line or paint", slow, async () => {
  const { page } = still;
  const found = await page.evaluate(async () => {
    const bytes = new Uint8Array(await (await fetch("rules/0.safetensors")).arrayBuffer());
    const length = 8 + Number(new DataView(bytes.buffer).getBigUint64(0, true));
    const lines = [];
    let seed = 1;
    const drawn = (below) => (seed = (1103515245 * seed + 12345) % 2 ** 31) % below;
    for (let round = 0; round < 80; round++) {
      const changed = bytes.slice(0, round % 4 === 3 ? drawn(bytes.length) : bytes.length);
      for (let k = 0; k < 3; k++) changed[drawn(Math.min(length, changed.length))] = drawn(256);
      try {
        await viewer.add(new File([changed], "changed"));
        const state = new Float32Array(await viewer.stage.layers[0].state.read());
        if (state.length === 0) lines.push("nothing paints");
      } catch (error) {
        if (!error.constructor || /Cannot|undefined|not a function/.test(error.message)) lines.push(error.stack);
        else if (!/^changed/.test(error.message)) lines.push(error.message);
      }
    }
    viewer.show.rules = viewer.show.rules.filter(({ name }) => name !== "changed");
    await viewer.use("ink", 0);
    return lines;
  });
  assert.deepEqual(found, []);
});

test("without WebGPU it says so, and where there is some", slow, async () => {
  const script = "delete Navigator.prototype.gpu";
  const opened = await open(browser, server.address, { script });
  await opened.page.waitForSelector("#stopped");
  assert.equal(await opened.page.textContent("h1"), "No WebGPU here");
  assert.match(await opened.page.textContent("#reason"), /no WebGPU.*Safari 26/);
  assert.deepEqual(opened.errors, []);
  await opened.close();
});

/** A script by which a GPU binds no more bytes at once than so many. */
const binding = (bytes) =>
  "const limits = Object.getOwnPropertyDescriptor(GPUDevice.prototype, 'limits');" +
  "Object.defineProperty(GPUDevice.prototype, 'limits', { get() {" +
  "  return new Proxy(limits.get.call(this), { get: (all, name) =>" +
  `    name === 'maxStorageBufferBindingSize' ? ${bytes} : all[name] }); } });`;

test("what is bound in parts is painted and drawn the same to the bit", { timeout: 10 * PATIENCE }, async (test) => {
  const wide = await serve(join(MATERIAL, "wide"));
  test.after(() => wide.close());
  const seen = async (script, ...asked) => {
    const options = { script: `${PARTS};${script}`, size: [80, 80] };
    const { page, errors, close } = await open(browser, `${wide.address}#frame=0&warmup=1`, options);
    await page.waitForSelector("body.ready");
    const found = [];
    for (const ask of asked) found.push(await page.evaluate(ask, told.config));
    assert.deepEqual([errors, await page.locator("#notice.shown").count()], [[], 0]);
    await close();
    return found;
  };
  // Two rules on one frame, mixed by a brush; and what carries a rule along, which binds more arrays.
  const cases = [
    [24_000, mixedByBrush, ["places", "state", "words", "painted", "brushed"]],
    [36_000, carriedAlong, ["places", "state", "painted", "brushed"]],
  ];
  const whole = await seen("", ...cases.map(([, ask]) => ask));
  for (const [k, [bytes, ask, divided]] of cases.entries()) {
    const [parts] = await seen(binding(bytes), ask);
    for (const name of divided) {
      assert.equal(whole[k].parts[name], 1, name);
      assert.ok(parts.parts[name] > 1, `${name} in ${parts.parts[name]} part`);
    }
    assert.deepEqual(parts.states, whole[k].states);
    assert.deepEqual(parts.pixels, whole[k].pixels);
    assert.ok(parts.states.some((value) => value !== 0));
  }
});

/** In the page: nothing happens by itself; and into how many parts what is on the GPU is divided. */
const PARTS =
  "globalThis.still = () => { viewer.pause(); viewer.isAlive = false; viewer.adapt = () => undefined;" +
  "  viewer.stage.samples = 0; };" +
  "globalThis.parts = () => { const { layers: [{ places, state, painted }], buffers, brush } = viewer.stage;" +
  "  const all = { places, state, painted, words: buffers.words, brushed: brush.brushed };" +
  "  return Object.fromEntries(Object.entries(all).map(([name, rows]) => [name, rows.layout.parts])); }";

/** In the page: states and picture of two rules, brushed over each other and partly erased. */
async function mixedByBrush() {
  const { stage } = viewer;
  globalThis.still();
  Object.assign(stage.settings, { warmup: 8, steps: 4, mix: 0, brush: 3 });
  await viewer.use("carried", 0);
  await viewer.use("church", 1);
  viewer.set("mix", 0);
  for (const layer of stage.layers) layer.reset();
  await viewer.goTo(0);
  stage.camera = stage.framed(1);
  stage.touch("more", [0, 0.05], 1);
  stage.touch("erase", [0.1, 0], 1);
  stage.step(2);
  const pixels = [...(await stage.pixels(64, 64))];
  const states = await Promise.all(stage.layers.map((layer) => layer.state.read()));
  return { pixels, states: states.flatMap((state) => [...new Float32Array(state)]), parts: globalThis.parts() };
}

/** In the page: states and picture of a rule that the velocity carries along, at the last frame. */
async function carriedAlong({ warmup, steps_per_frame: steps, seed }) {
  const { stage } = viewer;
  globalThis.still();
  await viewer.use("", 1);
  Object.assign(stage.settings, { warmup, steps, seed });
  await viewer.use("carried", 0);
  stage.layers[0].reset();
  for (let at = 0; at < stage.smoke.length; at++) await viewer.goTo(at);
  stage.camera = stage.framed(1);
  const pixels = [...(await stage.pixels(64, 64))];
  const states = [...new Float32Array(await stage.layers[0].state.read())];
  return { pixels, states, parts: globalThis.parts() };
}

test("what the adapter cannot bind is refused in one line", slow, async () => {
  const opened = await open(browser, server.address, { script: binding(4000) });
  await opened.page.waitForSelector("#stopped");
  const line = await opened.page.textContent("#reason");
  assert.match(line, /parts? of 0\.00381 MiB|takes .* MiB, and this GPU binds at most 0\.00381 MiB/);
  assert.deepEqual(opened.errors, []);
  await opened.close();
});
