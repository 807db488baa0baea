// What happens: frames of smoke, one or two rules at work on them, brushes, and the picture of it.

import brushCode from "./shaders/brush.wgsl";
import presentCode from "./shaders/present.wgsl";
import smokeCode from "./shaders/smoke.wgsl";
import sitesCode from "../../src/vnca/engine/wgsl/sites.wgsl";
import { quarters } from "./automaton";
import { type Camera, frameBox, pinhole, slope, viewAxes } from "./camera";
import { type Gpu, run } from "./gpu";
import { type FrameBuffers, Layer } from "./layer";
import { plus, scaled, type Vector } from "./matrix";
import type { Rule } from "./model";
import { alongCells, type Look, Picture, PICTURE, worldCorners } from "./picture";
import type { Frame, Smoke } from "./smoke";
import { NOWHERE } from "./sites";

export interface Settings {
  seed: number;
  /** Steps a frame; those of the rule's training where it is 0. */
  steps: number;
  warmup: number;
  /** How fast the velocity carries patterns; as in a rule's training where it is below 0. */
  patternSpeed: number;
  strength: number;
  densityStrength: number;
  /** What γ of the rule is multiplied by. */
  density: number;
  /** Stops. */
  exposure: number;
  light: number;
  lightAzimuth: number;
  lightElevation: number;
  ambient: number;
  guide: number;
  guideAzimuth: number;
  guideElevation: number;
  mix: number;
  /** Where the line to the plain smoke stands, 0 … 1; 2: none. */
  wipe: number;
  /** Parts of a cell along each axis that are drawn. */
  detail: number;
  brush: number;
  /** 1 rounds the factors of a step to 16 bits, where the GPU has such numbers. */
  half: number;
}

export const DEFAULTS: Readonly<Settings> = {
  seed: 0,
  steps: 0,
  warmup: 64,
  patternSpeed: -1,
  strength: 1,
  densityStrength: 1,
  density: 1,
  exposure: 0,
  light: 1.2,
  lightAzimuth: -55,
  lightElevation: 40,
  ambient: 0.15,
  guide: 0,
  guideAzimuth: 0,
  guideElevation: 90,
  mix: 0,
  wipe: 2,
  detail: 1,
  brush: 5,
  half: 0,
};
/** Frames up to which the velocity of one carries states over those that are skipped. */
const NEAR = 4;
const FIELD_OF_VIEW = 30;
const STRIDE = 0.5; // cells of what is drawn, between samples along a ray
/** Points along each axis of a part, by how many parts a cell has: `rule/paint.py`. */
const SAMPLES: Record<number, number> = { 1: 3, 2: 2, 3: 2, 4: 2 };
/** Linear, of #101014. */
const BACKGROUND = [0.005181516702338386, 0.005181516702338386, 0.006995410187265387];

interface Pipelines {
  meet: GPUComputePipeline;
  blend: GPUComputePipeline;
  present: GPURenderPipeline;
}

export class Stage {
  readonly settings: Settings = { ...DEFAULTS };
  camera: Camera;
  at = -1;
  layers: Layer[] = [];
  /** Points along each axis of a part that are looked at; fewer where there is no time. */
  samples = 0;
  private buffers: FrameBuffers | null = null;
  private stale = { state: true, look: true };
  private picture: GPUTexture | null = null;
  private readonly brushed: GPUBuffer;
  private readonly brush: GPUBuffer;
  private readonly hit: GPUBuffer;
  private readonly screen: GPUBuffer;
  private readonly sampler: GPUSampler;

  private constructor(
    readonly gpu: Gpu,
    readonly smoke: Smoke,
    private readonly painting: Picture,
    private readonly plain: Picture,
    private readonly pipelines: Pipelines,
    private readonly format: GPUTextureFormat,
  ) {
    const side = smoke.lower.map((low, axis) => smoke.upper[axis] - low);
    this.brushed = gpu.buffer(4 * side[0] * side[1] * side[2], "the mix of two rules");
    this.brush = gpu.uniform(64);
    this.hit = gpu.buffer(16, "a point");
    this.screen = gpu.uniform(32);
    this.sampler = gpu.device.createSampler({ magFilter: "linear", minFilter: "linear" });
    this.camera = this.framed(1);
  }

