// A rule at work: its state on the active cells of a frame, stepped, carried on and painted.

import type { FrameBuffers } from "../smoke/frame";
import { type Bindings, type Gpu, run } from "../gpu/gpu";
import { maskKey, maskThreshold, packedDecoder, packedWeights, quarters, stencil } from "./weights";
import { affineInverse, product } from "../matrix";
import type { Rule } from "./model";
import { require } from "../problem";
import { PAINTED, Programs, STATE, WANTED_PLACES } from "./programs";
import { Layout, Rows } from "../gpu/rows";
import { findSites, PLACES, RIM, type Sites } from "./sites";
import type { Smoke } from "../smoke/smoke";

const SLOT = 256; // bytes between uniforms of steps
const AT_ONCE = 64; // steps

export interface Guide {
  /** A unit vector of the world, and how much of the velocity it takes the place of. */
  direction: number[];
  amount: number;
}

/** What the rule of a layer works on in a frame, on the GPU. */
interface Work {
  readonly sites: Sites;
  readonly places: Rows;
  /** What the cells are told, in the parts in which their states are. */
  readonly told: Rows;
  /** Of each part the first row, and how many cells there are. */
  readonly batches: GPUBuffer[];
  state: Rows;
  spare: Rows;
}

export class Layer {
  stepsDone = 0;
  readonly uniform: GPUBuffer;
  private work: Work | null = null;
  private painting: Rows | null = null;
  private readonly programs: Programs;
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
    readonly isHalf: boolean,
  ) {
    const toldWidth = 4 * quarters(rule.width + 1);
    this.programs = new Programs(rule, smoke, isHalf);
    this.uniform = gpu.uniform(64);
    this.steps = gpu.uniform(SLOT * AT_ONCE);
    this.filters = gpu.uniform(27 * 32);
    gpu.write(this.filters, stencil(rule.sobel, rule.laplacian));
    this.weights = gpu.buffer(packedWeights(rule, toldWidth, isHalf));
    this.network = gpu.buffer(packedDecoder(rule));
    this.given = gpu.uniform(112);
    this.wanted = gpu.uniform(48);
    // Of painting, and of each layer of the rim of up to four parts a cell.
    this.now = Array.from({ length: 2 + 4 * RIM }, () => gpu.uniform(32));
  }

  static async create(gpu: Gpu, rule: Rule, smoke: Smoke, half: boolean): Promise<Layer> {
    for (const { name, width } of rule.fields) {
      const isThere = smoke.fields.some((each) => each.name === name && each.width === width);
      require(isThere, `${rule.name}: the rule is conditioned on ${name}, which this sequence does not have`);
    }
    const layer = new Layer(gpu, rule, smoke, half && gpu.hasHalf);
    const { programs } = layer;
    const { WHOLE } = Layout;
    await gpu.prepare([
      [programs.step(WHOLE, WHOLE), "step"],
      [programs.condition(WHOLE, WHOLE), "condition"],
      [programs.carry(WHOLE, WHOLE, WHOLE, WHOLE), "carry"],
      [programs.paint(WHOLE, WHOLE, WHOLE), "paint"],
      [programs.paint(WHOLE, WHOLE, WHOLE), "rim"],
    ]);
    return layer;
  }

  get sites(): Sites | null {
    return this.work?.sites ?? null;
  }

  get state(): Rows | null {
    return this.work?.state ?? null;
  }

  get places(): Rows | null {
    return this.work?.places ?? null;
  }

  get painted(): Rows | null {
    return this.painting;
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
    const work = this.prepared(sites);
    if (this.work !== null && sites.cells > 0) this.carry(buffers, this.work, work, guide, frames);
    this.release();
    gpu.write(this.uniform, sites.uniform);
    this.work = work;
    this.condition(buffers, guide);
  }

  /** Room for the cells of a frame, all of it zeros. */
  private prepared(sites: Sites): Work {
    const { gpu, rule } = this;
    const [wide, toldWide] = [16 * quarters(rule.channels), 16 * quarters(rule.width + 1)];
    const layout = Layout.of(gpu, sites.cells + 1, wide, toldWide);
    const places = Rows.of(gpu, sites.places, "the list of cells");
    // Beside them: weights, what the cells are told, and the states that follow.
    gpu.requireBindings(places.layout.parts + layout.parts + 3, "the cells of the smoke");
    const batches = Array.from({ length: Math.ceil(sites.cells / layout.each) }, (_, part) => {
      const batch = gpu.uniform(16);
      const first = part * layout.each;
      gpu.write(batch, new Uint32Array([first, Math.min(layout.each, sites.cells - first)]));
      return batch;
    });
    const told = Rows.empty(gpu, new Layout(sites.cells, toldWide, layout.each), "the conditioning");
    const [state, spare] = [0, 1].map(() => Rows.empty(gpu, layout, "the state"));
    return { sites, places, told, batches, state, spare };
  }

  private carry(buffers: FrameBuffers, from: Work, to: Work, guide: Guide, frames: number): void {
    const { gpu } = this;
    const [, , , , , , , , , , , bricks, x, y, z] = to.sites.uniform;
    const wanted = new ArrayBuffer(48);
    new Uint32Array(wanted).set([x * y * z, bricks]);
    const floats = new Float32Array(wanted);
    floats.set([frames, ...this.alongCells(guide.direction), guide.amount, this.rule.speed], 3);
    gpu.write(this.wanted, floats);
    const layouts = [from.places, to.places, from.state, buffers.words].map(({ layout }) => layout);
    gpu.requireBindings(layouts.reduce((sum, { parts }) => sum + parts, 1), "the cells of two frames");
    const [places, wantedPlaces, before, words] = layouts;
    const carry = gpu.compute(this.programs.carry(places, wantedPlaces, before, words), "carry");
    const shared = {
      0: this.wanted,
      ...to.places.bindings(WANTED_PLACES.first),
      ...from.state.bindings(STATE.first),
    };
    this.eachBatch(to, carry, from.places, (part) => [
      { ...shared, 3: to.state.buffers[part] },
      buffers.bindings(),
    ]);
  }

  /** Run a shader on the cells of each batch; what more it binds in groups 1 and 2. */
  private eachBatch(
    { batches, state, sites }: Work,
    ready: GPUComputePipeline,
    places: Rows,
    more: (part: number) => Bindings[],
  ): void {
    const { gpu } = this;
    const cells = Math.min(state.layout.each, sites.cells);
    gpu.submit((encoder) =>
      batches.forEach((batch, part) => {
        const own = { 0: this.uniform, 1: batch, ...places.bindings(PLACES.first) };
        const groups = [own, ...more(part)].map((each, group) => gpu.bound(ready, group, each));
        run(encoder, ready, groups, Math.ceil(cells / 64));
      }),
    );
  }

  /** What cells are told of a frame. */
  condition(buffers: FrameBuffers, guide: Guide): void {
    const { gpu, rule, work } = this;
    if (work === null || work.sites.cells === 0) return;
    const given = new ArrayBuffer(112);
    const floats = new Float32Array(given);
    const place = this.placeMatrix();
    for (let k = 0; k < 16; k++) floats[k] = place[k % 4][k >> 2];
    const { position = -1, density = -1, velocity = -1 } = rule.columns;
    new Int32Array(given).set([position, density, velocity, 4 * quarters(rule.width + 1)], 16);
    floats.set([rule.density, rule.speed], 20);
    floats.set([...this.alongCells(guide.direction), guide.amount], 24);
    gpu.write(this.given, floats);
    const { places, told } = work;
    const code = this.programs.condition(places.layout, buffers.words.layout);
    this.eachBatch(work, gpu.compute(code, "condition"), places, (part) => [
      { 0: this.given, 1: told.buffers[part] },
      buffers.bindings(),
    ]);
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
    const { gpu, rule, work } = this;
    for (let done = 0; done < count; ) {
      const some = Math.min(AT_ONCE, count - done);
      const numbers = new Uint32Array((SLOT / 4) * some);
      for (let k = 0; k < some; k++) {
        const key = maskKey(seed, this.stepsDone + done + k);
        const always = rule.probability >= 1 ? 1 : 0;
        numbers.set([key, maskThreshold(rule.probability), always, 0], (SLOT / 4) * k);
      }
      gpu.write(this.steps, numbers);
      if (work !== null && work.sites.cells > 0) this.submitSteps(work, some);
      done += some;
    }
    this.stepsDone += count;
  }

  private submitSteps(work: Work, count: number): void {
    const { gpu } = this;
    const { places, told, batches } = work;
    const step = gpu.compute(this.programs.step(places.layout, work.state.layout), "step");
    const cells = Math.min(work.state.layout.each, work.sites.cells);
    const shared = {
      0: this.uniform,
      3: this.filters,
      4: this.weights,
      ...places.bindings(PLACES.first),
    };
    gpu.submit((encoder) => {
      for (let k = 0; k < count; k++) {
        batches.forEach((batch, part) => {
          const group = gpu.bound(step, 0, {
            ...shared,
            1: batch,
            2: { buffer: this.steps, offset: SLOT * k, size: 16 },
            5: told.buffers[part],
            6: work.spare.buffers[part],
            ...work.state.bindings(STATE.first),
          });
          run(encoder, step, [group], Math.ceil(cells / 256));
        });
        [work.state, work.spare] = [work.spare, work.state];
      }
    });
  }

  /** Make the states zero that a brush touches, which tells where it is. */
  erase(buffers: FrameBuffers, brush: Bindings): void {
    const { work } = this;
    if (work === null || work.sites.cells === 0) return;
    const code = this.programs.erase(work.places.layout, buffers.words.layout);
    this.eachBatch(work, this.gpu.compute(code, "erase"), work.places, (part) => [
      { ...brush, 3: work.state.buffers[part] },
      buffers.bindings(false),
    ]);
  }

  /** How many cells have a colour: the active ones, and those beside them. */
  private get shown(): number {
    return this.work === null ? 0 : this.work.sites.cells + this.work.sites.beside;
  }

  private paintedLayout(parts: number): Layout {
    return Layout.of(this.gpu, this.shown, 16 * parts ** 3);
  }

  /** How many arrays are bound to paint so many parts of a cell along each axis, and to draw them
   * beside so many others. */
  boundFor(parts: number, others: number): number {
    if (this.work === null) return 0;
    const { places, state } = this.work;
    const most = Math.max(state.layout.parts + 1, others);
    return places.layout.parts + this.paintedLayout(parts).parts + most;
  }

  /** Look at the state: `samples` points along each axis of each of the `parts` of a cell. */
  paint(parts: number, samples: number): void {
    const { gpu, rule, work } = this;
    if (work === null) return;
    const { sites, places, state } = work;
    const layout = this.paintedLayout(parts);
    if (this.painting?.layout.count !== layout.count || this.painting.layout.width !== layout.width) {
      this.painting?.destroy();
      this.painting = Rows.empty(gpu, layout, "the painting");
    }
    if (layout.count === 0) return;
    gpu.requireBindings(this.boundFor(parts, 0), "the painting");
    const code = this.programs.paint(places.layout, state.layout, layout);
    const [paint, rim] = [gpu.compute(code, "paint"), gpu.compute(code, "rim")];
    const layers = [sites.cells, ...Array<number>(RIM * parts + 1).fill(sites.beside)];
    layers.forEach((cells, at) => {
      const now = new Int32Array([parts, samples, Math.max(at - 1, 0), cells, rule.dilation, 0, 0, 0]);
      gpu.write(this.now[at], now);
    });
    const shared = { 0: this.uniform, ...places.bindings(PLACES.first) };
    const painted = this.painting.bindings(PAINTED.first);
    const painting = [
      gpu.bound(paint, 0, shared),
      gpu.bound(paint, 1, { 0: this.network }),
      gpu.bound(paint, 2, { 0: this.now[0], ...painted, ...state.bindings(STATE.first) }),
    ];
    gpu.submit((encoder) => {
      const threads = (cells: number): number => Math.ceil((cells * parts ** 3) / 64);
      if (sites.cells > 0) run(encoder, paint, painting, threads(sites.cells));
      for (let at = 1; at < layers.length && sites.beside > 0; at++) {
        const groups = [
          gpu.bound(rim, 0, shared),
          gpu.bound(rim, 1, {}),
          gpu.bound(rim, 2, { 0: this.now[at], ...painted }),
        ];
        run(encoder, rim, groups, threads(sites.beside));
      }
    });
  }

  /** Forget everything: the next frame begins from nothing. */
  reset(): void {
    this.release();
    this.work = null;
    this.stepsDone = 0;
  }

  private release(): void {
    if (this.work !== null) {
      const { places, state, spare, told, batches } = this.work;
      for (const old of [places, state, spare, told, ...batches]) old.destroy();
    }
    this.painting?.destroy();
    this.painting = null;
  }

  destroy(): void {
    this.release();
    const own = [this.uniform, this.steps, this.filters, this.weights, this.network, this.given];
    for (const buffer of [...own, this.wanted, ...this.now]) buffer.destroy();
  }
}
