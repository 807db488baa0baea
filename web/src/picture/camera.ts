// A pinhole that walks around what it looks at: `core/camera.py`, angles in degrees, +z up.

import { dot, plus, scaled, type Vector } from "../matrix";

export interface Camera {
  target: Vector;
  azimuth: number;
  elevation: number;
  /** From the pinhole to the target. */
  distance: number;
  /** Vertical, degrees. */
  fieldOfView: number;
}

const RADIAN = Math.PI / 180;
const MARGIN = 0.04;

/** Unit vectors to the right, up and forward in the picture. */
export function viewAxes(azimuth: number, elevation: number): [Vector, Vector, Vector] {
  const [a, e] = [azimuth * RADIAN, elevation * RADIAN];
  const right = [Math.cos(a), Math.sin(a), 0];
  const level = [-Math.sin(a), Math.cos(a), 0];
  const z = [0, 0, 1];
  const up = plus(scaled(level, Math.sin(e)), z, Math.cos(e));
  const forward = plus(scaled(level, Math.cos(e)), z, -Math.sin(e));
  return [right, up, forward];
}

export function slope(fieldOfView: number): number {
  return Math.tan((fieldOfView * RADIAN) / 2);
}

export function pinhole(camera: Camera): Vector {
  const [, , forward] = viewAxes(camera.azimuth, camera.elevation);
  return plus(camera.target, forward, -camera.distance);
}

/** The camera that sees a box as large as the picture allows, all corners inside. */
export function frameBox(
  lower: Vector,
  upper: Vector,
  azimuth: number,
  elevation: number,
  aspect: number,
  fieldOfView: number,
): Camera {
  const axes = viewAxes(azimuth, elevation);
  const centre = scaled(plus(lower, upper), 0.5);
  const corners = Array.from({ length: 8 }, (_, corner) =>
    plus([0, 1, 2].map((axis) => ((corner >> axis) & 1 ? upper : lower)[axis]), centre, -1),
  );
  const [right, up, forward] = axes.map((axis) => corners.map((corner) => dot(corner, axis)));
  const used = (1 - 2 * MARGIN) * slope(fieldOfView);
  const [x, distanceX] = fit(right, forward, used * aspect);
  const [y, distanceY] = fit(up, forward, used);
  return {
    target: plus(plus(centre, axes[0], x), axes[1], y),
    azimuth,
    elevation,
    distance: Math.max(distanceX, distanceY),
    fieldOfView,
  };
}

/** Shift and least distance at which all lies within lines of a slope from the pinhole. */
function fit(across: Vector, forward: Vector, steep: number): [number, number] {
  const above = Math.max(...across.map((value, k) => value - steep * forward[k]));
  const below = Math.max(...across.map((value, k) => -value - steep * forward[k]));
  return [(above - below) / 2, (above + below) / (2 * steep)];
}
