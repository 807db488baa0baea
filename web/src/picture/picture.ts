// From what layers have painted to a picture: the volume that is drawn, the light in it, the rays.

import lightCode from "../shaders/light.wgsl";
import marchCode from "../shaders/march.wgsl";
import volumeCode from "../shaders/volume.wgsl";
import { type Camera, pinhole, slope, viewAxes } from "./camera";
import { type Gpu, mebibytes, run } from "../gpu/gpu";
import { type FrameBuffers, smokeShader } from "../smoke/frame";
import type { Layer } from "../automaton/layer";
import { affineInverse, applied, rotated, scaled, type Matrix4, type Vector } from "../matrix";
import { Problem } from "../problem";
import { Layout, type Rows } from "../gpu/rows";
import { PLACES, sitesShader } from "../automaton/sites";
import type { Smoke } from "../smoke/smoke";

/** Blocks of the light along the longest side: shadows are soft. */
const FINEST = 96;
const OCTAVES = [
  [0.5, 1],
  [0.3, 1 / 4],
  [0.2, 1 / 16],
];
const FACING = OCTAVES.reduce((sum, [weight, part]) => sum + weight / (1 + part), 0);
const MOST_TEXELS = 2 ** 27;
/** Linear, premultiplied, with opacity. */
export const PICTURE: GPUTextureFormat = "rgba16float";

export interface Light {
  /** 0: the smoke glows by itself. */
  strength: number;
  azimuth: number;
  elevation: number;
  ambient: number;
}

export interface Look {
  strength: number;
  densityStrength: number;
  /** Extinction of density 1, per cell of the smoke. */
  gamma: number;
  light: Light;
  isPlain: boolean;
  /** How much of the second rule is seen. */
  mixed: number;
}

/** Bindings of what is drawn: what a rule has painted, and where more of it is seen. */
const PAINTED = {
  group: 1,
  first: 16,
  element: "vec4f",
  width: "u32(look.parts * look.parts * look.parts)",
};
export const BRUSHED = {
  group: 1,
  first: 512,
  element: "f32",
  width: "u32((smoke.upper.y - smoke.lower.y) * (smoke.upper.z - smoke.lower.z))",
};

function volumeShader(places: Layout, painted: Layout, brushed: Layout, words: Layout): string {
  const arrays = `${painted.declared("painted", PAINTED)}${brushed.declared("brushed", BRUSHED)}`;
  return `${sitesShader(places)}${smokeShader(words)}${arrays}${volumeCode}`;
}

function marchShader(words: Layout): string {
  return `${smokeShader(words)}${marchCode}`;
}

export class Picture {
  private parts = 0;
  private size: Vector = [];
  private textures: GPUTexture[] = [];
  private buffers: FrameBuffers | null = null;
  private drawn: GPUTexture | null = null;
  private reached: GPUTexture | null = null;
  private blocks: { first: Vector; size: Vector; times: number; slots: GPUBuffer } | null = null;
  private thickness: GPUBuffer | null = null;
  private depth: GPUBuffer | null = null;
  private readonly looks: GPUBuffer[];
  private readonly camera: GPUBuffer;
  private readonly sampler: GPUSampler;
  private readonly nothing: GPUTexture;

  private constructor(
    private readonly gpu: Gpu,
    private readonly smoke: Smoke,
  ) {
    this.looks = [0, 1].map(() => gpu.uniform(32));
    this.camera = gpu.uniform(128);
    this.sampler = gpu.device.createSampler({ magFilter: "linear", minFilter: "linear" });
    this.nothing = this.texture([1, 1, 1]);
  }

  static async create(gpu: Gpu, smoke: Smoke): Promise<Picture> {
    const { WHOLE } = Layout;
    await Promise.all([
      gpu.prepare([
        [volumeShader(WHOLE, WHOLE, WHOLE, WHOLE), "volume"],
        [lightCode, "gather"],
        [lightCode, "sweep"],
      ]),
      gpu.prepareRender(marchShader(WHOLE), "march", PICTURE),
    ]);
    return new Picture(gpu, smoke);
  }

  /** Draw on a grid so many times as fine as that of the smoke. */
  refine(parts: number): void {
    if (parts === this.parts) return;
    this.release();
    this.size = drawnSize(this.gpu, this.smoke, parts);
    this.parts = parts;
    this.textures = [0, 1].map(() => this.texture(this.size));
    this.makeBlocks();
  }

  private makeBlocks(): void {
    const { gpu, smoke, parts } = this;
    // In lengths of a cell of what is drawn, the box of the world is as large as the light's.
    const [low, high] = worldBox(smoke, parts);
    const spacing = Math.max(...low.map((value, axis) => high[axis] - value)) / FINEST;
    const times = Math.max(Math.round(spacing), 1);
    const first = smoke.lower.map((cell) => Math.floor((cell * parts) / times) - 1);
    const last = smoke.upper.map((cell) => Math.floor((cell * parts - 1) / times) + 1);
    const size = first.map((block, axis) => last[axis] - block + 1);
    const count = size.reduce((product, side) => product * side, 1);
    this.reached = this.texture(size);
    this.thickness = gpu.buffer(4 * count);
    this.depth = gpu.buffer(4 * count);
    this.blocks = { first, size, times, slots: gpu.uniform(256 * Math.max(...size)) };
  }

