// Weights, filters and the mask as the shaders of the engine want them: `engine/automaton.py` and
// `engine/wgsl/session.py` say the same.

import type { Matrix, Rule } from "./model";

const FILTERS = 5;

/** Vectors of four that hold so many numbers. */
export function quarters(count: number): number {
  return Math.ceil(count / 4);
}

function mix(given: number): number {
  let value = given;
  value ^= value >>> 16;
  value = Math.imul(value, 0x7feb352d);
  value ^= value >>> 15;
  value = Math.imul(value, 0x846ca68b);
  value ^= value >>> 16;
  return value >>> 0;
}

/** What the hashes of all cells are combined with in a step. */
export function maskKey(seed: number, step: number): number {
  return mix(((seed >>> 0) + mix(step >>> 0)) >>> 0);
}

/** The hash from which a cell does not change. */
export function maskThreshold(probability: number): number {
  return Math.min(Math.max(Math.round(probability * 2 ** 32), 1), 2 ** 32 - 1);
}

/** Identity, Sobel x, y, z and the Laplacian of each neighbour, eight numbers each. */
export function stencil(sobel: number, laplacian: number): Float32Array<ArrayBuffer> {
  const result = new Float32Array(27 * 8);
  const smooth = [1, 2, 1];
  for (let k = 0; k < 27; k++) {
    const [x, y, z] = [Math.floor(k / 9), Math.floor(k / 3) % 3, k % 3];
    const far = Math.abs(x - 1) + Math.abs(y - 1) + Math.abs(z - 1);
    result.set(
      [
        far === 0 ? 1 : 0,
        ((x - 1) * smooth[y] * smooth[z]) / sobel,
        ((y - 1) * smooth[x] * smooth[z]) / sobel,
        ((z - 1) * smooth[x] * smooth[y]) / sobel,
        [-88, 6, 3, 2][far] / laplacian,
      ],
      8 * k,
    );
  }
  return result;
}

/** W1 with its bias as what the 1 among the inputs is multiplied by, and W2, by unit. */
export function packedWeights(
  rule: Rule,
  told: number,
  isHalf: boolean,
): Float32Array<ArrayBuffer> | Uint16Array<ArrayBuffer> {
  const { channels, hidden, bias, output } = rule;
  const wide = 4 * quarters(channels);
  const ofUnit = FILTERS * wide + told + wide;
  const result = new Float32Array(hidden.rows * ofUnit);
  for (let unit = 0; unit < hidden.rows; unit++) {
    const row = hidden.values.subarray(unit * hidden.columns, (unit + 1) * hidden.columns);
    const first = unit * ofUnit;
    for (let filter = 0; filter < FILTERS; filter++) {
      const some = row.subarray(filter * channels, (filter + 1) * channels);
      result.set(some, first + filter * wide);
    }
    result.set(row.subarray(FILTERS * channels), first + FILTERS * wide);
    result[first + FILTERS * wide + told - 1] = bias.values[unit];
    for (let channel = 0; channel < channels; channel++) {
      const at = first + FILTERS * wide + told + channel;
      result[at] = output.values[channel * output.columns + unit];
    }
  }
  return isHalf ? halves(result) : result;
}

/** The weights of a decoder behind each other, each with zeros up to whole vectors. */
export function packedDecoder(rule: Rule): Float32Array<ArrayBuffer> {
  if (rule.decoder.length === 0) return new Float32Array(4);
  const units = 4 * quarters(rule.decoder[0].weights.rows);
  const parts = rule.decoder.flatMap(({ weights, bias }, layer) => {
    const rows = layer < 3 ? units : 4;
    return [padded(weights, rows, 4 * quarters(weights.columns)), padded(bias, rows, 1)];
  });
  const result = new Float32Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    result.set(part, at);
    at += part.length;
  }
  return result;
}

function padded(given: Matrix, rows: number, columns: number): Float32Array {
  const result = new Float32Array(rows * columns);
  for (let row = 0; row < given.rows; row++) {
    const values = given.values.subarray(row * given.columns, (row + 1) * given.columns);
    result.set(values, row * columns);
  }
  return result;
}

/** The bits of 16-bit floats; rounded to nearest, ties to even. */
export function halves(values: Float32Array): Uint16Array<ArrayBuffer> {
  const bits = new Uint32Array(values.slice().buffer);
  return Uint16Array.from(bits, (value) => {
    const sign = (value >>> 16) & 0x8000;
    const size = value & 0x7fffffff;
    if (size >= 0x47800000) return sign | 0x7c00;
    if (size < 0x33000000) return sign;
    if (size < 0x38800000) {
      const shift = 126 - (size >>> 23);
      const whole = (size & 0x7fffff) | 0x800000;
      const kept = whole >>> shift;
      const rest = whole & ((1 << shift) - 1);
      const tie = 1 << (shift - 1);
      return sign | (kept + (rest > tie || (rest === tie && (kept & 1)) ? 1 : 0));
    }
    const kept = (size - 0x38000000) >>> 13;
    const rest = size & 0x1fff;
    return sign | (kept + (rest > 0x1000 || (rest === 0x1000 && kept & 1) ? 1 : 0));
  });
}

/** The number that the bits of a 16-bit float stand for. */
export function fromHalf(bits: number): number {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const part = bits & 1023;
  if (exponent === 0) return sign * part * 2 ** -24;
  if (exponent === 31) return part ? NaN : sign * Infinity;
  return sign * (1 + part / 1024) * 2 ** (exponent - 15);
}
