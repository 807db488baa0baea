// The page: reads what it is to show, opens the GPU, and puts its parts on the screen.

import { element } from "./page/dom";
import { listen } from "./page/gestures";
import { makeHelp } from "./page/help";
import { listenToKeys } from "./page/keys";
import { restore, within } from "./page/link";
import { say, stop, WHERE } from "./page/notice";
import { makePanel } from "./page/panel";
import { oneLine } from "./problem";
import { makeRing } from "./page/ring";
import { watchRun } from "./page/run";
import type { Settings } from "./settings";
import { readShow } from "./page/show";
import { makeStrip } from "./page/strip";
import { makeTools } from "./page/tools";
import { makeTransport } from "./page/transport";
import { Viewer } from "./viewer";

const canvas = document.getElementById("canvas") as HTMLCanvasElement;

async function begin(): Promise<void> {
  const show = await readShow();
  document.title = `${show.title} · vnca`;
  const viewer = await Viewer.open(canvas, show);
  Object.assign(viewer.stage.settings, known(show.settings, viewer));
  // For tests, and for whoever likes to try things from the browser's console.
  Object.assign(globalThis, { viewer });
  await restore(viewer, location.hash);
  window.addEventListener("hashchange", () => void restore(viewer, location.hash));
  build(viewer);
  document.body.classList.add("ready");
  if (show.run) watchRun(viewer);
  else if (!location.hash) await viewer.play();
}

/** Settings of a show that there are, each as it can be. */
function known(settings: Record<string, number>, viewer: Viewer): Partial<Settings> {
  const names = Object.keys(viewer.defaults) as (keyof Settings)[];
  const given = names.filter((name) => Number.isFinite(settings[name]));
  return Object.fromEntries(given.map((name) => [name, within(name, settings[name])]));
}

function build(viewer: Viewer): void {
  const painted = element("span", { id: "painted" });
  const update = (): void => {
    const [first, second] = viewer.names.map((name) => name.replaceAll("_", " "));
    painted.textContent = second ? `${first} and ${second}` : first;
  };
  viewer.addEventListener("rules", update);
  update();
  if (window.innerWidth < 720) document.body.classList.add("bare");
  document.body.append(
    element("header", {}, element("h1", {}, viewer.smoke.name), painted),
    makeTools(viewer),
    makePanel(viewer),
    element("footer", {}, makeStrip(viewer), makeTransport(viewer)),
    makeRing(viewer),
    makeHelp(),
  );
  listen(viewer);
  listenToKeys(viewer);
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    const file = event.dataTransfer?.files[0];
    if (file) viewer.add(file).catch((error: unknown) => say(oneLine(error)));
  });
}

begin().catch((error: unknown) => {
  const line = oneLine(error);
  const isGpu = /WebGPU/.test(line);
  stop(isGpu ? "No WebGPU here" : "This cannot be shown", isGpu ? `${line} ${WHERE}` : line);
});
