// Which cells are active in a frame, and where they lie: what `engine/domain.py` finds, brick by
// brick, and the cells beside them to which their colour goes on.

import sitesCode from "../../../src/vnca/engine/wgsl/sites.wgsl";
import type { Layout } from "../gpu/rows";
import type { Frame, Smoke, Vec3 } from "../smoke/smoke";

export const NOWHERE = 0xffffffff;
/** Normalised density from which a cell counts as smoke. */
const THRESHOLD = 0.01;
/** Bindings of the list of cells. */
export const PLACES = { group: 0, first: 16, element: "u32" };
/** How many cells beyond the active ones their colour goes on. */
export const RIM = 3;

export interface Sites {
  /** Active cells, and those beside them. */
  readonly cells: number;
  readonly beside: number;
  /** `Sites` of `sites.wgsl`. */
  readonly uniform: Int32Array<ArrayBuffer>;
  /** `places` of `sites.wgsl`. */
  readonly places: Uint32Array<ArrayBuffer>;
}

/** What shaders read of the list of cells, in group 0. */
export function sitesShader(places: Layout): string {
  return `${places.declared("place", PLACES)}${sitesCode}`;
}

/** Bytes at the cells of a box, z fastest. */
class Grid {
  readonly size: Vec3;
  readonly values: Uint8Array;

  constructor(
    readonly lower: Vec3,
    readonly upper: Vec3,
  ) {
    this.size = [0, 1, 2].map((axis) => upper[axis] - lower[axis]) as Vec3;
    this.values = new Uint8Array(this.size[0] * this.size[1] * this.size[2]);
  }

  at(x: number, y: number, z: number): number {
    const [a, b, c] = this.lower;
    return ((x - a) * this.size[1] + (y - b)) * this.size[2] + (z - c);
  }

  holds(x: number, y: number, z: number): boolean {
    const { lower, upper } = this;
    return (
      x >= lower[0] && x < upper[0] && y >= lower[1] && y < upper[1] && z >= lower[2] && z < upper[2]
    );
  }

  /** Marks with `mark` what is 0 and at most so many cells along each axis from what is not. */
  spread(cells: number, mark: number): void {
    const { size, values } = this;
    const strides = [size[1] * size[2], size[2], 1];
    const reached = Uint8Array.from(values, (value) => (value > 0 ? 1 : 0));
    for (let axis = 0; axis < 3; axis++) {
      const stride = strides[axis];
      const length = size[axis];
      const before = reached.slice();
      for (let at = 0; at < before.length; at++) {
        if (before[at] === 0) continue;
        const place = Math.floor(at / stride) % length;
        const low = -Math.min(cells, place);
        const high = Math.min(cells, length - 1 - place);
        for (let step = low; step <= high; step++) reached[at + step * stride] = 1;
      }
    }
    for (let at = 0; at < values.length; at++) {
      if (values[at] === 0 && reached[at] === 1) values[at] = mark;
    }
  }
}

/** The cells of a frame that a rule of such a density, dilation and domain makes active. */
export function findSites(
  smoke: Smoke,
  frame: Frame,
  density: number,
  dilation: number,
  wholeBox: boolean,
): Sites {
  const lower = smoke.lower.map((cell) => cell - dilation) as Vec3;
  const upper = smoke.upper.map((cell) => cell + dilation) as Vec3;
  const grid = new Grid(lower, upper);
  if (wholeBox) {
    grid.values.fill(1);
  } else {
    mark(grid, smoke, frame, 255 * Math.sqrt((THRESHOLD * density) / smoke.density));
    grid.spread(dilation, 1);
    grid.spread(RIM, 2);
  }
  return listed(grid, smoke);
}

/** Marks the cells of a frame that hold more than a byte says. */
function mark(grid: Grid, smoke: Smoke, frame: Frame, least: number): void {
  for (let brick = 0; brick < frame.count; brick++) {
    const [x, y, z] = [0, 1, 2].map((axis) => 8 * frame.bricks[3 * brick + axis]);
    for (let place = 0; place < 512; place++) {
      if (frame.planes[512 * brick + place] <= least) continue;
      const [i, j, k] = [x + (place >> 6), y + ((place >> 3) & 7), z + (place & 7)];
      const inside =
        i >= smoke.lower[0] && i < smoke.upper[0] &&
        j >= smoke.lower[1] && j < smoke.upper[1] &&
        k >= smoke.lower[2] && k < smoke.upper[2];
      if (inside) grid.values[grid.at(i, j, k)] = 1;
    }
  }
}

/** The marked cells brick by brick; those beside only where something is drawn. */
function listed(grid: Grid, smoke: Smoke): Sites {
  const first = grid.lower.map((cell) => Math.floor(cell / 8)) as Vec3;
  const span = grid.upper.map((cell, axis) => Math.floor((cell - 1) / 8) + 1 - first[axis]) as Vec3;
  const map = new Uint32Array(span[0] * span[1] * span[2]).fill(NOWHERE);
  const coordinates: number[] = [];
  const bricks: number[] = []; // places in the map
  const active: number[] = [];
  const beside: number[] = [];
  let place = 0;
  for (let x = 0; x < span[0]; x++) {
    for (let y = 0; y < span[1]; y++) {
      for (let z = 0; z < span[2]; z++, place++) {
        const corner = [8 * (x + first[0]), 8 * (y + first[1]), 8 * (z + first[2])];
        const found = inBrick(grid, smoke, corner, bricks.length, active, beside);
        if (!found) continue;
        map[place] = bricks.length;
        bricks.push(place);
        coordinates.push(x + first[0], y + first[1], z + first[2]);
      }
    }
  }
  const count = bricks.length;
  const head = map.length + 3 * count;
  const places = new Uint32Array(head + 512 * count + active.length + beside.length);
  places.set(map);
  places.set(Int32Array.from(coordinates), map.length);
  places.fill(NOWHERE, head, head + 512 * count);
  [...[active, beside]].flat().forEach((at, row) => {
    places[head + at] = row;
    places[head + 512 * count + row] = at;
  });
  const uniform = new Int32Array(16);
  uniform.set([...grid.lower, active.length, ...grid.upper, 0, ...first, count, ...span, 0]);
  return { cells: active.length, beside: beside.length, uniform, places };
}

function inBrick(
  grid: Grid,
  smoke: Smoke,
  [x, y, z]: number[],
  brick: number,
  active: number[],
  beside: number[],
): boolean {
  const before = active.length + beside.length;
  for (let place = 0; place < 512; place++) {
    const [i, j, k] = [x + (place >> 6), y + ((place >> 3) & 7), z + (place & 7)];
    if (!grid.holds(i, j, k)) continue;
    const value = grid.values[grid.at(i, j, k)];
    if (value === 1) {
      active.push(512 * brick + place);
    } else if (value === 2) {
      const inside =
        i >= smoke.lower[0] && i < smoke.upper[0] &&
        j >= smoke.lower[1] && j < smoke.upper[1] &&
        k >= smoke.lower[2] && k < smoke.upper[2];
      if (inside) beside.push(512 * brick + place);
    }
  }
  return active.length + beside.length > before;
}
