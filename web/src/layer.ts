// A rule at work: its state on the active cells of a frame, stepped, carried on and painted.

import carryCode from "./shaders/carry.wgsl";
import conditionCode from "./shaders/condition.wgsl";
import paintCode from "./shaders/paint.wgsl";
import smokeCode from "./shaders/smoke.wgsl";
import decoderCode from "../../src/vnca/engine/wgsl/decoder.wgsl";
import sitesCode from "../../src/vnca/engine/wgsl/sites.wgsl";
import stepCode from "../../src/vnca/engine/wgsl/step.wgsl";
import { type Gpu, run } from "./gpu";
import { maskKey, maskThreshold, packedDecoder, packedWeights, quarters, stencil } from "./automaton";
import { affineInverse, product } from "./matrix";
import type { Rule } from "./model";
import { findSites, RIM, type Sites } from "./sites";
import type { Frame, Smoke } from "./smoke";

const SLOT = 256; // bytes between uniforms of steps
const AT_ONCE = 64; // steps

export interface Guide {
  /** A unit vector of the world, and how much of the velocity it takes the place of. */
  direction: number[];
  amount: number;
}

interface Pipelines {
  step: GPUComputePipeline;
  condition: GPUComputePipeline;
  carry: GPUComputePipeline;
  paint: GPUComputePipeline;
  rim: GPUComputePipeline;
}

/** The smoke of a frame on the GPU, shared by layers and pictures. */
export interface FrameBuffers {
  readonly frame: Frame;
  readonly uniform: GPUBuffer;
  readonly bytes: GPUBuffer;
}

export class Layer {
  sites: Sites | null = null;
  stepsDone = 0;
  painted: GPUBuffer | null = null;
  readonly uniform: GPUBuffer;
  places: GPUBuffer | null = null;
  state: GPUBuffer | null = null;
  private spare: GPUBuffer | null = null;
  private told: GPUBuffer | null = null;
  private paintedFor = 0;
  private readonly steps: GPUBuffer;
  private readonly filters: GPUBuffer;
  private readonly weights: GPUBuffer;
  private readonly network: GPUBuffer;
  private readonly given: GPUBuffer;
  private readonly wanted: GPUBuffer;
  private readonly now: GPUBuffer[];

  private constructor(
    private readonly gpu: Gpu,
    public rule: Rule,
    private readonly smoke: Smoke,
    private readonly pipelines: Pipelines,
    readonly isHalf: boolean,
  ) {
    const toldWidth = 4 * quarters(rule.width + 1);
    this.uniform = gpu.uniform(64);
    this.steps = gpu.uniform(SLOT * AT_ONCE);
    this.filters = gpu.uniform(27 * 32);
    gpu.write(this.filters, stencil(rule.sobel, rule.laplacian));
    this.weights = gpu.buffer(packedWeights(rule, toldWidth, isHalf), "the rule");
    this.network = gpu.buffer(packedDecoder(rule), "the decoder");
    this.given = gpu.uniform(112);
    this.wanted = gpu.uniform(48);
    // Of painting, and of each layer of the rim of up to four parts a cell.
    this.now = Array.from({ length: 2 + 4 * RIM }, () => gpu.uniform(32));
  }

  static async create(gpu: Gpu, rule: Rule, smoke: Smoke, half: boolean): Promise<Layer> {
    const isHalf = half && gpu.hasHalf;
    const planes = `const PLANES = ${quarters(rule.channels)}u;\n`;
    const units = rule.decoder.length > 0 ? quarters(rule.decoder[0].weights.rows) : 0;
    const told = quarters(rule.width + 1);
    const factor = isHalf ? "enable f16;\nalias Factor = f16;\n" : "alias Factor = f32;\n";
    const sizes = `const TOLD = ${told}u;\nconst HIDDEN = ${rule.hidden.rows}u;\n`;
    const painting = `${planes}const UNITS4 = ${units}u;\n${sitesCode}${decoderCode}${paintCode}`;
    const [step, condition, carry, paint, rim] = await Promise.all([
      gpu.compute(`${factor}${planes}${sizes}${sitesCode}${stepCode}`, "step"),
      gpu.compute(`${sitesCode}${smokeCode}${conditionCode}`, "condition"),
      gpu.compute(`${planes}${sitesCode}${smokeCode}${carryCode}`, "carry"),
      gpu.compute(painting, "paint"),
      gpu.compute(painting, "rim"),
    ]);
    return new Layer(gpu, rule, smoke, { step, condition, carry, paint, rim }, isHalf);
  }

