// What can be set, in groups: sliders that say what they are worth, and go back by a double click.

import { element } from "./dom";
import type { Settings } from "../settings";
import type { Viewer } from "../viewer";

interface Slider {
  name: keyof Settings;
  label: string;
  low: number;
  high: number;
  step: number;
  /** A logarithmic slider runs from the logarithm of `low` to that of `high`. */
  log?: boolean;
  unit?: string;
  hint: string;
}

const GROUPS: [string, Slider[]][] = [
  [
    "Paint",
    [
      { name: "strength", label: "Colour", low: 0, high: 1, step: 0.01, hint: "From white smoke to the colours of the style" },
      { name: "densityStrength", label: "Density change", low: 0, high: 1, step: 0.01, hint: "How much the style thins and thickens the smoke" },
      { name: "density", label: "Opacity", low: 0.02, high: 20, step: 0.01, log: true, unit: "×", hint: "Extinction γ, as a multiple of the style's own" },
      { name: "steps", label: "Steps a frame", low: 0, high: 64, step: 1, hint: "How long the rule works between two frames; 0 is as in its training" },
      { name: "patternSpeed", label: "Pattern speed", low: 0, high: 2, step: 0.05, unit: "×", hint: "How fast the smoke carries the pattern from frame to frame: 0 stands, 1 goes along, 2 runs ahead" },
      { name: "detail", label: "Detail", low: 1, high: 3, step: 1, unit: "×", hint: "Parts of a cell that are drawn, as by --refine" },
      { name: "half", label: "16-bit steps", low: 0, high: 1, step: 1, hint: "Quicker, and a little rounder" },
      { name: "seed", label: "Seed", low: 0, high: 99, step: 1, hint: "Another seed, another painting of the same style" },
    ],
  ],
  [
    "Light",
    [
      { name: "light", label: "Light", low: 0, high: 3, step: 0.05, hint: "0: the smoke glows by itself" },
      { name: "lightAzimuth", label: "Around", low: -180, high: 180, step: 1, unit: "°", hint: "Where the light stands" },
      { name: "lightElevation", label: "Above", low: -90, high: 90, step: 1, unit: "°", hint: "How high it stands" },
      { name: "ambient", label: "Shadows", low: 0, high: 1, step: 0.01, hint: "How bright shadows are" },
      { name: "exposure", label: "Exposure", low: -3, high: 3, step: 0.05, unit: " EV", hint: "Brightness of the picture" },
    ],
  ],
  [
    "Guide",
    [
      { name: "guide", label: "Pull", low: 0, high: 1, step: 0.01, hint: "How much the pattern follows this direction instead of the smoke's motion" },
      { name: "guideAzimuth", label: "Around", low: -180, high: 180, step: 1, unit: "°", hint: "Direction of the pull" },
      { name: "guideElevation", label: "Up", low: -90, high: 90, step: 1, unit: "°", hint: "Direction of the pull" },
    ],
  ],
  [
    "Brush and mix",
    [
      { name: "mix", label: "Second style", low: 0, high: 1, step: 0.01, hint: "How much of the second style is seen" },
      { name: "brush", label: "Brush", low: 1, high: 24, step: 0.5, unit: " cells", hint: "Radius of the brushes" },
    ],
  ],
];

export function makePanel(viewer: Viewer): HTMLElement {
  const panel = element("aside", { id: "panel", "aria-label": "Settings" });
  const updates: (() => void)[] = [];
  for (const [title, sliders] of GROUPS) {
    const group = element("details", { open: title !== "Guide" }, element("summary", {}, title));
    for (const slider of sliders) {
      if (slider.name === "half" && !viewer.gpu.hasHalf) continue;
      group.append(makeSlider(viewer, slider, updates));
    }
    panel.append(group);
  }
  const update = (): void => updates.forEach((each) => each());
  viewer.addEventListener("change", update);
  update();
  return panel;
}

function makeSlider(viewer: Viewer, slider: Slider, updates: (() => void)[]): HTMLElement {
  const { name, label, low, high, step, log = false, unit = "", hint } = slider;
  const input = element("input", {
    type: "range",
    min: log ? Math.log(low) : low,
    max: log ? Math.log(high) : high,
    step: log ? "any" : step,
    "aria-label": label,
    id: `set-${name}`,
  });
  const value = element("output", {});
  input.addEventListener("input", () => {
    const given = Number(input.value);
    viewer.set(name, log ? Number(Math.exp(given).toPrecision(3)) : given);
  });
  const reset = (): void => {
    viewer.set(name, viewer.show.settings[name] ?? viewer.defaults[name]);
  };
  const row = element("label", { class: "slider", title: hint, ondblclick: reset }, element("span", {}, label), value, input);
  updates.push(() => {
    const now = valueOf(viewer, name);
    const shown = log ? Math.log(now) : now;
    if (Number(input.value) !== shown) input.value = String(shown);
    const from = Number(input.min);
    const part = (shown - from) / (Number(input.max) - from);
    input.style.setProperty("--part", `${100 * Math.min(Math.max(part, 0), 1)}%`);
    value.textContent = text(viewer, name, now, unit);
    row.classList.toggle("changed", !viewer.isDefault(name));
  });
  return row;
}

/** What a setting comes to: one that is left to the rule is as the first one has it. */
function valueOf(viewer: Viewer, name: keyof Settings): number {
  const [first] = viewer.stage.layers;
  if (name === "patternSpeed" && first !== undefined) return viewer.stage.patternSpeed(first);
  return viewer.stage.settings[name];
}

function text(viewer: Viewer, name: keyof Settings, value: number, unit: string): string {
  if (name === "steps" && value === 0) return `${viewer.stage.layers[0]?.rule.steps ?? ""} as trained`;
  const kept = viewer.stage.settings[name] < 0 && name === "patternSpeed" ? " as trained" : "";
  return `${Number(value.toPrecision(3))}${unit}${kept}`;
}
