// Brushes: what a finger does to the smoke that it points at.

import blendCode from "../shaders/blend.wgsl";
import brushCode from "../shaders/brush.wgsl";
import meetCode from "../shaders/meet.wgsl";
import { type Camera, pinhole, slope, viewAxes } from "./camera";
import { type FrameBuffers, smokeShader } from "../smoke/frame";
import { type Gpu, run } from "../gpu/gpu";
import type { Layer } from "../automaton/layer";
import { plus, scaled, type Vector } from "../matrix";
import { BRUSHED, type Picture } from "./picture";
import { alongCells } from "./volume";
import { Layout, Rows } from "../gpu/rows";
import type { Smoke } from "../smoke/smoke";

export type Stroke = "erase" | "more" | "less";

/** What is added to the mix by a touch. */
const AMOUNT = 0.5;

function meetShader(): string {
  return `${smokeShader(Layout.WHOLE)}${brushCode}${meetCode}`;
}

function blendShader(brushed: Layout): string {
  const mix = brushed.declared("brushed", { ...BRUSHED, isWritten: true });
  return `${smokeShader(Layout.WHOLE)}${brushCode}${mix}${blendCode}`;
}

export class Brush {
  /** How much more of the second rule is seen at each cell of the box. */
  readonly brushed: Rows;
  private readonly uniform: GPUBuffer;
  private readonly hit: GPUBuffer;

  private constructor(
    private readonly gpu: Gpu,
    private readonly smoke: Smoke,
  ) {
    const [x, y, z] = smoke.lower.map((low, axis) => smoke.upper[axis] - low);
    this.brushed = Rows.empty(gpu, Layout.of(gpu, x, 4 * y * z), "the mix of two rules");
    this.uniform = gpu.uniform(64);
    this.hit = gpu.buffer(16);
  }

  static async create(gpu: Gpu, smoke: Smoke): Promise<Brush> {
    const made = new Brush(gpu, smoke);
    await gpu.prepare([[meetShader(), "meet"], [blendShader(made.brushed.layout), "blend"]]);
    return made;
  }

  /** Point at a place of a picture, −½ … ½ of its width and height, up. */
  point(
    [x, y]: [number, number],
    { camera, aspect, picture, gamma }: { camera: Camera; aspect: number; picture: Picture; gamma: number },
    stroke: Stroke,
    radius: number,
  ): void {
    const { gpu, smoke } = this;
    const [right, up, forward] = viewAxes(camera.azimuth, camera.elevation);
    const extent = 2 * slope(camera.fieldOfView);
    const ray: Vector = plus(plus(forward, right, x * aspect * extent), up, y * extent);
    const way = alongCells(smoke, scaled(ray, 1 / Math.hypot(...ray)));
    const parts = picture.refinement;
    const amount = stroke === "less" ? -AMOUNT : AMOUNT;
    gpu.write(
      this.uniform,
      new Float32Array([
        ...picture.place(pinhole(camera)), radius,
        ...way, gamma / parts,
        ...picture.cells, parts,
        amount, 0, 0, 0,
      ]),
    );
    const meet = gpu.compute(meetShader(), "meet");
    const found = { 0: this.uniform, 1: picture.texture3d.createView(), 2: this.hit };
    const groups = [gpu.bound(meet, 0, {}), gpu.bound(meet, 1, found)];
    gpu.submit((encoder) => run(encoder, meet, groups, 1));
  }

  /** Make the state zero where it points. */
  erase(layers: Layer[], buffers: FrameBuffers): void {
    for (const layer of layers) layer.erase(buffers, { 0: this.uniform, 2: this.hit });
  }

  /** Change the mix of two rules where it points. */
  blend(buffers: FrameBuffers): void {
    const { gpu, smoke, brushed } = this;
    const blend = gpu.compute(blendShader(brushed.layout), "blend");
    const size = smoke.lower.map((low, axis) => Math.ceil((smoke.upper[axis] - low) / 4));
    const groups = [
      gpu.bound(blend, 0, {}),
      gpu.bound(blend, 1, { 0: this.uniform, 2: this.hit, ...brushed.bindings(BRUSHED.first) }),
      gpu.bound(blend, 2, buffers.bindings(false)),
    ];
    gpu.submit((encoder) => run(encoder, blend, groups, size as [number, number, number]));
  }
}