  /** The same rule with other weights goes on from its state; false where it is of another shape. */
  learn(rule: Rule): boolean {
    const shape = (of: Rule): string =>
      JSON.stringify([of.channels, of.hidden, of.columns, of.width, of.dilation, of.decoder.length].map(
        (each) => (typeof each === "object" && "values" in each ? [each.rows, each.columns] : each),
      ));
    if (shape(rule) !== shape(this.rule)) return false;
    this.gpu.write(this.weights, packedWeights(rule, 4 * quarters(rule.width + 1), this.isHalf));
    this.gpu.write(this.network, packedDecoder(rule));
    this.rule = rule;
    return true;
  }

  /** Take up a frame: its velocity carries the state to its cells, for so many frames. */
  enter(buffers: FrameBuffers, guide: Guide, frames: number): void {
    const { gpu, rule } = this;
    const sites = findSites(this.smoke, buffers.frame, rule.density, rule.dilation, rule.wholeBox);
    const places = gpu.buffer(sites.places, "the list of cells");
    const size = (sites.cells + 1) * 16 * quarters(rule.channels);
    const state = gpu.buffer(size, "the state");
    if (this.sites !== null && this.state !== null && sites.cells > 0) {
      this.writeWanted(sites, guide, frames);
      const { carry } = this.pipelines;
      const groups = [
        gpu.bound(carry, 0, { 0: this.uniform, 1: this.places! }),
        gpu.bound(carry, 1, { 0: this.wanted, 1: places, 2: this.state, 3: state }),
        gpu.bound(carry, 2, { 0: buffers.uniform, 1: buffers.bytes }),
      ];
      gpu.submit((encoder) => run(encoder, carry, groups, Math.ceil(sites.cells / 64)));
    }
    this.release();
    gpu.write(this.uniform, sites.uniform);
    this.sites = sites;
    this.places = places;
    this.state = state;
    this.spare = gpu.buffer(size, "the state");
    this.told = gpu.buffer(sites.cells * 16 * quarters(rule.width + 1), "the conditioning");
    this.condition(buffers, guide);
  }

  private writeWanted(sites: Sites, guide: Guide, frames: number): void {
    const [, , , , , , , , , , , bricks, x, y, z] = sites.uniform;
    const wanted = new ArrayBuffer(48);
    new Uint32Array(wanted).set([x * y * z, bricks, sites.cells]);
    const floats = new Float32Array(wanted);
    floats.set([frames, ...this.alongCells(guide.direction), guide.amount, this.rule.speed], 3);
    this.gpu.write(this.wanted, floats);
  }

  /** What cells are told of a frame. */
  condition(buffers: FrameBuffers, guide: Guide): void {
    const { gpu, rule, sites } = this;
    if (sites === null || sites.cells === 0) return;
    const given = new ArrayBuffer(112);
    const floats = new Float32Array(given);
    const place = this.placeMatrix();
    for (let k = 0; k < 16; k++) floats[k] = place[k % 4][k >> 2];
    const { position = -1, density = -1, velocity = -1 } = rule.columns;
    new Int32Array(given).set([position, density, velocity, 4 * quarters(rule.width + 1)], 16);
    floats.set([rule.density, rule.speed], 20);
    floats.set([...this.alongCells(guide.direction), guide.amount], 24);
    gpu.write(this.given, floats);
    const { condition } = this.pipelines;
    const groups = [
      gpu.bound(condition, 0, { 0: this.uniform, 1: this.places! }),
      gpu.bound(condition, 1, { 0: this.given, 1: this.told! }),
      gpu.bound(condition, 2, { 0: buffers.uniform, 1: buffers.bytes }),
    ];
    gpu.submit((encoder) => run(encoder, condition, groups, Math.ceil(sites.cells / 64)));
  }

  /** A direction of the world, along the axes of the cells. */
  private alongCells(direction: number[]): number[] {
    const inverse = affineInverse(this.smoke.toWorld);
    const turned = [0, 1, 2].map((row) =>
      direction.reduce((sum, value, column) => sum + inverse[row][column] * value, 0),
    );
    const length = Math.hypot(...turned) || 1;
    return turned.map((value) => value / length);
  }

  /** From index coordinates to −1 … 1 in the box of the training; else in that of the cells. */
  private placeMatrix(): number[][] {
    const { place, dilation } = this.rule;
    let toPlace = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
    let lower = this.smoke.lower.map((cell) => cell - dilation);
    let upper = this.smoke.upper.map((cell) => cell + dilation);
    if (place !== null) {
      const there = product(affineInverse(place.toWorld), this.smoke.toWorld);
      if (this.isNear(there, place.lower, place.upper)) {
        [toPlace, lower, upper] = [there, place.lower, place.upper];
      }
    }
    return toPlace.map((row, axis) => {
      if (axis === 3) return row;
      const scale = 2 / (upper[axis] - lower[axis]);
      const scaled = row.map((value) => value * scale);
      scaled[3] += (1 - 2 * lower[axis]) / (upper[axis] - lower[axis]) - 1;
      return scaled;
    });
  }

