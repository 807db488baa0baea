import { launch, open, openStill, serve } from "/work/wt/web/web/tests/browser.mjs";
const site = process.argv[2];
const browser = await launch(); const server = await serve(site);
const still = await openStill(browser, server.address);
console.log(await still.page.evaluate(async () => {
  const a = await navigator.gpu.requestAdapter(); const l = {};
  for (const k of ["maxStorageBufferBindingSize","maxBufferSize","maxStorageBuffersPerShaderStage","maxStorageBuffersInFragmentStage","maxTextureDimension3D"]) l[k]=a.limits[k];
  return {l, info: [a.info.vendor, a.info.architecture, a.info.description], features:[...a.features].join(), cells: viewer.stage.layers[0].sites.cells, beside: viewer.stage.layers[0].sites.beside, places: viewer.stage.layers[0].sites.places.length, words: viewer.stage.buffers.words.layout.count, box: [viewer.smoke.lower, viewer.smoke.upper]};
}));
console.log(still.errors, still.foreign);
await browser.close(); server.close();
