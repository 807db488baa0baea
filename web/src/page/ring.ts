// A ring around the pointer, as wide as the brush is where the camera looks at.

import { slope } from "../picture/camera";
import { element } from "./dom";
import { spacing } from "../picture/volume";
import type { Viewer } from "../viewer";

export function makeRing(viewer: Viewer): HTMLElement {
  const ring = element("div", { id: "ring", "aria-hidden": "true" });
  const { canvas } = viewer;
  const size = (): void => {
    const { camera, settings } = viewer.stage;
    const high = 2 * camera.distance * slope(camera.fieldOfView);
    const wide = (2 * settings.brush * spacing(viewer.smoke) * canvas.clientHeight) / high;
    ring.style.width = ring.style.height = `${wide}px`;
    ring.dataset.tool = viewer.tool;
  };
  canvas.addEventListener("pointermove", (event) => {
    ring.classList.toggle("shown", viewer.tool !== "orbit");
    ring.style.left = `${event.clientX}px`;
    ring.style.top = `${event.clientY}px`;
  });
  const hide = (): void => ring.classList.remove("shown");
  canvas.addEventListener("pointerleave", hide);
  canvas.addEventListener("pointerup", (event) => {
    if (event.pointerType === "touch") hide();
  });
  viewer.addEventListener("change", () => {
    size();
    if (viewer.tool === "orbit") hide();
  });
  size();
  return ring;
}
