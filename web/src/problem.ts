// What the user can mend, or has to know: one line.

export class Problem extends Error {}

/** A line of moderate length, whatever came from a file. */
export function oneLine(text: unknown): string {
  const line = String(text instanceof Error ? text.message : text).replace(/\s+/g, " ").trim();
  return line.length > 300 ? `${line.slice(0, 300)}…` : line;
}

export function require(holds: boolean, line: string): asserts holds {
  if (!holds) throw new Problem(line);
}