  /** Whether the smoke lies, at least in part, where the rule was trained. */
  private isNear(matrix: number[][], lower: number[], upper: number[]): boolean {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let corner = 0; corner < 8; corner++) {
      const at = [0, 1, 2].map(
        (axis) => ((corner >> axis) & 1 ? this.smoke.upper : this.smoke.lower)[axis] - 0.5,
      );
      for (let axis = 0; axis < 3; axis++) {
        const [a, b, c, d] = matrix[axis];
        const value = a * at[0] + b * at[1] + c * at[2] + d;
        low[axis] = Math.min(low[axis], value);
        high[axis] = Math.max(high[axis], value);
      }
    }
    return [0, 1, 2].every((axis) => high[axis] > lower[axis] - 0.5 && low[axis] < upper[axis] - 0.5);
  }

  /** So many steps, numbered on. */
  step(count: number, seed: number): void {
    const { gpu, rule, sites } = this;
    for (let done = 0; done < count; ) {
      const some = Math.min(AT_ONCE, count - done);
      const numbers = new Uint32Array((SLOT / 4) * some);
      for (let k = 0; k < some; k++) {
        const key = maskKey(seed, this.stepsDone + done + k);
        const always = rule.probability >= 1 ? 1 : 0;
        numbers.set([key, maskThreshold(rule.probability), always, 0], (SLOT / 4) * k);
      }
      gpu.write(this.steps, numbers);
      if (sites !== null && sites.cells > 0) this.submitSteps(some);
      done += some;
    }
    this.stepsDone += count;
  }

  private submitSteps(count: number): void {
    const { gpu, sites } = this;
    const { step } = this.pipelines;
    gpu.submit((encoder) => {
      for (let k = 0; k < count; k++) {
        const group = gpu.bound(step, 0, {
          0: this.uniform,
          1: this.places!,
          2: { buffer: this.steps, offset: SLOT * k, size: 16 },
          3: this.filters,
          4: this.weights,
          5: this.told!,
          6: this.state!,
          7: this.spare!,
        });
        run(encoder, step, [group], Math.ceil(sites!.cells / 256));
        [this.state, this.spare] = [this.spare, this.state];
      }
    });
  }

  /** How many cells have a colour: the active ones, and those beside them. */
  get shown(): number {
    return this.sites === null ? 0 : this.sites.cells + this.sites.beside;
  }

  /** Look at the state: `samples` points along each axis of each of the `parts` of a cell. */
  paint(parts: number, samples: number): void {
    const { gpu, rule, sites } = this;
    if (sites === null) return;
    const total = (sites.cells + sites.beside) * parts ** 3;
    if (this.painted === null || this.paintedFor !== total) {
      this.painted?.destroy();
      this.painted = gpu.buffer(16 * total, "the painting");
      this.paintedFor = total;
    }
    if (total === 0) return;
    const { paint, rim } = this.pipelines;
    const layers = [sites.cells, ...Array<number>(RIM * parts + 1).fill(sites.beside)];
    layers.forEach((cells, at) => {
      const now = new Int32Array([parts, samples, Math.max(at - 1, 0), cells, rule.dilation, 0, 0, 0]);
      gpu.write(this.now[at], now);
    });
    const shared = { 0: this.uniform, 1: this.places! };
    const painting = [
      gpu.bound(paint, 0, shared),
      gpu.bound(paint, 1, { 0: this.network }),
      gpu.bound(paint, 2, { 0: this.now[0], 1: this.state!, 2: this.painted }),
    ];
    gpu.submit((encoder) => {
      const threads = (cells: number): number => Math.ceil((cells * parts ** 3) / 64);
      if (sites.cells > 0) run(encoder, paint, painting, threads(sites.cells));
      for (let at = 1; at < layers.length && sites.beside > 0; at++) {
        const groups = [
          gpu.bound(rim, 0, shared),
          gpu.bound(rim, 1, {}),
          gpu.bound(rim, 2, { 0: this.now[at], 2: this.painted! }),
        ];
        run(encoder, rim, groups, threads(sites.beside));
      }
    });
  }

  /** Forget everything: the next frame begins from nothing. */
  reset(): void {
    this.release();
    this.sites = null;
    this.stepsDone = 0;
  }

  private release(): void {
    for (const buffer of [this.places, this.state, this.spare, this.told, this.painted]) {
      buffer?.destroy();
    }
    this.places = this.state = this.spare = this.told = this.painted = null;
    this.paintedFor = 0;
  }

  destroy(): void {
    this.release();
    const own = [this.uniform, this.steps, this.filters, this.weights, this.network, this.given];
    for (const buffer of [...own, this.wanted, ...this.now]) buffer.destroy();
  }
}
