// How much light reaches each place in what is drawn: `rendering/light.py`.

import lightCode from "../shaders/light.wgsl";
import { viewAxes } from "./camera";
import { type Gpu, run } from "../gpu/gpu";
import { scaled, type Vector } from "../matrix";
import type { Smoke } from "../smoke/smoke";
import { alongCells, fours, volumeTexture, worldBox } from "./volume";

/** Blocks along the longest side: shadows are soft. */
const FINEST = 96;
/** Weights, and parts of the extinction that light meets when it is scattered once, or more often. */
const OCTAVES = [
  [0.8, 1],
  [0.2, 1 / 4],
];
/** How bright opaque smoke is that faces a light of 1, and in light of 1 from everywhere. */
const FACING = OCTAVES.reduce((sum, [weight, part]) => sum + weight / (1 + part), 0);
const EVEN = OCTAVES.reduce(
  (sum, [weight, part]) => sum + (weight / 2) * (1 - part * Math.log(1 + 1 / part)),
  0,
);
/** Weights and directions of a sky: the sides and the corners of a cube. */
const SKY = directions().map((way) => {
  const axes = way.filter((step) => step !== 0).length;
  return { weight: axes === 1 ? 1 / 15 : 3 / 40, way: scaled(way, 1 / Math.sqrt(axes)) };
});
const SLOT = 256;
const WAY = 24;

export interface Light {
  /** 0: the smoke glows by itself. */
  strength: number;
  azimuth: number;
  elevation: number;
  ambient: number;
}

/** What a colour is multiplied by where no smoke is in the way. */
export function full({ strength }: Light): number {
  return Math.max(1, strength);
}

export class LightVolume {
  /** What is taken from full light. */
  readonly shadow: GPUTexture;
  /** Cells of what is drawn along an edge of a block. */
  readonly times: number;
  private readonly first: Vector;
  private readonly size: Vector;
  private readonly slots: GPUBuffer;
  private readonly ways: GPUBuffer;
  private readonly thickness: GPUBuffer;
  private readonly depth: GPUBuffer;

  constructor(
    private readonly gpu: Gpu,
    private readonly smoke: Smoke,
    private readonly parts: number,
  ) {
    // In lengths of a cell of what is drawn, the box of the world is as large as the light's.
    const [low, high] = worldBox(smoke, parts);
    const spacing = Math.max(...low.map((value, axis) => high[axis] - value)) / FINEST;
    this.times = Math.max(Math.round(spacing), 1);
    this.first = smoke.lower.map((cell) => Math.floor((cell * parts) / this.times) - 1);
    const last = smoke.upper.map((cell) => Math.floor((cell * parts - 1) / this.times) + 1);
    this.size = this.first.map((block, axis) => last[axis] - block + 1);
    const count = this.size.reduce((product, side) => product * side, 1);
    this.shadow = volumeTexture(gpu, this.size);
    this.thickness = gpu.buffer(4 * count);
    this.depth = gpu.buffer(4 * count * (1 + SKY.length));
    this.ways = gpu.buffer(WAY * (1 + SKY.length));
    this.slots = gpu.uniform(SLOT * Math.max(...this.size));
  }

  static prepared(): [string, string][] {
    return ["gather", "sweep", "shade"].map((entry) => [lightCode, entry]);
  }

  /** Where the first block has its middle, in cells of what is drawn, of which the first is -1. */
  get middle(): Vector {
    const { smoke, parts, times } = this;
    return this.first.map(
      (block, axis) => (block + 0.5) * times - 0.5 - smoke.lower[axis] * parts + 1,
    );
  }

  /** Send light through what is drawn; γ is the extinction of density 1, per cell of the smoke. */
  cast(drawn: GPUTexture, light: Light, gamma: number): void {
    const { gpu, size } = this;
    const layers = Math.max(...size);
    this.write(light, gamma, layers);
    const slot = (layer: number): GPUBufferBinding => ({
      buffer: this.slots,
      offset: SLOT * layer,
      size: 80,
    });
    const [gather, sweep, shade] = ["gather", "sweep", "shade"].map((entry) =>
      gpu.compute(lightCode, entry),
    );
    const [blocks, across] = [fours(size), Math.ceil(layers / 8)];
    const { thickness, depth, ways } = this;
    gpu.submit((encoder) => {
      const gathered = { 0: slot(0), 1: drawn.createView(), 2: thickness };
      run(encoder, gather, [gpu.bound(gather, 0, gathered)], blocks);
      for (let layer = 0; layer < layers; layer++) {
        const swept = { 0: slot(layer), 2: thickness, 3: depth, 5: ways };
        run(encoder, sweep, [gpu.bound(sweep, 0, swept)], [across, across, 1 + SKY.length]);
      }
      const shaded = { 0: slot(0), 3: depth, 4: this.shadow.createView(), 5: ways };
      run(encoder, shade, [gpu.bound(shade, 0, shaded)], blocks);
    });
  }

  private write({ azimuth, elevation, strength, ambient }: Light, gamma: number, layers: number): void {
    const { gpu, smoke, parts, times, first, size } = this;
    const [, , forward] = viewAxes(azimuth, elevation);
    const from = [{ weight: 1, way: scaled(forward, -1) }, ...SKY];
    const ways = new ArrayBuffer(WAY * from.length);
    from.forEach(({ weight, way }, at) => {
      const towards = scaled(alongCells(smoke, way), 1 / times);
      const far = towards.map(Math.abs);
      const main = far.indexOf(Math.max(...far));
      const others = [0, 1, 2].filter((axis) => axis !== main);
      const half = ((0.5 / far[main]) * gamma) / parts;
      const shift = others.map((axis) => towards[axis] / far[main]);
      new Float32Array(ways, WAY * at, 3).set([...shift, half]);
      new Uint32Array(ways, WAY * at + 12, 1)[0] = main;
      new Float32Array(ways, WAY * at + 16, 1)[0] = weight;
      new Uint32Array(ways, WAY * at + 20, 1)[0] = towards[main] > 0 ? 1 : 0;
    });
    gpu.write(this.ways, new Uint8Array(ways));
    const origin = smoke.lower.map((cell) => cell * parts - 1);
    const numbers = new ArrayBuffer(SLOT * layers);
    for (let layer = 0; layer < layers; layer++) {
      new Int32Array(numbers, SLOT * layer, 11).set([...first, times, ...size, layer, ...origin]);
      new Float32Array(numbers, SLOT * layer + 44, 9).set([
        strength,
        ...[FACING, EVEN, 1 - ambient, ambient],
        ...[0, 1].flatMap((column) => OCTAVES.map((octave) => octave[column])),
      ]);
    }
    gpu.write(this.slots, new Uint8Array(numbers));
  }

  destroy(): void {
    for (const old of [this.shadow, this.thickness, this.depth, this.ways, this.slots]) old.destroy();
  }
}

/** The ways from the middle of a cube to its sides and corners: along an odd number of axes. */
function directions(): Vector[] {
  const steps = [-1, 0, 1];
  return steps
    .flatMap((x) => steps.flatMap((y) => steps.map((z) => [x, y, z])))
    .filter(([x, y, z]) => (x + y + z) % 2 !== 0);
}
