// What happens: frames of smoke, one or two rules at work on them, brushes, and the picture of it.

import { Brush, type Stroke } from "./picture/brush";
import { type Camera, frameBox, viewAxes } from "./picture/camera";
import { FrameBuffers } from "./smoke/frame";
import type { Gpu } from "./gpu/gpu";
import { Layer } from "./automaton/layer";
import type { Vector } from "./matrix";
import type { Rule } from "./automaton/model";
import { type Look, Picture, PICTURE } from "./picture/picture";
import { drawnSize, worldCorners } from "./picture/volume";
import { Screen } from "./picture/screen";
import { DEFAULTS, type Settings } from "./settings";
import type { Frame, Smoke } from "./smoke/smoke";

/** Frames up to which the velocity of one carries states over those that are skipped. */
const NEAR = 4;
const FIELD_OF_VIEW = 30;
const STRIDE = 0.5; // cells of what is drawn, between samples along a ray
/** Points along each axis of a part, by how many parts a cell has: `rule/paint.py`. */
const SAMPLES: Record<number, number> = { 1: 3, 2: 2, 3: 2, 4: 2 };
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

  private constructor(
    readonly gpu: Gpu,
    readonly smoke: Smoke,
    private readonly painting: Picture,
    private readonly plain: Picture,
    private readonly brush: Brush,
    private readonly screen: Screen,
  ) {
    this.camera = this.framed(1);
  }

  static async create(gpu: Gpu, smoke: Smoke, format: GPUTextureFormat): Promise<Stage> {
    drawnSize(gpu, smoke, 1);
    const [painting, plain, brush, screen] = await Promise.all([
      Picture.create(gpu, smoke),
      Picture.create(gpu, smoke),
      Brush.create(gpu, smoke),
      Screen.create(gpu, format),
    ]);
    return new Stage(gpu, smoke, painting, plain, brush, screen);
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
    this.buffers?.destroy();
    this.buffers = FrameBuffers.upload(this.gpu, this.smoke, frame);
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
    this.brush.brushed.clear();
    await this.show(0);
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
    const most = this.gpu.device.limits.maxStorageBuffersPerShaderStage;
    const others = this.brush.brushed.layout.parts + (this.buffers?.words.layout.parts ?? 0);
    let parts = this.settings.detail;
    while (parts > 1 && this.layers.some((layer) => layer.boundFor(parts, others) > most)) parts--;
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
      this.painting.draw(this.buffers, this.layers, this.brush.brushed, this.look());
      if (this.settings.wipe < 1) {
        this.plain.refine(1);
        const [first] = this.layers;
        this.plain.draw(this.buffers, [first], this.brush.brushed, this.look(true));
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
    this.screen.present(picture, into, [width, height], this.settings);
  }

  /** The pixels of a finished picture, 8-bit sRGB with opacity, row by row. */
  async pixels(width: number, height: number): Promise<Uint8ClampedArray<ArrayBuffer>> {
    return this.screen.pixels(this.take(width, height), [width, height], this.settings);
  }

  /** Touch the smoke at a place of the picture, −½ … ½ of its width and height, up. */
  touch(stroke: Stroke, at: [number, number], aspect: number): void {
    if (this.buffers === null || this.layers.length === 0) return;
    this.prepare();
    const { camera, painting: picture } = this;
    const view = { camera, aspect, picture, gamma: this.look().gamma };
    this.brush.point(at, view, stroke, this.settings.brush);
    if (stroke === "erase") {
      this.brush.erase(this.layers, this.buffers);
      this.stale.state = true;
    } else {
      this.brush.blend(this.buffers);
      this.stale.look = true;
    }
  }
}
