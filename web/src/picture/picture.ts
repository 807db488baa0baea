// From what layers have painted to a picture: the volume that is drawn, the light in it, the rays.

import marchCode from "../shaders/march.wgsl";
import volumeCode from "../shaders/volume.wgsl";
import { type Camera, pinhole, slope, viewAxes } from "./camera";
import { type Gpu, run } from "../gpu/gpu";
import { type FrameBuffers, smokeShader } from "../smoke/frame";
import type { Layer } from "../automaton/layer";
import { type Light, LightVolume, full } from "./light";
import { affineInverse, applied, scaled, type Vector } from "../matrix";
import { Layout, type Rows } from "../gpu/rows";
import { PLACES, sitesShader } from "../automaton/sites";
import type { Smoke } from "../smoke/smoke";
import { alongCells, drawnSize, fours, volumeTexture } from "./volume";

/** Linear, premultiplied, with opacity. */
export const PICTURE: GPUTextureFormat = "rgba16float";

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
  private shadows: LightVolume | null = null;
  private readonly looks: GPUBuffer[];
  private readonly camera: GPUBuffer;
  private readonly sampler: GPUSampler;
  private readonly nothing: GPUTexture;

  private constructor(
    private readonly gpu: Gpu,
    private readonly smoke: Smoke,
  ) {
    this.looks = [0, 1].map(() => gpu.uniform(32));
    this.camera = gpu.uniform(112);
    this.sampler = gpu.device.createSampler({ magFilter: "linear", minFilter: "linear" });
    this.nothing = volumeTexture(gpu, [1, 1, 1]);
  }

  static async create(gpu: Gpu, smoke: Smoke): Promise<Picture> {
    const { WHOLE } = Layout;
    await Promise.all([
      gpu.prepare([
        [volumeShader(WHOLE, WHOLE, WHOLE, WHOLE), "volume"],
        ...LightVolume.prepared(),
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
    this.textures = [0, 1].map(() => volumeTexture(this.gpu, this.size));
    this.shadows = new LightVolume(this.gpu, this.smoke, parts);
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
    if (look.light.strength > 0) this.shadows!.cast(this.drawn, look.light, look.gamma);
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
    const shadows = this.shadows!;
    const numbers = new Float32Array([
      ...this.place(pinhole(camera)), parts,
      ...cells(forward), stride,
      ...cells(scaled(across, extent)), aspect,
      ...cells(scaled(up, extent)), (look.gamma / parts) * stride,
      ...this.size, 0,
      ...shadows.middle, shadows.times,
      full(light), light.strength > 0 ? 1 : 0, 0, 0,
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
      2: shadows.shadow.createView(),
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
    this.shadows?.destroy();
  }

  destroy(): void {
    this.release();
    for (const old of [this.camera, this.nothing, ...this.looks]) old.destroy();
  }
}
