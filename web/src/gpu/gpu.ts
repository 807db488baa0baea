// The GPU: opened with what the adapter has, and shaders made ready to run on it.

import { Problem } from "../problem";

/** What is asked for as large as the adapter has it. */
const LIMITS = [
  "maxBufferSize",
  "maxStorageBufferBindingSize",
  "maxStorageBuffersPerShaderStage",
  "maxTextureDimension3D",
  "maxTextureDimension2D",
] as const;
const GROUPS = 65535; // along an axis of a dispatch

export type Resource = GPUBuffer | GPUTextureView | GPUSampler | GPUBufferBinding;
export type Bindings = Record<number, Resource>;

export class Gpu {
  readonly lost: Promise<GPUDeviceLostInfo>;
  private readonly modules = new Map<string, GPUShaderModule>();
  private readonly pipelines = new Map<string, GPUComputePipeline>();
  private readonly drawings = new Map<string, GPURenderPipeline>();

  private constructor(
    readonly device: GPUDevice,
    readonly name: string,
    readonly hasHalf: boolean,
  ) {
    this.lost = device.lost;
  }

  static async open(): Promise<Gpu> {
    if (!("gpu" in navigator)) {
      throw new Problem("This browser has no WebGPU.");
    }
    const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
    if (adapter === null) {
      throw new Problem("This browser has WebGPU, but finds no GPU that it may use.");
    }
    const hasHalf = adapter.features.has("shader-f16");
    const requiredLimits: Record<string, number> = {};
    for (const limit of LIMITS) requiredLimits[limit] = adapter.limits[limit];
    const device = await adapter.requestDevice({
      requiredFeatures: hasHalf ? ["shader-f16"] : [],
      requiredLimits,
    });
    const { vendor, architecture, description } = adapter.info;
    return new Gpu(device, description || `${vendor} ${architecture}`.trim() || "a GPU", hasHalf);
  }

  /** How many bytes of an array a shader binds at once. */
  get bindable(): number {
    const { maxStorageBufferBindingSize, maxBufferSize } = this.device.limits;
    return Math.min(maxStorageBufferBindingSize, maxBufferSize);
  }

  /** Refuses what takes more arrays at once than a shader binds. */
  requireBindings(count: number, what: string): void {
    const most = this.device.limits.maxStorageBuffersPerShaderStage;
    if (count <= most) return;
    throw new Problem(
      `${what}: arrays in ${count} parts of ${mebibytes(this.bindable)}, and this GPU binds at most ` +
        `${most}: choose a smaller sequence or less detail.`,
    );
  }

  /** So many bytes of zeros, or an array: less than any GPU binds at once. */
  buffer(content: number | ArrayBufferView<ArrayBuffer>): GPUBuffer {
    const size = typeof content === "number" ? content : content.byteLength;
    const buffer = this.device.createBuffer({
      size: Math.max(16, Math.ceil(size / 4) * 4),
      usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC,
    });
    if (typeof content !== "number") this.write(buffer, content);
    return buffer;
  }

  uniform(size: number): GPUBuffer {
    const usage = GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST;
    return this.device.createBuffer({ size, usage });
  }

  write(buffer: GPUBuffer, content: ArrayBufferView<ArrayBuffer>, at = 0): void {
    this.device.queue.writeBuffer(buffer, at, content.buffer, content.byteOffset, content.byteLength);
  }

  module(code: string): GPUShaderModule {
    let module = this.modules.get(code);
    if (module === undefined) {
      module = this.device.createShaderModule({ code });
      this.modules.set(code, module);
    }
    return module;
  }

  /** Shaders made ready beforehand, so that nothing waits for them later. */
  async prepare(shaders: [code: string, entryPoint: string][]): Promise<void> {
    await Promise.all(
      shaders.map(async ([code, entryPoint]) => {
        const compute = { module: this.module(code), entryPoint };
        const ready = await this.device.createComputePipelineAsync({ layout: "auto", compute });
        this.pipelines.set(`${entryPoint}\n${code}`, ready);
      }),
    );
  }

