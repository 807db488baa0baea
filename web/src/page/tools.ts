// Buttons: what a finger does, what is saved, and what is seen beside.

import { button, element } from "./dom";
import { toggleHelp } from "./help";
import { linkTo } from "./link";
import { say } from "./notice";
import { oneLine } from "../problem";
import { film, picture, save } from "./save";
import type { Tool, Viewer } from "../viewer";

const ICONS = {
  orbit: "M12 4a8 8 0 1 0 8 8M20 4v5h-5",
  erase: "M4 15l8.5-8.5 6 6L12 19H8zM9 10l6 6M8 19h12",
  more: "M12 4v16M4 12h16",
  less: "M4 12h16",
  beside: "M4 5h16v14H4zM12 5v14",
  alive: "M3 12h4l3-7 4 14 3-7h4",
  picture: "M4 7h4l1.5-2h5L16 7h4v12H4zM12 16.5a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7z",
  film: "M4 6h11v12H4zM15 10.5l5-3v9l-5-3z",
  link: "M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1",
  home: "M4 11l8-7 8 7M6 10v9h12v-9",
  help: "M9 9a3 3 0 1 1 4.2 2.7c-.8.4-1.2 1-1.2 1.8v.5M12 17.4v.1",
  settings: "M4 8h9M17 8h3M4 16h3M11 16h9M15 6v4M9 14v4",
};
const BRUSHES: [Tool, string][] = [
  ["orbit", "Turn, pan and zoom (1)"],
  ["erase", "Erase the painting; it heals (2)"],
  ["more", "Brush the second style on (3)"],
  ["less", "Brush the second style off (4)"],
];

export function makeTools(viewer: Viewer): HTMLElement {
  const brushes = BRUSHES.map(([tool, label]) => {
    const made = button(label, ICONS[tool], () => choose(viewer, tool));
    made.id = `tool-${tool}`;
    return [tool, made] as const;
  });
  const beside = button("Beside the plain smoke (B)", ICONS.beside, () => toggleBeside(viewer));
  const alive = button("Goes on while nothing plays (L)", ICONS.alive, () => toggleAlive(viewer));
  const update = (): void => {
    for (const [tool, made] of brushes) made.setAttribute("aria-pressed", String(viewer.tool === tool));
    beside.setAttribute("aria-pressed", String(viewer.stage.settings.wipe < 1));
    alive.setAttribute("aria-pressed", String(viewer.isAlive));
    viewer.canvas.dataset.tool = viewer.tool;
  };
  viewer.addEventListener("change", update);
  update();
  return element(
    "div",
    { id: "tools", role: "toolbar", "aria-label": "Tools" },
    ...brushes.map(([, made]) => made),
    element("hr"),
    beside,
    alive,
    button("Frame the smoke (F)", ICONS.home, () => viewer.reframe()),
    element("hr"),
    button("Save a picture (P)", ICONS.picture, () => void savePicture(viewer)),
    button("Save a film", ICONS.film, () => void saveFilm(viewer)),
    button("Copy a link to what is seen (C)", ICONS.link, () => void copyLink(viewer)),
    button("Settings (H)", ICONS.settings, togglePanel),
    button("What can be done (?)", ICONS.help, toggleHelp),
  );
}

export function togglePanel(): void {
  document.body.classList.toggle("bare");
}

export function choose(viewer: Viewer, tool: Tool): void {
  viewer.tool = tool;
  viewer.changed();
}

export function toggleBeside(viewer: Viewer): void {
  viewer.set("wipe", viewer.stage.settings.wipe < 1 ? 2 : 0.5);
}

export function toggleAlive(viewer: Viewer): void {
  viewer.isAlive = !viewer.isAlive;
  viewer.changed();
}

export async function savePicture(viewer: Viewer): Promise<void> {
  try {
    save(await picture(viewer), viewer, "png");
  } catch (error) {
    say(oneLine(error));
  }
}

async function saveFilm(viewer: Viewer): Promise<void> {
  const wasAlive = viewer.isAlive;
  viewer.pause();
  viewer.isAlive = false; // or the frames would get steps of their own
  try {
    const made = await film(viewer, (part) => say(`Filming: ${Math.round(100 * part)} %`));
    save(made, viewer, "webm");
  } catch (error) {
    say(oneLine(error));
  } finally {
    viewer.isAlive = wasAlive;
  }
}

export async function copyLink(viewer: Viewer): Promise<void> {
  const address = linkTo(viewer);
  history.replaceState(null, "", address);
  try {
    await navigator.clipboard.writeText(address);
    say("The link is copied.");
  } catch {
    say("The link is in the address bar.");
  }
}
