// A link that restores what is seen: what differs from the defaults, after the # of the address.

import type { Viewer } from "../viewer";
import { DEFAULTS, type Settings } from "../settings";

const NAMES = Object.keys(DEFAULTS) as (keyof Settings)[];
const CAMERA = ["azimuth", "elevation", "distance"] as const;
const RANGES: Partial<Record<keyof Settings, [number, number]>> = {
  seed: [0, 2 ** 31],
  exposure: [-16, 16],
  guide: [0, 1],
  mix: [0, 1],
  wipe: [0, 2],
  brush: [0.5, 64],
  detail: [1, 4],
  strength: [0, 1],
  densityStrength: [0, 1],
  steps: [0, 256],
  warmup: [0, 4096],
  patternSpeed: [-1, 8],
  density: [0.001, 1000],
  light: [0, 20],
  ambient: [0, 1],
  half: [0, 1],
};

/** A setting as it can be. */
export function within(name: keyof Settings, value: number): number {
  const [low, high] = RANGES[name] ?? [-1e6, 1e6];
  const given = name === "detail" ? Math.round(value) : value;
  return Math.min(Math.max(given, low), high);
}

/** The address of what is seen now. */
export function linkTo(viewer: Viewer): string {
  const told = new URLSearchParams();
  const { settings, camera, at } = viewer.stage;
  if (viewer.names[0] !== viewer.show.rules[0].name) told.set("rule", viewer.names[0]);
  if (viewer.names[1]) told.set("with", viewer.names[1]);
  for (const name of NAMES) {
    if (!viewer.isDefault(name)) told.set(name, short(settings[name]));
  }
  for (const name of CAMERA) told.set(name, short(camera[name]));
  told.set("target", camera.target.map(short).join(","));
  if (at > 0) told.set("frame", String(at));
  const address = new URL(location.href);
  address.hash = told.toString();
  return address.href;
}

/** What a link tells; what makes no sense in it is passed over. */
export async function restore(viewer: Viewer, hash: string): Promise<void> {
  const told = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name: string): number | null => {
    const value = Number(told.get(name));
    return told.has(name) && Number.isFinite(value) ? value : null;
  };
  const { settings, camera } = viewer.stage;
  for (const name of NAMES) {
    const value = number(name);
    if (value === null) continue;
    settings[name] = within(name, value);
  }
  for (const name of CAMERA) {
    const value = number(name);
    if (value !== null && (name !== "distance" || value > 0)) camera[name] = value;
  }
  const target = (told.get("target") ?? "").split(",").map(Number);
  if (target.length === 3 && target.every(Number.isFinite)) camera.target = target;
  const known = (name: string | null): string | null =>
    viewer.show.rules.some((rule) => rule.name === name) ? name : null;
  await viewer.use(known(told.get("rule")) ?? viewer.show.rules[0].name, 0);
  const other = known(told.get("with"));
  if (other !== null) await viewer.use(other, 1);
  await viewer.goTo(Math.round(number("frame") ?? 0));
}

function short(value: number): string {
  return String(Number(value.toPrecision(6)));
}
