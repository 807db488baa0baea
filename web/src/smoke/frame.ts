// The smoke of a frame on the GPU, shared by layers, pictures and brushes.

import smokeCode from "../shaders/smoke.wgsl";
import type { Gpu } from "../gpu/gpu";
import { Layout, Rows } from "../gpu/rows";
import { NOWHERE } from "../automaton/sites";
import type { Frame, Smoke } from "./smoke";

const WORDS = { group: 2, first: 16, element: "u32" };

/** What shaders read of the smoke, in group 2. */
export function smokeShader(words: Layout): string {
  return `${words.declared("word", WORDS)}${smokeCode}`;
}

export class FrameBuffers {
  private constructor(
    readonly frame: Frame,
    readonly uniform: GPUBuffer,
    readonly words: Rows,
  ) {}

  static upload(gpu: Gpu, smoke: Smoke, frame: Frame): FrameBuffers {
    const first = smoke.lower.map((cell) => Math.floor(cell / 8));
    const span = smoke.upper.map((cell, axis) => Math.floor((cell - 1) / 8) + 1 - first[axis]);
    const places = span[0] * span[1] * span[2];
    const words = new Uint32Array(places + frame.planes.length / 4);
    words.fill(NOWHERE, 0, places);
    for (let brick = 0; brick < frame.count; brick++) {
      const [x, y, z] = [0, 1, 2].map((axis) => frame.bricks[3 * brick + axis] - first[axis]);
      words[(x * span[1] + y) * span[2] + z] = brick;
    }
    new Uint8Array(words.buffer).set(frame.planes, 4 * places);
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
    return new FrameBuffers(frame, uniform, Rows.of(gpu, words, "the smoke"));
  }

  /** What `smokeShader` reads, words and all, or only how large it is. */
  bindings(withWords = true): Record<number, GPUBuffer> {
    return { 0: this.uniform, ...(withWords ? this.words.bindings(WORDS.first) : {}) };
  }

  destroy(): void {
    this.uniform.destroy();
    this.words.destroy();
  }
}
