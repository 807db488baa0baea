// Arrays larger than a shader binds at once: whole rows in several buffers, read as one array.
// `engine/wgsl/parts.py` says the same.

import { require } from "../problem";
import { type Gpu, mebibytes } from "./gpu";

/** Of an array in a shader. */
interface Declaration {
  group: number;
  /** The number of the first binding. */
  first: number;
  element: string;
  /** Elements of a row, in WGSL; none where a row is one element. */
  width?: string;
  /** Whether there is a function that writes, too. */
  isWritten?: boolean;
}

/** How rows of so many bytes lie in buffers, of so many rows each. */
export class Layout {
  constructor(
    readonly count: number,
    readonly width: number,
    readonly each: number,
  ) {}

  /** As few parts as can be bound, also of rows of so many bytes beside these. */
  static of(gpu: Gpu, count: number, width: number, beside = 0): Layout {
    return new Layout(count, width, Math.max(Math.floor(gpu.bindable / Math.max(width, beside)), 1));
  }

  /** All of it in one part. */
  static readonly WHOLE = new Layout(1, 4, 1);

  get parts(): number {
    return Math.max(Math.ceil(this.count / this.each), 1);
  }

  /** The bindings in WGSL, and functions `NAME_at` and `set_NAME`, by row and place in it. */
  declared(name: string, { group, first, element, width, isWritten = false }: Declaration): string {
    const { parts, each } = this;
    const row = parts === 1 ? "row" : `row % ${each}u`;
    const at = width === undefined ? row : `(${row}) * ${width} + place`;
    const given = width === undefined ? "row: u32" : "row: u32, place: u32";
    const access = isWritten ? "read_write" : "read";
    const bindings = Array.from({ length: parts }, (_, part) => {
      const place = `@group(${group}) @binding(${first + part})`;
      return `${place} var<storage, ${access}> ${name}_${part}: array<${element}>;\n`;
    });
    // The last part first: rows of the one before begin earlier.
    const inPart = (act: (array: string) => string): string =>
      Array.from({ length: parts }, (_, k) => parts - 1 - k)
        .map((part) => `${part > 0 ? `if (row >= ${part * each}u) ` : ""}{ ${act(`${name}_${part}[at]`)} }\n`)
        .join("  ");
    const begin = `{\n  let at = ${at};\n  `;
    const reading = `fn ${name}_at(${given}) -> ${element} ${begin}${inPart((array) => `return ${array};`)}}\n`;
    const write = `fn set_${name}(${given}, value: ${element}) ${begin}`;
    const writing = `${write}${inPart((array) => `${array} = value; return;`)}}\n`;
    return `${bindings.join("")}${reading}${isWritten ? writing : ""}`;
  }
}

export class Rows {
  private constructor(
    private readonly gpu: Gpu,
    readonly layout: Layout,
    readonly buffers: GPUBuffer[],
  ) {}

  /** Rows of zeros. */
  static empty(gpu: Gpu, layout: Layout, what: string): Rows {
    const { count, each, width, parts } = layout;
    gpu.requireBindings(parts, what);
    const row = mebibytes(width);
    require(width <= gpu.bindable, `${what}: a row of ${row} is more than this GPU binds at once.`);
    const buffers = Array.from({ length: parts }, (_, part) =>
      gpu.buffer(Math.min(each, count - part * each) * width),
    );
    return new Rows(gpu, layout, buffers);
  }

  /** Numbers of four bytes, each a row. */
  static of(gpu: Gpu, content: Uint32Array<ArrayBuffer>, what: string): Rows {
    const rows = Rows.empty(gpu, Layout.of(gpu, content.length, 4), what);
    const { each } = rows.layout;
    rows.buffers.forEach((buffer, part) =>
      gpu.write(buffer, content.subarray(part * each, (part + 1) * each)),
    );
    return rows;
  }

  /** The buffers by the numbers of their bindings. */
  bindings(first: number): Record<number, GPUBuffer> {
    return Object.fromEntries(this.buffers.map((buffer, part) => [first + part, buffer]));
  }

  /** Zeros everywhere. */
  clear(): void {
    this.gpu.submit((encoder) => this.buffers.forEach((buffer) => encoder.clearBuffer(buffer)));
  }

  /** What it holds. */
  async read(): Promise<ArrayBuffer> {
    const { count, each, width } = this.layout;
    const result = new Uint8Array(count * width);
    for (const [part, buffer] of this.buffers.entries()) {
      const size = Math.min(each, count - part * each) * width;
      result.set(new Uint8Array(await this.gpu.read(buffer, size)), part * each * width);
    }
    return result.buffer;
  }

  destroy(): void {
    for (const buffer of this.buffers) buffer.destroy();
  }
}
