// A sequence of smoke, read a frame at a time: `viewer/smoke_file.py` says how it is written.

import { isAffine, isBox } from "../matrix";
import { Problem, require } from "../problem";

const MAGIC = "vncasmk1";
const START = 1 << 16; // bytes asked for first: the header of most sequences
const MOST_HEADER = 2 ** 24;
const MOST_FRAMES = 100_000;
const MOST_BRICKS = 2 ** 20;
const MOST_PACKED = 1100; // bytes in a byte of a zlib stream: less than that
const MOST_FIELDS = 16;
const CACHED = 64 * 2 ** 20; // bytes of frames kept

export type Vec3 = [number, number, number];

export interface Frame {
  readonly number: number;
  readonly count: number;
  /** Coordinates of the bricks, in bricks. */
  readonly bricks: Int32Array;
  /** 512 bytes a brick: density, and three components of velocity where there are any; then 1024 for
   * each component of the fields. */
  readonly planes: Uint8Array<ArrayBuffer>;
}

/** What else there is at the cells: numbers in parts of the greatest, each of so many components. */
export interface NamedField {
  readonly name: string;
  readonly width: number;
  readonly scale: number;
}

interface Stored {
  number: number;
  offset: number;
  length: number;
  bricks: number;
}

export class Smoke {
  private readonly frames = new Map<number, Promise<Frame>>();
  private whole: Uint8Array<ArrayBuffer> | null = null;

  private constructor(
    private readonly url: string,
    readonly name: string,
    readonly fps: number,
    readonly lower: Vec3,
    readonly upper: Vec3,
    readonly toWorld: number[][],
    readonly density: number,
    readonly speed: number,
    readonly fields: NamedField[],
    private readonly stored: Stored[],
    private readonly begin: number,
  ) {}

  get length(): number {
    return this.stored.length;
  }

  /** Of the numbers of its cells. */
  private get bytesOfBrick(): number {
    const components = this.fields.reduce((sum, { width }) => sum + width, 0);
    return 512 * (this.speed > 0 ? 4 : 1) + 1024 * components;
  }

  number(at: number): number {
    return this.stored[at].number;
  }

  static async open(url: string): Promise<Smoke> {
    const name = url.split("/").pop() ?? url;
    let { bytes, isWhole } = await part(url, 0, START);
    require(bytes.length >= 12, `${name}: not a sequence of vnca`);
    const magic = String.fromCharCode(...bytes.subarray(0, 8));
    require(magic === MAGIC, `${name}: not a sequence of vnca`);
    const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(8, true);
    require(length <= MOST_HEADER, `${name}: its header is damaged`);
    if (bytes.length < 12 + length && !isWhole) {
      ({ bytes, isWhole } = await part(url, 0, 12 + length));
    }
    require(bytes.length >= 12 + length, `${name}: it ends within its header`);
    let smoke: Smoke;
    try {
      const text = new TextDecoder().decode(bytes.subarray(12, 12 + length));
      smoke = Smoke.described(url, name, JSON.parse(text), 12 + length);
    } catch (error) {
      if (error instanceof Problem) throw error;
      throw new Problem(`${name}: its header is damaged`);
    }
    if (isWhole) smoke.whole = bytes;
    return smoke;
  }

  private static described(url: string, name: string, header: any, begin: number): Smoke {
    const check = (holds: boolean, what: string): void =>
      require(holds, `${name}: its header is damaged (${what})`);
    check(isBox(header.box), "box");
    const [lower, upper]: Vec3[] = header.box;
    const { density, speed, fps } = header;
    check(density > 0 && density < 1e30 && speed >= 0 && speed < 1e30, "scales");
    check(fps > 0 && fps <= 1000, "fps");
    const matrix: unknown = header.lattice_to_world;
    check(isAffine(matrix), "lattice_to_world");
    const fields: NamedField[] = header.fields ?? [];
    check(Array.isArray(fields) && fields.length <= MOST_FIELDS, "fields");
    for (const { name: called, width, scale } of fields) {
      const sized = Number.isInteger(width) && width >= 1 && width <= 16;
      check(typeof called === "string" && sized && scale >= 0 && scale < 1e30, "fields");
    }
    const stored: Stored[] = header.frames;
    check(Array.isArray(stored) && stored.length >= 1 && stored.length <= MOST_FRAMES, "frames");
    const places = lower.reduce(
      (all, low, axis) => all * (Math.floor((upper[axis] - 1) / 8) - Math.floor(low / 8) + 1), 1,
    );
    for (const { number, offset, length, bricks } of stored) {
      const natural = [offset, length, bricks].every((n) => Number.isSafeInteger(n) && n >= 0);
      const fits = bricks <= Math.min(places, MOST_BRICKS);
      check(natural && Number.isSafeInteger(number) && fits, "frames");
    }
    const title = String(header.name ?? name).slice(0, 100);
    const box = [lower, upper] as const;
    return new Smoke(url, title, fps, ...box, matrix as number[][], density, speed, fields, stored, begin);
  }

