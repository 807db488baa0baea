// The styles to choose from: one that paints, and one to mix with it.

import { element } from "./dom";
import { say } from "./notice";
import { oneLine } from "../problem";
import type { Viewer } from "../viewer";

const HOLD = 500; // ms of a finger that stays, where no browser tells of it

export function makeStrip(viewer: Viewer): HTMLElement {
  const strip = element("nav", { id: "styles", "aria-label": "Styles" });
  const buttons = new Map<string, HTMLButtonElement>();

  const choose = async (name: string, second: boolean): Promise<void> => {
    try {
      const isOff = second && viewer.names[1] === name;
      await viewer.use(isOff ? "" : name, second ? 1 : 0);
    } catch (error) {
      say(oneLine(error));
    }
  };
  let holding = 0;
  let wasHeld = false;
  const fill = (): void => {
    for (const rule of viewer.show.rules) {
      if (buttons.has(rule.name)) continue;
      const made = element("button", {
        type: "button",
        title: `${rule.title || rule.name}. Right click, or hold: mix it with the one that paints`,
        onclick: (event) => {
          if (!wasHeld) void choose(rule.name, (event as MouseEvent).shiftKey);
          wasHeld = false;
        },
        onpointerdown: (event) => {
          wasHeld = false;
          if ((event as PointerEvent).pointerType !== "touch") return;
          holding = window.setTimeout(() => {
            wasHeld = true;
            void choose(rule.name, true);
          }, HOLD);
        },
        onpointerup: () => clearTimeout(holding),
        onpointercancel: () => clearTimeout(holding),
        oncontextmenu: (event) => {
          event.preventDefault();
          if (!wasHeld) void choose(rule.name, true);
          clearTimeout(holding);
        },
      });
      if (rule.thumbnail) made.append(element("img", { src: rule.thumbnail, alt: "", draggable: "false" }));
      made.append(element("span", {}, rule.name.replaceAll("_", " ")));
      buttons.set(rule.name, made);
      if (rule.model === "") strip.prepend(made);
      else strip.append(made);
    }
  };
  const update = (): void => {
    fill();
    for (const [name, made] of buttons) {
      made.classList.toggle("first", viewer.names[0] === name);
      made.classList.toggle("second", viewer.names[1] === name);
      made.setAttribute("aria-pressed", String(viewer.names.includes(name)));
    }
  };
  viewer.addEventListener("rules", update);
  update();
  return strip;
}