  static async create(gpu: Gpu, smoke: Smoke, format: GPUTextureFormat): Promise<Stage> {
    // `meet` and `blend` touch no state, so planes are of no matter to them.
    const brush = `const PLANES = 1u;\n${sitesCode}${smokeCode}${brushCode}`;
    const [painting, plain, meet, blend, present] = await Promise.all([
      Picture.create(gpu, smoke),
      Picture.create(gpu, smoke),
      gpu.compute(brush, "meet"),
      gpu.compute(brush, "blend"),
      gpu.render(presentCode, "present", format),
    ]);
    return new Stage(gpu, smoke, painting, plain, { meet, blend, present }, format);
  }

  /** The camera of a film: framed on the smoke of all frames. */
  framed(aspect: number, azimuth = 0, elevation = 5): Camera {
    const [low, high] = worldCorners(this.smoke, this.smoke.toWorld);
    return frameBox(low, high, azimuth, elevation, aspect, FIELD_OF_VIEW);
  }

  /** Let a rule work as the first or the second; it begins where the smoke is. */
  async use(rule: Rule | null, place: 0 | 1): Promise<void> {
    const isHalf = this.settings.half > 0;
    const layer = rule === null ? null : await Layer.create(this.gpu, rule, this.smoke, isHalf);
    this.layers[place]?.destroy();
    if (layer === null) {
      this.layers.length = place;
    } else {
      this.layers[place] = layer;
      if (this.buffers !== null) this.begin(layer);
    }
    this.stale.state = true;
  }

  private get guide(): { direction: Vector; amount: number } {
    const { guide, guideAzimuth, guideElevation } = this.settings;
    const [, , forward] = viewAxes(guideAzimuth, -guideElevation);
    return { direction: forward, amount: guide };
  }

  private begin(layer: Layer): void {
    layer.enter(this.buffers!, this.guide, 0);
    this.frameSteps(layer, this.settings.warmup);
  }

  private frameSteps(layer: Layer, warmup: number): void {
    const steps = this.settings.steps || layer.rule.steps;
    layer.step(warmup + steps, this.settings.seed);
  }

  /** Paint the next frame of the sequence, or another: its smoke, and its steps. */
  async show(at: number): Promise<void> {
    this.enterFrame(await this.smoke.frame(at), at);
  }

  enterFrame(frame: Frame, at: number): void {
    const passed = this.passed(frame, at);
    this.release();
    this.buffers = this.upload(frame);
    this.at = at;
    for (const layer of this.layers) {
      const isNew = layer.sites === null || layer.sites.cells === 0;
      layer.enter(this.buffers, this.guide, passed * this.patternSpeed(layer));
      this.frameSteps(layer, isNew ? this.settings.warmup : 0);
    }
    this.stale.state = true;
    if (at + 1 < this.smoke.length) void this.smoke.frame(at + 1).catch(() => undefined);
  }

  /** How many frames lie between the last one and another; none where it is far from there. */
  private passed(frame: Frame, at: number): number {
    if (this.buffers === null) return 0;
    const passed = frame.number - this.buffers.frame.number;
    return at === this.at + 1 || Math.abs(passed) <= NEAR ? passed : 0;
  }

  /** How fast the velocity carries the pattern of a rule. */
  patternSpeed({ rule }: Layer): number {
    const { patternSpeed } = this.settings;
    return patternSpeed < 0 ? Number(rule.transport) : patternSpeed;
  }

  /** From nothing, at the first frame. */
  async restart(): Promise<void> {
    for (const layer of this.layers) layer.reset();
    this.gpu.write(this.brushed, new Float32Array(this.brushed.size / 4));
    await this.show(0);
  }

  private upload(frame: Frame): FrameBuffers {
    const { gpu, smoke } = this;
    const first = smoke.lower.map((cell) => Math.floor(cell / 8));
    const span = smoke.upper.map((cell, axis) => Math.floor((cell - 1) / 8) + 1 - first[axis]);
    const map = new Uint32Array(span[0] * span[1] * span[2]).fill(NOWHERE);
    for (let brick = 0; brick < frame.count; brick++) {
      const [x, y, z] = [0, 1, 2].map((axis) => frame.bricks[3 * brick + axis] - first[axis]);
      map[(x * span[1] + y) * span[2] + z] = brick;
    }
    const bytes = new Uint8Array(map.byteLength + frame.planes.length);
    bytes.set(new Uint8Array(map.buffer));
    bytes.set(frame.planes, map.byteLength);
    const numbers = new ArrayBuffer(64);
    const ints = new Int32Array(numbers);
    const floats = new Float32Array(numbers);
    ints.set(smoke.lower);
    floats[3] = smoke.density;
    ints.set(smoke.upper, 4);
    floats[7] = smoke.speed;
    ints.set([...first, frame.count, ...span], 8);
    const uniform = gpu.uniform(64);
    gpu.write(uniform, new Uint8Array(numbers));
    return { frame, uniform, bytes: gpu.buffer(bytes, "the smoke") };
  }

