import { Gpu } from "./gpu";
import { readModel } from "./model";
import { Smoke } from "./smoke";
import { Stage } from "./stage";

const show = await (await fetch("show.json")).json();
const smoke = await Smoke.open(show.smoke);
const gpu = await Gpu.open();
const stage = await Stage.create(gpu, smoke, navigator.gpu.getPreferredCanvasFormat());
const model = await (await fetch(show.rules[0].model)).arrayBuffer();
await stage.use(readModel(model, show.rules[0].name), 0);
Object.assign(globalThis, { stage, gpu });
Object.assign(globalThis, {
  useStyle: async (name: string) => {
    const rule = show.rules.find((each: { name: string }) => each.name === name);
    await stage.use(readModel(await (await fetch(rule.model)).arrayBuffer(), name), 0);
  },
});
document.title = "ready";
