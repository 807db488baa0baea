import { launch, open, serve } from "./browser.mjs";
const [site, bytes, hash] = process.argv.slice(2);
const script = Number(bytes) ? "const limits = Object.getOwnPropertyDescriptor(GPUDevice.prototype, 'limits');" +
  "Object.defineProperty(GPUDevice.prototype, 'limits', { get() {" +
  "  return new Proxy(limits.get.call(this), { get: (all, name) =>" +
  `    name === 'maxStorageBufferBindingSize' ? ${bytes} : all[name] }); } });` : undefined;
const browser = await launch(); const server = await serve(site);
const o = await open(browser, `${server.address}#frame=0`, { script });
await Promise.race([o.page.waitForSelector("body.ready"), o.page.waitForSelector("#stopped")]);
console.log(await o.page.evaluate(() => [document.getElementById("reason")?.textContent, document.getElementById("notice")?.textContent]), o.errors);
await o.page.waitForTimeout(1000);
console.log(await o.page.evaluate(() => viewer.stage.layers.map((l) => [l.sites?.cells, l.sites?.beside, l.places?.layout, l.state?.layout, l.painted?.layout, viewer.stage.brush.brushed.layout, viewer.stage.buffers.words.layout])));
await browser.close(); server.close();