  /** So many steps on the frame that is there. */
  step(count: number): void {
    for (const layer of this.layers) layer.step(count, this.settings.seed);
    this.stale.state = true;
  }

  /** What a rule is told has changed. */
  conditionAgain(): void {
    if (this.buffers === null) return;
    for (const layer of this.layers) layer.condition(this.buffers, this.guide);
  }

  lookAgain(): void {
    this.stale.look = true;
  }

  /** How the first rule is seen; γ is its own. */
  look(isPlain = false): Look {
    const s = this.settings;
    const [first] = this.layers;
    return {
      strength: isPlain ? 0 : s.strength,
      densityStrength: s.densityStrength,
      gamma: first.rule.gamma * s.density,
      light: {
        strength: s.light,
        azimuth: s.lightAzimuth,
        elevation: s.lightElevation,
        ambient: s.ambient,
      },
      isPlain,
      mixed: s.mix,
    };
  }

  /** How finely the volume is drawn: only a decoder knows what is between cells; and no more finely
   * than the GPU binds. */
  get parts(): number {
    if (!this.layers.every((layer) => layer.rule.decoder.length > 0)) return 1;
    const most = this.gpu.device.limits.maxStorageBufferBindingSize;
    const cells = Math.max(...this.layers.map((layer) => layer.shown));
    let parts = this.settings.detail;
    while (parts > 1 && 16 * cells * parts ** 3 > most) parts--;
    return parts;
  }

  /** Bring the volumes up to date with state and look. */
  private prepare(): void {
    if (this.buffers === null || this.layers.length === 0) return;
    const { parts } = this;
    if (parts !== this.painting.refinement) this.stale.state = true;
    if (this.stale.state) {
      const samples = this.samples || SAMPLES[parts];
      for (const layer of this.layers) layer.paint(parts, Math.min(samples, SAMPLES[parts]));
    }
    if (this.stale.state || this.stale.look) {
      this.painting.refine(parts);
      this.painting.draw(this.buffers, this.layers, this.brushed, this.look());
      if (this.settings.wipe < 1) {
        this.plain.refine(1);
        const [first] = this.layers;
        this.plain.draw(this.buffers, [first], this.brushed, this.look(true));
      }
    }
    this.stale = { state: false, look: false };
  }

  /** The picture, linear and premultiplied, in a texture of such a size. */
  take(width: number, height: number): GPUTexture {
    this.prepare();
    if (this.picture?.width !== width || this.picture.height !== height) {
      this.picture?.destroy();
      this.picture = this.gpu.device.createTexture({
        size: [width, height],
        format: PICTURE,
        usage:
          GPUTextureUsage.RENDER_ATTACHMENT |
          GPUTextureUsage.TEXTURE_BINDING |
          GPUTextureUsage.COPY_SRC,
      });
    }
    const picture = this.picture;
    if (this.buffers === null || this.layers.length === 0) return picture;
    const wipe = Math.min(this.settings.wipe, 1);
    this.gpu.submit((encoder) => {
      const { camera } = this;
      this.painting.take(encoder, picture, camera, this.look(), STRIDE, [0, wipe]);
      if (wipe < 1) {
        this.plain.take(encoder, picture, camera, this.look(true), STRIDE, [wipe, 1], false);
      }
    });
    return picture;
  }

  /** The picture in front of its background, into a view of such a size. */
  present(picture: GPUTexture, into: GPUTextureView, width: number, height: number): void {
    const { present } = this.pipelines;
    const s = this.settings;
    const soft = s.light > 0 ? 1 : 0;
    const numbers = [...BACKGROUND, soft, 2 ** s.exposure, s.wipe, width, height];
    this.gpu.write(this.screen, new Float32Array(numbers));
    this.gpu.submit((encoder) => {
      const pass = encoder.beginRenderPass({
        colorAttachments: [{ view: into, loadOp: "clear", storeOp: "store", clearValue: [0, 0, 0, 1] }],
      });
      pass.setPipeline(present);
      const group = this.gpu.bound(present, 0, {
        0: this.screen,
        1: picture.createView(),
        2: this.sampler,
      });
      pass.setBindGroup(0, group);
      pass.draw(3);
      pass.end();
    });
  }

