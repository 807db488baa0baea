// Play, scrub and speed.

import { button, element } from "./dom";
import type { Viewer } from "../viewer";

const PLAY = "M8 5.5v13l11-6.5z";
const PAUSE = "M8 5.5v13M16 5.5v13";
const BACK = "M18 6.5v11L9 12zM6.5 6.5v11";
const SPEEDS = [0.25, 0.5, 1, 2];

export function makeTransport(viewer: Viewer): HTMLElement {
  const last = viewer.smoke.length - 1;
  const play = button("Play (space)", PLAY, () => void toggle(viewer));
  play.id = "play";
  const scrub = element("input", {
    type: "range", min: 0, max: Math.max(last, 1), step: 1, id: "scrub", "aria-label": "Frame",
  });
  scrub.disabled = last < 1;
  const frame = element("output", { id: "frame" });
  const speed = element("button", { type: "button", id: "speed", title: "Speed" });
  speed.addEventListener("click", () => {
    const next = (SPEEDS.indexOf(viewer.speed) + 1) % SPEEDS.length;
    viewer.speed = SPEEDS[next];
    viewer.changed();
  });
  let isScrubbing = false;
  scrub.addEventListener("input", async () => {
    if (isScrubbing) return;
    isScrubbing = true;
    viewer.pause();
    while (viewer.stage.at !== Number(scrub.value)) await viewer.goTo(Number(scrub.value));
    isScrubbing = false;
  });
  const update = (): void => {
    const at = Math.max(viewer.stage.at, 0);
    if (!isScrubbing) scrub.value = String(at);
    scrub.style.setProperty("--part", `${(100 * at) / Math.max(last, 1)}%`);
    frame.textContent = String(viewer.smoke.number(at));
    speed.textContent = `${viewer.speed}×`;
    play.querySelector("path")!.setAttribute("d", viewer.isPlaying ? PAUSE : PLAY);
    play.classList.toggle("playing", viewer.isPlaying);
  };
  viewer.addEventListener("change", update);
  viewer.addEventListener("frame", update);
  update();
  return element(
    "div",
    { id: "transport", role: "group", "aria-label": "Play" },
    button("From the beginning (R)", BACK, () => void viewer.restart()),
    play,
    scrub,
    frame,
    speed,
  );
}

export async function toggle(viewer: Viewer): Promise<void> {
  if (viewer.isPlaying) viewer.pause();
  else await viewer.play();
}