  /** A frame, read when it is first asked for. */
  frame(at: number): Promise<Frame> {
    let frame = this.frames.get(at);
    if (frame === undefined) {
      frame = this.read(this.stored[at]);
      this.frames.set(at, frame);
      frame.catch(() => this.frames.delete(at));
      this.forget();
    }
    return frame;
  }

  private forget(): void {
    let kept = 0;
    for (const at of [...this.frames.keys()].reverse()) {
      kept += this.stored[at].bricks * this.bytesOfBrick;
      if (kept > CACHED) this.frames.delete(at);
    }
  }

  private async read(stored: Stored): Promise<Frame> {
    const { number, offset, length, bricks: count } = stored;
    const what = `${this.name}, frame ${number}`;
    let stream: Uint8Array<ArrayBuffer>;
    if (this.whole === null) {
      const { bytes, isWhole } = await part(this.url, this.begin + offset, length);
      if (isWhole) this.whole = bytes;
      stream = isWhole ? bytes.subarray(this.begin + offset, this.begin + offset + length) : bytes;
    } else {
      stream = this.whole.subarray(this.begin + offset, this.begin + offset + length);
    }
    require(stream.length === length, `${what}: the file ends before it`);
    const size = count * (6 + this.bytesOfBrick);
    require(size <= MOST_PACKED * Math.max(length, 1), `${what}: less than it says`);
    const data = await inflated(stream, size, what);
    const first = this.lower.map((cell) => Math.floor(cell / 8));
    const last = this.upper.map((cell) => Math.floor((cell - 1) / 8));
    const given = new DataView(data.buffer);
    const bricks = new Int32Array(3 * count);
    for (let k = 0; k < bricks.length; k++) {
      bricks[k] = given.getUint16(2 * k, true) + first[k % 3];
      require(bricks[k] <= last[k % 3], `${what}: a brick lies outside the box`);
    }
    return { number, count, bricks, planes: data.slice(6 * count) };
  }
}

/** A part of a file; the whole of it where the server knows no ranges. */
async function part(
  url: string,
  begin: number,
  length: number,
): Promise<{ bytes: Uint8Array<ArrayBuffer>; isWhole: boolean }> {
  const range = `bytes=${begin}-${begin + Math.max(length, 1) - 1}`;
  const answer = await fetch(url, { headers: { Range: range } });
  if (answer.status !== 206 && answer.status !== 200) {
    throw new Problem(`${url.split("/").pop()}: the server says ${answer.status}`);
  }
  const bytes = new Uint8Array(await answer.arrayBuffer());
  return { bytes, isWhole: answer.status === 200 };
}

/** What a zlib stream holds, which has to be as much as is expected. */
async function inflated(
  stream: Uint8Array<ArrayBuffer>,
  size: number,
  what: string,
): Promise<Uint8Array<ArrayBuffer>> {
  const result = new Uint8Array(size);
  const opened = new Blob([stream]).stream().pipeThrough(new DecompressionStream("deflate"));
  const reader = opened.getReader();
  let at = 0;
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      require(at + value.length <= size, `${what}: more than it says`);
      result.set(value, at);
      at += value.length;
    }
  } catch (error) {
    void reader.cancel().catch(() => undefined);
    throw error instanceof Problem ? error : new Problem(`${what}: damaged`);
  }
  require(at === size, `${what}: less than it says`);
  return result;
}
