// What fingers, mice and keys do, on a sheet over the page.

import { element } from "./dom";

const ROWS: [what: string, how: string, keys: string][] = [
  ["Turn", "drag", "Shift ← → · ↑ ↓"],
  ["Pan", "Shift or right button, drag · two fingers", ""],
  ["Zoom", "wheel · pinch", "+ −"],
  ["Frame the smoke", "double click", "F"],
  ["Play · frame by frame · from the start", "", "Space · ← → · R"],
  ["Another style", "click its picture", "N"],
  ["Mix a second style in", "right click, or hold, its picture", ""],
  ["Turn · erase · second style on · off", "drag over the smoke", "1 · 2 · 3 · 4"],
  ["Beside the plain smoke", "drag the line", "B"],
  ["Go on while nothing plays", "", "L"],
  ["Save a picture · copy a link", "", "P · C"],
  ["Settings", "double click resets a slider", "H"],
  ["A model of your own", "drop its file onto the page", ""],
];

/** The sheet, closed. */
export function makeHelp(): HTMLDialogElement {
  const rows = ROWS.map(([what, how, keys]) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, what),
      element("td", {}, how),
      element("td", { class: "keys" }, keys),
    ),
  );
  const close = element("button", { type: "button", class: "close", autofocus: true }, "Close");
  const sheet = element(
    "dialog",
    { id: "help", "aria-label": "What can be done" },
    element("h2", {}, "What can be done"),
    element("table", {}, ...rows),
    close,
  );
  close.addEventListener("click", () => sheet.close());
  sheet.addEventListener("click", (event) => {
    if (event.target === sheet) sheet.close(); // beside it
  });
  return sheet;
}

export function toggleHelp(): void {
  const sheet = document.getElementById("help") as HTMLDialogElement;
  if (sheet.open) sheet.close();
  else sheet.showModal();
}
