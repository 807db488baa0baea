// What this page was given to show: `viewer/__init__.py`.

import { Problem } from "../problem";

export interface ShownRule {
  name: string;
  title: string;
  model: string;
  thumbnail?: string;
}

export interface Show {
  title: string;
  rules: ShownRule[];
  smoke: string;
  settings: Record<string, number>;
  run: boolean;
}

export async function readShow(): Promise<Show> {
  let show: Show;
  try {
    show = await (await fetch("show.json", { cache: "no-cache" })).json();
  } catch {
    throw new Problem("show.json is not there or damaged: this page has nothing to show.");
  }
  const sound =
    typeof show === "object" &&
    show !== null &&
    Array.isArray(show.rules) &&
    show.rules.length > 0 &&
    show.rules.every(isRule) &&
    isLocal(show.smoke) &&
    typeof show.title === "string" &&
    typeof show.settings === "object" &&
    show.settings !== null;
  if (!sound) throw new Problem("show.json is damaged: this page has nothing to show.");
  return show;
}

function isRule(rule: ShownRule | null): boolean {
  return (
    typeof rule?.name === "string" &&
    isLocal(rule.model) &&
    (rule.thumbnail === undefined || isLocal(rule.thumbnail))
  );
}

/** Whether a file lies beside the page. */
function isLocal(path: unknown): boolean {
  return typeof path === "string" && /^[\w.-]+(\/[\w.-]+)*$/.test(path) && !path.includes("..");
}

export async function bytesOf(path: string): Promise<ArrayBuffer> {
  const answer = await fetch(path, { cache: "no-cache" });
  if (!answer.ok) throw new Problem(`${path}: the server says ${answer.status}`);
  return answer.arrayBuffer();
}
