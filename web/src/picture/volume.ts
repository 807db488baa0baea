// The grid that is drawn on: its cells, where they lie, and textures of as many.

import { type Gpu, mebibytes } from "../gpu/gpu";
import { affineInverse, applied, rotated, scaled, type Matrix4, type Vector } from "../matrix";
import { Problem } from "../problem";
import type { Smoke } from "../smoke/smoke";

const MOST_TEXELS = 2 ** 27;

export function volumeTexture(gpu: Gpu, size: Vector): GPUTexture {
  return gpu.device.createTexture({
    size,
    dimension: "3d",
    format: "rgba16float",
    usage:
      GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC,
  });
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

/** Groups of four cells along each axis. */
export function fours(size: Vector): [number, number, number] {
  return size.map((side) => Math.ceil(side / 4)) as [number, number, number];
}

