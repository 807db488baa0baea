// A rule as a model file has it: safetensors with metadata in JSON, checked before it is believed.

import { isAffine, isBox } from "../matrix";
import { Problem, require } from "../problem";

/** The newest format that is read, as `rule/model.py` writes it. */
const FORMAT = 4;
const MOST_BYTES = 64 * 2 ** 20;
const MOST = { channels: 64, hidden: 1024, units: 256, dilation: 64, steps: 4096, width: 16 };
const WIDTHS: Record<string, number> = { position: 3, density: 1, velocity: 3 };
const LAYERS = ["first", "second", "third", "output"];

export interface Matrix {
  readonly values: Float32Array<ArrayBuffer>;
  readonly rows: number;
  readonly columns: number;
}

export interface Rule {
  readonly name: string;
  readonly title: string;
  readonly channels: number;
  readonly hidden: Matrix;
  readonly bias: Matrix;
  readonly output: Matrix;
  /** W and b of each layer of the decoder; none without one. */
  readonly decoder: { weights: Matrix; bias: Matrix }[];
  readonly probability: number;
  readonly steps: number;
  /** Whether the velocity carries the state along between frames. */
  readonly transport: boolean;
  readonly dilation: number;
  readonly wholeBox: boolean;
  readonly sobel: number;
  readonly laplacian: number;
  /** The first column of each input that is not switched off, and how many columns there are. */
  readonly columns: Record<string, number>;
  readonly width: number;
  /** Fields of the smoke that it is conditioned on, and the value that counts as 1. */
  readonly fields: { name: string; width: number; scale: number; column: number }[];
  readonly density: number;
  readonly speed: number;
  readonly gamma: number;
  readonly place: { toWorld: number[][]; lower: number[]; upper: number[] } | null;
}

/** The rule of a model file; anything else is refused in one line. */
export function readModel(bytes: ArrayBuffer, name: string): Rule {
  try {
    return parsed(bytes, name);
  } catch (error) {
    if (error instanceof Problem) throw error;
    throw new Problem(`${name}: damaged model`);
  }
}

function parsed(bytes: ArrayBuffer, name: string): Rule {
  const check = (holds: boolean, line: string): void => require(holds, `${name}: ${line}`);
  check(bytes.byteLength >= 8, "not a model of vnca");
  check(bytes.byteLength <= MOST_BYTES, "larger than any model of vnca");
  const length = Number(new DataView(bytes).getBigUint64(0, true));
  check(length <= bytes.byteLength - 8, "not a model of vnca");
  const header = json(new TextDecoder().decode(new Uint8Array(bytes, 8, length)), name);
  const written = header?.__metadata__?.vnca;
  check(typeof written === "string", "not a model of vnca");
  const about = json(written, name);
  check(Number.isInteger(about.format_version) && about.format_version >= 1, "damaged model");
  check(about.format_version <= FORMAT, `its format, ${about.format_version}, is newer than this page`);
  const shape = about.rule;
  const tensor = (key: string): Matrix => matrix(bytes, 8 + length, header[key], `${name}: ${key}`);

  const number = (value: unknown, low: number, high: number, what: string): number => {
    const fits = typeof value === "number" && value >= low && value <= high;
    check(fits, `damaged model (${what} is not a number from ${low} to ${high})`);
    return value as number;
  };
  const whole = (value: unknown, low: number, high: number, what: string): number => {
    check(Number.isInteger(value), `damaged model (${what} is not a whole number)`);
    return number(value, low, high, what);
  };
  const channels = whole(shape.channels, 4, MOST.channels, "channels");
  const units = whole(shape.hidden, 1, MOST.hidden, "hidden");
  const listed: unknown[][] =
    about.conditioning ?? Object.entries(WIDTHS).map(([key, width]) => [key, width]);
  check(Array.isArray(listed), "damaged model");
  const { columns, fields, width } = conditioning(listed, shape, name);
  const transport: unknown = shape.transport ?? false;
  check(typeof transport === "boolean", "damaged model (transport is not true or false)");
  const hidden = sized(tensor("hidden"), units, 5 * channels + width, `${name}: hidden`);
  const bias = sized(tensor("bias"), units, 1, `${name}: bias`);
  const output = sized(tensor("output"), channels, units, `${name}: output`);
  const { density, velocity, gamma } = about.scales;
  for (const scale of [density, velocity, gamma]) number(scale, 1e-30, 1e30, "scale");
  return {
    name,
    title: String(about.training?.title ?? about.training?.style ?? ""),
    channels,
    hidden,
    bias,
    output,
    decoder: decoder(header, tensor, channels, name),
    probability: number(shape.update_probability, 1e-9, 1, "update_probability"),
    steps: whole(shape.steps_per_frame, 1, MOST.steps, "steps_per_frame"),
    transport: transport as boolean,
    dilation: whole(shape.dilation ?? shape.reach ?? 1, 0, MOST.dilation, "dilation"),
    wholeBox: shape.domain === "box",
    sobel: number(shape.sobel_divisor, 1e-9, 1e9, "sobel_divisor"),
    laplacian: number(shape.laplacian_divisor, 1e-9, 1e9, "laplacian_divisor"),
    columns,
    width,
    fields,
    density,
    speed: velocity,
    gamma,
    place: place(about.place, name),
  };
}