  /** A shader ready to run. */
  compute(code: string, entryPoint: string): GPUComputePipeline {
    const key = `${entryPoint}\n${code}`;
    let ready = this.pipelines.get(key);
    if (ready === undefined) {
      const compute = { module: this.module(code), entryPoint };
      ready = this.device.createComputePipeline({ layout: "auto", compute });
      this.pipelines.set(key, ready);
    }
    return ready;
  }

  /** Likewise of what draws, from the vertices of `corner`. */
  async prepareRender(code: string, fragment: string, format: GPUTextureFormat): Promise<void> {
    const ready = await this.device.createRenderPipelineAsync(this.drawing(code, fragment, format));
    this.drawings.set(`${fragment} ${format}\n${code}`, ready);
  }

  render(code: string, fragment: string, format: GPUTextureFormat): GPURenderPipeline {
    const key = `${fragment} ${format}\n${code}`;
    let ready = this.drawings.get(key);
    if (ready === undefined) {
      ready = this.device.createRenderPipeline(this.drawing(code, fragment, format));
      this.drawings.set(key, ready);
    }
    return ready;
  }

  private drawing(
    code: string,
    entryPoint: string,
    format: GPUTextureFormat,
  ): GPURenderPipelineDescriptor {
    const module = this.module(code);
    return {
      layout: "auto",
      vertex: { module, entryPoint: "corner" },
      fragment: { module, entryPoint, targets: [{ format }] },
    };
  }

  bound(ready: GPUPipelineBase, group: number, bindings: Bindings): GPUBindGroup {
    const entries = Object.entries(bindings).map(([binding, resource]) => ({
      binding: Number(binding),
      resource: resource instanceof GPUBuffer ? { buffer: resource } : resource,
    }));
    return this.device.createBindGroup({ layout: ready.getBindGroupLayout(group), entries });
  }

  /** Work in an order of its own, submitted at once. */
  submit(work: (encoder: GPUCommandEncoder) => void): void {
    const encoder = this.device.createCommandEncoder();
    work(encoder);
    this.device.queue.submit([encoder.finish()]);
  }

  /** What a buffer holds. */
  async read(buffer: GPUBuffer, size = buffer.size): Promise<ArrayBuffer> {
    const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
    const copy = this.device.createBuffer({ size, usage });
    this.submit((encoder) => encoder.copyBufferToBuffer(buffer, 0, copy, 0, size));
    await copy.mapAsync(GPUMapMode.READ);
    const content = copy.getMappedRange().slice(0);
    copy.destroy();
    return content;
  }

  /** The rows of a texture, without what pads them. */
  async pixels(texture: GPUTexture, bytesOfPixel: number): Promise<ArrayBuffer> {
    const { width, height } = texture;
    const row = width * bytesOfPixel;
    const stride = Math.ceil(row / 256) * 256;
    const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
    const copy = this.device.createBuffer({ size: stride * height, usage });
    this.submit((encoder) =>
      encoder.copyTextureToBuffer(
        { texture },
        { buffer: copy, bytesPerRow: stride },
        { width, height },
      ),
    );
    await copy.mapAsync(GPUMapMode.READ);
    const padded = new Uint8Array(copy.getMappedRange());
    const result = new Uint8Array(row * height);
    for (let y = 0; y < height; y++) {
      result.set(padded.subarray(y * stride, y * stride + row), y * row);
    }
    copy.destroy();
    return result.buffer;
  }
}

/** Run a pipeline in so many groups of threads. */
export function run(
  encoder: GPUCommandEncoder,
  ready: GPUComputePipeline,
  groups: GPUBindGroup[],
  count: number | [number, number, number],
): void {
  const pass = encoder.beginComputePass();
  pass.setPipeline(ready);
  groups.forEach((group, number) => pass.setBindGroup(number, group));
  if (typeof count === "number") {
    const rows = Math.ceil(count / GROUPS) || 1;
    pass.dispatchWorkgroups(Math.ceil(count / rows), rows);
  } else {
    pass.dispatchWorkgroups(...count);
  }
  pass.end();
}

export function mebibytes(size: number): string {
  return `${Number((size / 2 ** 20).toPrecision(3))} MiB`;
}
