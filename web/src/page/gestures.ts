// Fingers and mice: orbit, pan, zoom and brushes on the canvas.

import { type Camera, slope, viewAxes } from "../picture/camera";
import { plus } from "../matrix";
import type { Viewer } from "../viewer";

const TURN = 0.35; // degrees a pixel
const STEEPEST = 89;
const GRIP = 12; // pixels beside the line to the plain smoke by which it is taken

/** Turns a camera by so many degrees. */
export function turn(camera: Camera, azimuth: number, elevation: number): void {
  camera.azimuth = (((camera.azimuth + azimuth) % 360) + 360) % 360;
  camera.elevation = Math.min(Math.max(camera.elevation + elevation, -STEEPEST), STEEPEST);
}

/** Moves what a camera looks at by parts of the picture's height, right and up. */
export function pinholeMoved(camera: Camera, x: number, y: number): void {
  const [right, up] = viewAxes(camera.azimuth, camera.elevation);
  const height = 2 * camera.distance * slope(camera.fieldOfView);
  camera.target = plus(plus(camera.target, right, -x * height), up, -y * height);
}

export function zoom(camera: Camera, times: number, least: number, most: number): void {
  camera.distance = Math.min(Math.max(camera.distance * times, least), most);
}

export function listen(viewer: Viewer): void {
  const { canvas } = viewer;
  const fingers = new Map<number, PointerEvent>();
  const home = viewer.stage.camera.distance;
  const near = home / 20;
  const far = home * 10;
  let brushing = false;

  const brush = async (event: PointerEvent): Promise<void> => {
    if (brushing) return;
    brushing = true;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    await viewer.touch((event.clientX - left) / width, (event.clientY - top) / height);
    brushing = false;
  };

  const lineAt = (event: PointerEvent): number => {
    const { left, width } = canvas.getBoundingClientRect();
    return (event.clientX - left) / width;
  };
  let isLine = false;

  const isBrush = (event: PointerEvent): boolean =>
    viewer.tool !== "orbit" && fingers.size === 1 && !event.shiftKey && !(event.buttons & 6);

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    const { wipe } = viewer.stage.settings;
    isLine = wipe < 1 && Math.abs(lineAt(event) - wipe) * canvas.clientWidth < GRIP;
    if (!isLine && isBrush(event)) void brush(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (before === undefined) return;
    const x = event.clientX - before.clientX;
    const y = event.clientY - before.clientY;
    const other = [...fingers.values()].find((each) => each.pointerId !== event.pointerId);
    fingers.set(event.pointerId, event);
    if (isLine) {
      viewer.set("wipe", Math.min(Math.max(lineAt(event), 0.02), 0.98));
    } else if (isBrush(event)) {
      void brush(event);
    } else if (other !== undefined) {
      const span = (from: PointerEvent): number =>
        Math.hypot(from.clientX - other.clientX, from.clientY - other.clientY) || 1;
      viewer.look((camera) => zoom(camera, span(before) / span(event), near, far));
      viewer.move(x / 2 / canvas.clientHeight, -y / 2 / canvas.clientHeight);
    } else if (event.shiftKey || event.buttons & 6) {
      viewer.move(x / canvas.clientHeight, -y / canvas.clientHeight);
    } else {
      viewer.look((camera) => turn(camera, -TURN * x, TURN * y));
    }
  });
  const lifted = (event: PointerEvent): void => {
    fingers.delete(event.pointerId);
    isLine = false;
  };
  canvas.addEventListener("pointerup", lifted);
  canvas.addEventListener("pointercancel", lifted);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
      viewer.look((camera) => zoom(camera, Math.exp((lines * event.deltaY) / 900), near, far));
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", () => viewer.reframe());
}