  private texture(size: Vector): GPUTexture {
    return this.gpu.device.createTexture({
      size,
      dimension: "3d",
      format: "rgba16float",
      usage:
        GPUTextureUsage.TEXTURE_BINDING |
        GPUTextureUsage.STORAGE_BINDING |
        GPUTextureUsage.COPY_SRC,
    });
  }

  /** What is there, of one rule or of a second mixed over it, and how light reaches it. */
  draw(buffers: FrameBuffers, layers: Layer[], brushed: Rows, look: Look): void {
    this.buffers = buffers;
    let under = this.nothing;
    layers.forEach((layer, at) => {
      const numbers = new ArrayBuffer(32);
      const isPlain = look.isPlain ? 1 : 0;
      new Int32Array(numbers).set([this.parts, isPlain, at > 0 ? 1 : 0]);
      const { mixed, strength, densityStrength } = look;
      const thick = look.isPlain ? 0 : densityStrength;
      new Float32Array(numbers).set([mixed, strength, thick, layer.rule.density], 3);
      this.gpu.write(this.looks[at], new Uint8Array(numbers));
      under = this.drawLayer(buffers, layer, at, brushed, under);
    });
    this.drawn = under;
    if (look.light.strength > 0) this.shine(look);
  }

  private drawLayer(
    buffers: FrameBuffers,
    layer: Layer,
    at: number,
    brushed: Rows,
    under: GPUTexture,
  ): GPUTexture {
    const { gpu } = this;
    const drawn = this.textures[at];
    const [places, painted] = [layer.places!, layer.painted!];
    const arrays = [places, painted, brushed, buffers.words];
    gpu.requireBindings(arrays.reduce((sum, { layout }) => sum + layout.parts, 0), "the picture");
    const code = volumeShader(places.layout, painted.layout, brushed.layout, buffers.words.layout);
    const volume = gpu.compute(code, "volume");
    const groups = [
      gpu.bound(volume, 0, { 0: layer.uniform, ...places.bindings(PLACES.first) }),
      gpu.bound(volume, 1, {
        0: this.looks[at],
        3: under.createView(),
        4: drawn.createView(),
        ...painted.bindings(PAINTED.first),
        ...brushed.bindings(BRUSHED.first),
      }),
      gpu.bound(volume, 2, buffers.bindings()),
    ];
    gpu.submit((encoder) => run(encoder, volume, groups, fours(this.size)));
    return drawn;
  }

  private shine({ light, gamma }: Look): void {
    const { gpu, parts } = this;
    const [gather, sweep] = ["gather", "sweep"].map((entry) => gpu.compute(lightCode, entry));
    const { first, size, times, slots } = this.blocks!;
    const [, , forward] = viewAxes(light.azimuth, light.elevation);
    const towards = scaled(alongCells(this.smoke, scaled(forward, -1)), 1 / times);
    const main = towards.map(Math.abs).reduce((best, value, axis, all) => (value > all[best] ? axis : best), 0);
    const others = [0, 1, 2].filter((axis) => axis !== main);
    const shift = others.map((axis) => towards[axis] / Math.abs(towards[main]));
    const half = ((0.5 / Math.abs(towards[main])) * gamma) / parts;
    const origin = this.smoke.lower.map((cell) => cell * parts - 1);
    const numbers = new ArrayBuffer(256 * size[main]);
    for (let layer = 0; layer < size[main]; layer++) {
      const ints = new Int32Array(numbers, 256 * layer, 16);
      const floats = new Float32Array(numbers, 256 * layer, 16);
      ints.set([...first, main, ...size, times, ...origin, towards[main] > 0 ? 1 : 0]);
      floats.set([...shift, half], 12);
      ints[15] = layer;
    }
    gpu.write(slots, new Uint8Array(numbers));
    const slot = (layer: number): GPUBufferBinding => ({ buffer: slots, offset: 256 * layer, size: 64 });
    gpu.submit((encoder) => {
      const views = { 1: this.drawn!.createView(), 2: this.thickness! };
      run(encoder, gather, [gpu.bound(gather, 0, { 0: slot(0), ...views })], fours(size));
      const [wide, high] = others.map((axis) => Math.ceil(size[axis] / 8));
      for (let layer = 0; layer < size[main]; layer++) {
        const group = gpu.bound(sweep, 0, {
          0: slot(layer),
          2: this.thickness!,
          3: this.depth!,
          4: this.reached!.createView(),
        });
        run(encoder, sweep, [group], [wide, high, 1]);
      }
    });
  }