/** What cells are told, and in which columns: position, density, velocity, and fields, with a scale. */
function conditioning(
  listed: unknown[][],
  shape: Record<string, unknown>,
  name: string,
): Pick<Rule, "columns" | "fields" | "width"> {
  const columns: Record<string, number> = {};
  const fields: Rule["fields"] = [];
  let width = 0;
  for (const [key, wide, scale] of listed) {
    const isName = typeof key === "string" && /^\w{1,100}$/.test(key);
    const what = isName ? key : "something";
    if (isName && scale === undefined && WIDTHS[key] === wide) {
      if (shape[`${key}_prior`] !== false) columns[key] = width;
    } else {
      const isField = isName && !(key in WIDTHS) && Number.isFinite(scale) && scale !== 0;
      require(isField, `${name}: the rule is conditioned on ${what}, which this page does not have`);
      const fits = Number.isInteger(wide) && (wide as number) >= 1 && (wide as number) <= MOST.width;
      require(fits, `${name}: damaged model (width of ${what})`);
      fields.push({ name: key, width: wide as number, scale: scale as number, column: width });
    }
    width += wide as number;
  }
  return { columns, fields, width };
}

function json(text: string, name: string): any {
  try {
    return JSON.parse(text);
  } catch {
    throw new Problem(`${name}: not a model of vnca`);
  }
}

function matrix(bytes: ArrayBuffer, start: number, entry: any, what: string): Matrix {
  require(entry !== undefined, `${what} is missing`);
  require(entry.dtype === "F32", `${what}: expected F32, got ${String(entry.dtype)}`);
  const [rows, columns = 1]: number[] = entry.shape;
  const [begin, end]: number[] = entry.data_offsets;
  const fits = end - begin === 4 * rows * columns && begin >= 0 && start + end <= bytes.byteLength;
  require(fits && entry.shape.length <= 2, `${what}: its place in the file cannot be`);
  const values = new Float32Array(bytes.slice(start + begin, start + end));
  require(values.every(Number.isFinite), `${what}: not all finite`);
  return { values, rows, columns };
}

function sized(given: Matrix, rows: number, columns: number, what: string): Matrix {
  const fits = given.rows === rows && given.columns === columns;
  require(fits, `${what}: expected ${rows} × ${columns}, got ${given.rows} × ${given.columns}`);
  return given;
}

function decoder(
  header: any,
  tensor: (key: string) => Matrix,
  channels: number,
  name: string,
): Rule["decoder"] {
  if (header["decoder.first"] === undefined) return [];
  const first = tensor("decoder.first");
  const units = first.rows;
  require(units >= 1 && units <= MOST.units, `${name}: a decoder of ${units} units`);
  return LAYERS.map((layer, k) => {
    const rows = layer === "output" ? 4 : units;
    const what = `${name}: decoder.${layer}`;
    return {
      weights: sized(tensor(`decoder.${layer}`), rows, k === 0 ? channels : units, what),
      bias: sized(tensor(`decoder.${layer}_bias`), rows, 1, `${what}_bias`),
    };
  });
}

function place(given: any, name: string): Rule["place"] {
  if (given === undefined || given === null) return null;
  const { lattice_to_world: toWorld, box } = given;
  require(isAffine(toWorld) && isBox(box), `${name}: its place cannot be`);
  return { toWorld, lower: box[0], upper: box[1] };
}
