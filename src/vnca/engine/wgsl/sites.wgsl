// Where cells lie: rows of the state by index coordinates, through a map of bricks of 8³ cells.
//
// The places around a cell are looked up, never listed: a list of 27 rows a cell would be larger
// than all else that there is.

struct Sites {
  lower: vec3i,     // Of the box, beyond which neighbours are repeated or wrapped: its lowest cell,
  cells: u32,       // how many cells are active,
  upper: vec3i,     // and one beyond its highest.
  circular: u32,    // 1 where neighbours are wrapped.
  first: vec3i,     // The lowest brick of the map, in bricks,
  bricks: u32,      // how many bricks hold cells,
  span: vec3i,      // and how many the map has along each axis.
  unused: u32,
}

const NOWHERE = 0xffffffffu;

// What a thread works on: so many rows from the first on.
struct Batch {
  first: u32,
  rows: u32,
}

// Rows from `cells` on belong to cells beside the active ones, which have a place and no state.
//
// `place_at` reads, behind each other: the map, a number of a brick or NOWHERE for each of its places, z fastest; the
// coordinates of the bricks, three each; the rows of their cells, 512 each; and where the cell of
// each row lies, number of brick · 512 + place in it.
@group(0) @binding(0) var<uniform> sites: Sites;
@group(0) @binding(1) var<uniform> batch: Batch;

fn map_length() -> u32 {
  return u32(sites.span.x * sites.span.y * sites.span.z);
}

// The number of the brick that holds a cell, or NOWHERE.
fn brick_at(cell: vec3i) -> u32 {
  let at = (cell >> vec3u(3)) - sites.first;
  if (any(at < vec3i(0)) || any(at >= sites.span)) {
    return NOWHERE;
  }
  return place_at(u32((at.x * sites.span.y + at.y) * sites.span.z + at.z));
}

fn place_in_brick(cell: vec3i) -> u32 {
  let within = vec3u(cell & vec3i(7));
  return (within.x << 6) | (within.y << 3) | within.z;
}

// The row of a cell, or NOWHERE.
fn row_of(cell: vec3i) -> u32 {
  let brick = brick_at(cell);
  if (brick == NOWHERE) {
    return NOWHERE;
  }
  return place_at(map_length() + 3u * sites.bricks + 512u * brick + place_in_brick(cell));
}

// The cell that stands for a place at most a box beside the box.
fn bordered(cell: vec3i) -> vec3i {
  if (sites.circular == 1u) {
    let size = sites.upper - sites.lower;
    return (cell - sites.lower + size) % size + sites.lower;
  }
  return clamp(cell, sites.lower, sites.upper - 1);
}

fn cell_of(row: u32) -> vec3i {
  let at = place_at(map_length() + 515u * sites.bricks + row);
  let brick = map_length() + 3u * (at >> 9);
  let corner = vec3i(vec3u(place_at(brick), place_at(brick + 1u), place_at(brick + 2u)));
  return corner * 8 + vec3i(vec3u((at >> 6) & 7u, (at >> 3) & 7u, at & 7u));
}
