// The finished picture: in front of its background, on the screen or as pixels.

import presentCode from "../shaders/present.wgsl";
import type { Gpu } from "../gpu/gpu";
import type { Settings } from "../settings";

/** Linear, of #101014. */
const BACKGROUND = [0.005181516702338386, 0.005181516702338386, 0.006995410187265387];

export class Screen {
  private readonly uniform: GPUBuffer;
  private readonly sampler: GPUSampler;

  private constructor(
    private readonly gpu: Gpu,
    private readonly format: GPUTextureFormat,
  ) {
    this.uniform = gpu.uniform(32);
    this.sampler = gpu.device.createSampler({ magFilter: "linear", minFilter: "linear" });
  }

  static async create(gpu: Gpu, format: GPUTextureFormat): Promise<Screen> {
    await gpu.prepareRender(presentCode, "present", format);
    return new Screen(gpu, format);
  }

  /** A picture in front of its background, into a view of such a size. */
  present(
    picture: GPUTexture,
    into: GPUTextureView,
    [width, height]: [number, number],
    { light, exposure, wipe }: Settings,
  ): void {
    const { gpu } = this;
    const present = gpu.render(presentCode, "present", this.format);
    const soft = light > 0 ? 1 : 0;
    const numbers = [...BACKGROUND, soft, 2 ** exposure, wipe, width, height];
    gpu.write(this.uniform, new Float32Array(numbers));
    gpu.submit((encoder) => {
      const pass = encoder.beginRenderPass({
        colorAttachments: [{ view: into, loadOp: "clear", storeOp: "store", clearValue: [0, 0, 0, 1] }],
      });
      pass.setPipeline(present);
      const bindings = { 0: this.uniform, 1: picture.createView(), 2: this.sampler };
      pass.setBindGroup(0, gpu.bound(present, 0, bindings));
      pass.draw(3);
      pass.end();
    });
  }

  /** The pixels of a finished picture, 8-bit sRGB with opacity, row by row. */
  async pixels(
    picture: GPUTexture,
    [width, height]: [number, number],
    settings: Settings,
  ): Promise<Uint8ClampedArray<ArrayBuffer>> {
    const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC;
    const size = [width, height];
    const texture = this.gpu.device.createTexture({ size, format: this.format, usage });
    this.present(picture, texture.createView(), [width, height], settings);
    const pixels = new Uint8ClampedArray(await this.gpu.pixels(texture, 4));
    texture.destroy();
    if (this.format === "bgra8unorm") {
      for (let at = 0; at < pixels.length; at += 4) {
        [pixels[at], pixels[at + 2]] = [pixels[at + 2], pixels[at]];
      }
    }
    return pixels;
  }
}
