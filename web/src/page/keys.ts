// The keyboard.

import { turn, zoom } from "./gestures";
import { toggleHelp } from "./help";
import { choose, copyLink, savePicture, toggleAlive, toggleBeside, togglePanel } from "./tools";
import { toggle } from "./transport";
import type { Viewer } from "../viewer";

export function listenToKeys(viewer: Viewer): void {
  const byKey: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => void toggle(viewer),
    r: () => void viewer.restart(),
    f: () => viewer.reframe(),
    b: () => toggleBeside(viewer),
    l: () => toggleAlive(viewer),
    p: () => void savePicture(viewer),
    c: () => void copyLink(viewer),
    h: togglePanel,
    n: () => void nextStyle(viewer),
    "?": toggleHelp,
    "1": () => choose(viewer, "orbit"),
    "2": () => choose(viewer, "erase"),
    "3": () => choose(viewer, "more"),
    "4": () => choose(viewer, "less"),
    "+": () => viewer.look((camera) => zoom(camera, 0.9, 0, Infinity)),
    "-": () => viewer.look((camera) => zoom(camera, 1.1, 0, Infinity)),
    ArrowLeft: (event) => arrow(viewer, event, -1, 0),
    ArrowRight: (event) => arrow(viewer, event, 1, 0),
    ArrowUp: (event) => arrow(viewer, event, 0, 1),
    ArrowDown: (event) => arrow(viewer, event, 0, -1),
  };
  document.addEventListener("keydown", (event) => {
    const isTyping = event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
    const isHelped = (document.getElementById("help") as HTMLDialogElement | null)?.open ?? false;
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping) return;
    if (isHelped && event.key !== "?") return; // the sheet closes by Escape
    const act = byKey[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (act === undefined) return;
    event.preventDefault();
    act(event);
  });
}

function arrow(viewer: Viewer, event: KeyboardEvent, x: number, y: number): void {
  if (event.shiftKey || y !== 0) {
    viewer.look((camera) => turn(camera, 4 * x, 4 * y));
  } else {
    viewer.pause();
    void viewer.goTo(viewer.stage.at + x);
  }
}

async function nextStyle(viewer: Viewer): Promise<void> {
  const { rules } = viewer.show;
  const at = rules.findIndex((rule) => rule.name === viewer.names[0]);
  await viewer.use(rules[(at + 1) % rules.length].name, 0);
}