  /** The pixels of a finished picture, 8-bit sRGB with opacity, row by row. */
  async pixels(width: number, height: number): Promise<Uint8ClampedArray<ArrayBuffer>> {
    const picture = this.take(width, height);
    const { device } = this.gpu;
    const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC;
    const texture = device.createTexture({ size: [width, height], format: this.format, usage });
    this.present(picture, texture.createView(), width, height);
    const pixels = new Uint8ClampedArray(await this.gpu.pixels(texture, 4));
    texture.destroy();
    if (this.format === "bgra8unorm") {
      for (let at = 0; at < pixels.length; at += 4) {
        [pixels[at], pixels[at + 2]] = [pixels[at + 2], pixels[at]];
      }
    }
    return pixels;
  }

  /** Touch the smoke at a place of the picture, −½ … ½ of its width and height, up. */
  async touch(
    what: "erase" | "more" | "less",
    [x, y]: [number, number],
    aspect: number,
  ): Promise<void> {
    if (this.buffers === null || this.layers.length === 0) return;
    this.prepare();
    const { gpu, smoke } = this;
    const [right, up, forward] = viewAxes(this.camera.azimuth, this.camera.elevation);
    const extent = 2 * slope(this.camera.fieldOfView);
    const ray = plus(plus(forward, right, x * aspect * extent), up, y * extent);
    const way = alongCells(smoke, scaled(ray, 1 / Math.hypot(...ray)));
    const { parts } = this;
    const gamma = this.look().gamma / parts;
    gpu.write(
      this.brush,
      new Float32Array([
        ...this.painting.place(pinhole(this.camera)), this.settings.brush,
        ...way, gamma,
        ...this.painting.cells, parts,
        what === "less" ? -0.5 : 0.5, 0, 0, 0,
      ]),
    );
    const { meet } = this.pipelines;
    const drawn = this.painting.texture3d.createView();
    const found = gpu.bound(meet, 1, { 0: this.brush, 1: drawn, 2: this.hit });
    gpu.submit((encoder) => run(encoder, meet, [gpu.bound(meet, 0, {}), found], 1));
    if (what === "erase") await this.erase();
    else this.blend();
  }

  private async erase(): Promise<void> {
    const { gpu } = this;
    for (const layer of this.layers) {
      const planes = `const PLANES = ${quarters(layer.rule.channels)}u;\n`;
      const erase = await gpu.compute(`${planes}${sitesCode}${smokeCode}${brushCode}`, "erase");
      if (layer.sites === null || layer.sites.cells === 0 || this.buffers === null) continue;
      const groups = [
        gpu.bound(erase, 0, { 0: layer.uniform, 1: layer.places! }),
        gpu.bound(erase, 1, { 0: this.brush, 2: this.hit, 3: layer.state! }),
        gpu.bound(erase, 2, { 0: this.buffers.uniform }),
      ];
      const cells = layer.sites.cells;
      gpu.submit((encoder) => run(encoder, erase, groups, Math.ceil(cells / 64)));
    }
    this.stale.state = true;
  }

  private blend(): void {
    const { gpu, smoke } = this;
    const { blend } = this.pipelines;
    const size = smoke.lower.map((low, axis) => Math.ceil((smoke.upper[axis] - low) / 4));
    const groups = [
      gpu.bound(blend, 0, {}),
      gpu.bound(blend, 1, { 0: this.brush, 2: this.hit, 4: this.brushed }),
      gpu.bound(blend, 2, { 0: this.buffers!.uniform }),
    ];
    gpu.submit((encoder) => run(encoder, blend, groups, size as [number, number, number]));
    this.stale.look = true;
  }

  private release(): void {
    this.buffers?.uniform.destroy();
    this.buffers?.bytes.destroy();
    this.buffers = null;
  }

  destroy(): void {
    this.release();
    for (const layer of this.layers) layer.destroy();
    this.painting.destroy();
    this.plain.destroy();
    for (const old of [this.picture, this.brushed, this.brush, this.hit, this.screen]) old?.destroy();
  }
}