  /** The picture of a camera, into a texture, from `left` to `right` of it, 0 … 1. */
  take(
    encoder: GPUCommandEncoder,
    into: GPUTexture,
    camera: Camera,
    look: Look,
    stride: number,
    [left, right]: [number, number] = [0, 1],
    clear = true,
  ): void {
    const { gpu, parts } = this;
    const aspect = into.width / into.height;
    const extent = 2 * slope(camera.fieldOfView);
    const [across, up, forward] = viewAxes(camera.azimuth, camera.elevation);
    const cells = (vector: Vector): Vector => alongCells(this.smoke, vector);
    const { light } = look;
    const glow = Math.max(1 - light.strength, 0);
    const blocks = this.blocks!;
    // Where the first block has its middle, in cells of what is drawn, of which the first is -1.
    const middle = blocks.first.map(
      (block, axis) => (block + 0.5) * blocks.times - 0.5 - this.smoke.lower[axis] * parts + 1,
    );
    const numbers = new Float32Array([
      ...this.place(pinhole(camera)), parts,
      ...cells(forward), stride,
      ...cells(scaled(across, extent)), aspect,
      ...cells(scaled(up, extent)), (look.gamma / parts) * stride,
      ...this.size, 0,
      ...middle, blocks.times,
      glow, light.strength, light.ambient, light.strength > 0 ? 1 : 0,
      ...OCTAVES.map(([weight]) => weight / FACING), 0,
    ]);
    gpu.write(this.camera, numbers);
    const buffers = this.buffers!;
    const march = gpu.render(marchShader(buffers.words.layout), "march", PICTURE);
    const pass = encoder.beginRenderPass({
      colorAttachments: [
        {
          view: into.createView(),
          loadOp: clear ? "clear" : "load",
          storeOp: "store",
          clearValue: [0, 0, 0, 0],
        },
      ],
    });
    pass.setPipeline(march);
    const group = gpu.bound(march, 0, {
      0: this.camera,
      1: this.drawn!.createView(),
      2: this.reached!.createView(),
      3: this.sampler,
    });
    pass.setBindGroup(0, group);
    pass.setBindGroup(1, gpu.bound(march, 1, {}));
    pass.setBindGroup(2, gpu.bound(march, 2, buffers.bindings()));
    const begin = Math.round(left * into.width);
    const wide = Math.round(right * into.width) - begin;
    if (wide > 0) {
      pass.setScissorRect(begin, 0, wide, into.height);
      pass.draw(3);
    }
    pass.end();
  }

  /** A point of the world, in cells of what is drawn. */
  place(point: Vector): Vector {
    const cell = applied(affineInverse(this.smoke.toWorld), point);
    return cell.map(
      (value, axis) => (value + 0.5) * this.parts - 0.5 - this.smoke.lower[axis] * this.parts + 1,
    );
  }

  get texture3d(): GPUTexture {
    return this.drawn!;
  }

  get cells(): Vector {
    return this.size;
  }

  get refinement(): number {
    return this.parts;
  }

  private release(): void {
    for (const texture of this.textures) texture.destroy();
    for (const old of [this.reached, this.thickness, this.depth, this.blocks?.slots]) old?.destroy();
  }

  destroy(): void {
    this.release();
    for (const old of [this.camera, this.nothing, ...this.looks]) old.destroy();
  }
}

/** Cells of what is drawn along each axis; more than a page can draw are refused. */
export function drawnSize(gpu: Gpu, { lower, upper }: Smoke, parts: number): Vector {
  const size = lower.map((low, axis) => (upper[axis] - low) * parts + 2);
  const most = gpu.device.limits.maxTextureDimension3D;
  const texels = size.reduce((product, side) => product * side, 1);
  if (Math.max(...size) > most || texels > MOST_TEXELS) {
    throw new Problem(
      `A volume of ${size.join(" × ")} (${mebibytes(8 * texels)}) is more than this page draws: ` +
        "choose a smaller sequence or less detail.",
    );
  }
  return size;
}

/** A unit vector of the world along the axes of the cells, which are cubes. */
export function alongCells(smoke: Smoke, vector: Vector): Vector {
  return scaled(rotated(affineInverse(smoke.toWorld), vector), spacing(smoke));
}

/** The length of a cell's edge in the world. */
export function spacing(smoke: Smoke): number {
  return Math.hypot(...[0, 1, 2].map((row) => smoke.toWorld[row][0]));
}

/** The least and greatest corner of the world's box around the smoke, in parts of a cell. */
export function worldBox(smoke: Smoke, parts: number): [Vector, Vector] {
  const length = spacing(smoke) / parts;
  const [low, high] = worldCorners(smoke, smoke.toWorld);
  return [scaled(low, 1 / length), scaled(high, 1 / length)];
}

/** Likewise in the world's own lengths. */
export function worldCorners(smoke: Smoke, toWorld: Matrix4): [Vector, Vector] {
  const corners = Array.from({ length: 8 }, (_, corner) => {
    const at = [0, 1, 2].map((axis) => ((corner >> axis) & 1 ? smoke.upper : smoke.lower)[axis] - 0.5);
    return applied(toWorld, at);
  });
  const pick = (choose: (...values: number[]) => number): Vector =>
    [0, 1, 2].map((axis) => choose(...corners.map((corner) => corner[axis])));
  return [pick(Math.min), pick(Math.max)];
}

function fours(size: Vector): [number, number, number] {
  return size.map((side) => Math.ceil(side / 4)) as [number, number, number];
}

