// What the page has to say: a line that passes, or a page of its own where nothing can be shown.

import { element } from "./dom";
import { oneLine } from "../problem";

const SHOWN = 6000; // ms
let leaving = 0;

/** A line at the top, which goes away by itself. */
export function say(line: string): void {
  const place = document.getElementById("notice") ?? element("div", { id: "notice", role: "status" });
  place.textContent = oneLine(line);
  place.classList.add("shown");
  document.body.append(place);
  clearTimeout(leaving);
  leaving = window.setTimeout(() => place.classList.remove("shown"), SHOWN);
}

/** What there is instead of a picture. */
export function stop(title: string, line: string): void {
  document.getElementById("stopped")?.remove();
  document.body.classList.add("stopped");
  document.body.append(
    element(
      "main",
      { id: "stopped" },
      element("h1", {}, title),
      element("p", { id: "reason" }, oneLine(line)),
    ),
  );
}

export const WHERE =
  "WebGPU is in current Chrome and Edge, in Safari 26 and in Firefox. On Linux Chrome may have to be " +
  "started with --enable-unsafe-webgpu --enable-features=Vulkan.";
