// A training that goes on: the rule as it is now, and its curves.

import { element } from "./dom";
import { bytesOf } from "./show";
import type { Viewer } from "../viewer";

const EVERY = 2000; // ms
const SMOOTH = 0.8;
const WIDE = 300;
const HIGH = 64;

interface Told {
  /** Changes with the model file. */
  model: string;
  iteration: number;
  iterations: number;
  curves: Record<string, [number, number][]>;
}

/** Ask for progress as long as the page is open. */
export function watchRun(viewer: Viewer): void {
  const place = element("section", { id: "curves", "aria-label": "Training" });
  document.body.append(place);
  let model = "";
  const ask = async (): Promise<void> => {
    try {
      const told: Told = JSON.parse(new TextDecoder().decode(await bytesOf("run.json")));
      draw(place, told);
      if (told.model !== model) {
        await viewer.learned(await bytesOf(viewer.show.rules[0].model));
        model = told.model;
      }
    } catch {
      // The training may have ended, or the file be written right now: what is there stays.
    }
    setTimeout(() => void ask(), EVERY);
  };
  void ask();
}

function draw(place: HTMLElement, { iteration, iterations, curves }: Told): void {
  const of = iterations > 0 ? ` of ${iterations}` : "";
  const parts = Object.entries(curves)
    .filter(([, points]) => points.length > 1)
    .map(([name, points]) => {
      const last = points[points.length - 1][1];
      const caption = element("figcaption", {}, name, element("output", {}, String(Number(last.toPrecision(3)))));
      return element("figure", {}, caption, plot(points));
    });
  place.replaceChildren(element("h2", {}, `Iteration ${iteration}${of}`), ...parts);
}

/** Points, and a running mean of them, on a logarithmic axis where all are above zero. */
function plot(points: [number, number][]): SVGSVGElement {
  const finite = points.filter(([, value]) => Number.isFinite(value));
  const isLog = finite.every(([, value]) => value > 0);
  const values = finite.map(([, value]) => (isLog ? Math.log(value) : value));
  const low = Math.min(...values);
  const span = Math.max(...values) - low || 1;
  const first = finite[0]?.[0] ?? 0;
  const length = (finite[finite.length - 1]?.[0] ?? 1) - first || 1;
  const path = (given: number[]): string =>
    given
      .map((value, k) => {
        const x = (WIDE * (finite[k][0] - first)) / length;
        return `${k === 0 ? "M" : "L"}${x.toFixed(1)} ${(HIGH - (HIGH * (value - low)) / span).toFixed(1)}`;
      })
      .join("");
  let mean = values[0] ?? 0;
  const smooth = values.map((value) => (mean = SMOOTH * mean + (1 - SMOOTH) * value));
  const space = "http://www.w3.org/2000/svg";
  const drawing = document.createElementNS(space, "svg");
  drawing.setAttribute("viewBox", `-2 -2 ${WIDE + 4} ${HIGH + 4}`);
  for (const [kind, given] of [["raw", values], ["mean", smooth]] as const) {
    const line = document.createElementNS(space, "path");
    line.setAttribute("d", path(given));
    line.setAttribute("class", kind);
    drawing.append(line);
  }
  return drawing;
}
