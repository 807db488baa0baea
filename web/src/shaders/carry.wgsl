// The state on the cells of another frame, carried there by its velocity: `painting/transport.py`.
//
// `sites` are those that it comes from, and the batch those that want it: `wanted_place_at` tells where
// they lie, `before_at` what there was. Places are counted from the cell, which keeps their digits.

struct Wanted {
  map: u32,       // Of the cells that want a state: how many places their map has,
  bricks: u32,    // and how many bricks hold them.
  unused: u32,
  frames: f32,    // For how long the velocity carries it; below zero back, 0 not at all.
  guide: vec4f,   // As the rule is told.
  speed: f32,     // That counts as 1.
}

@group(1) @binding(0) var<uniform> wanted: Wanted;
@group(1) @binding(3) var<storage, read_write> after: array<vec4f>;  // Of the batch.

// What must be active upstream of a cell for it to have its state from there.
const LEAST_SHARE = 0.25;
// What must be known of the velocity.
const LEAST_KNOWN = 1e-6;
const FARTHEST = 1048576.0;

fn wanted_cell(row: u32) -> vec3i {
  let at = wanted_place_at(wanted.map + 515u * wanted.bricks + row);
  let brick = wanted.map + 3u * (at >> 9);
  let corner = vec3u(wanted_place_at(brick), wanted_place_at(brick + 1u), wanted_place_at(brick + 2u));
  return vec3i(corner) * 8 + vec3i(vec3u((at >> 6) & 7u, (at >> 3) & 7u, at & 7u));
}

fn side_of(corner: u32) -> vec3i {
  return vec3i(vec3u(corner >> 2, (corner >> 1) & 1u, corner & 1u));
}

fn share_of(side: vec3i, upper: vec3f) -> f32 {
  let parts = select(1.0 - upper, upper, side == vec3i(1));
  return parts.x * parts.y * parts.z;
}

// The shares of four cells along an axis for a place between the two in the middle: Catmull & Rom.
fn cubic(t: f32) -> vec4f {
  return vec4f(
    ((2.0 - t) * t - 1.0) * t, (3.0 * t - 5.0) * t * t + 2.0, ((4.0 - 3.0 * t) * t + 1.0) * t,
    (t - 1.0) * t * t,
  ) / 2.0;
}

// A cell that is not active counts as the next that is.
fn among(shares: vec4f, alive: vec4<bool>) -> vec4f {
  let outer = shares.xw * vec2f(alive.xw & alive.yz);
  let inner = shares.yz + (shares.xw - outer);
  let middle = select(vec2f(0.0), inner + select(inner.yx, vec2f(0.0), alive.zy), alive.yz);
  return vec4f(outer.x, middle, outer.y);
}

// By how much what is at a cell has come to it: a midpoint step back.
fn moved(cell: vec3i) -> vec3f {
  let here = wanted.frames * guided(velocity_at(cell), wanted.guide, wanted.speed);
  let last = smoke.upper - 1;
  let halfway = clamp(-0.5 * here, vec3f(smoke.lower - cell), vec3f(last - cell));
  let below = min(cell + vec3i(floor(halfway)), max(last - 1, smoke.lower));
  let upper = halfway - vec3f(below - cell);
  let beside = select(vec3i(0), vec3i(1), last > smoke.lower);
  var total = vec3f(0.0);
  var known = 0.0;
  for (var corner = 0u; corner < 8u; corner++) {
    let side = side_of(corner);
    let velocity = velocity_at(below + side * beside);
    if (any(velocity != vec3f(0.0))) {
      let share = share_of(side, upper);
      total += share * guided(velocity, wanted.guide, wanted.speed);
      known += share;
    }
  }
  if (known > LEAST_KNOWN) {
    return wanted.frames * (total / known);
  }
  return here;
}

@compute @workgroup_size(64)
fn carry(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  if (number >= batch.rows) {
    return;
  }
  let cell = wanted_cell(batch.first + number);
  let upstream = clamp(-moved(cell), vec3f(-FARTHEST), vec3f(FARTHEST));
  let first = floor(upstream);
  let place = upstream - first;
  var rows: array<u32, 64>;
  var shares: array<f32, 64>;
  var total = 0.0;
  var planes: vec4<bool>;
  for (var i = 0; i < 4; i++) {
    var lines: vec4<bool>;
    for (var j = 0; j < 4; j++) {
      let line = 16 * i + 4 * j;
      var alive: vec4<bool>;
      for (var k = 0; k < 4; k++) {
        let side = vec3i(i, j, k) - 1;
        let row = row_of(bordered(cell + vec3i(first) + side));
        rows[line + k] = row;
        alive[k] = row < sites.cells;
        if (alive[k] && all((side & vec3i(~1)) == vec3i(0))) {
          total += share_of(side, place);
        }
      }
      let along_z = among(cubic(place.z), alive);
      for (var k = 0; k < 4; k++) {
        shares[line + k] = along_z[k];
      }
      lines[j] = alive.y || alive.z;
    }
    let along_y = among(cubic(place.y), lines);
    for (var at = 0; at < 16; at++) {
      shares[16 * i + at] *= along_y[at >> 2u];
    }
    planes[i] = lines.y || lines.z;
  }
  let along_x = among(cubic(place.x), planes);
  for (var at = 0; at < 64; at++) {
    shares[at] *= along_x[at >> 4u];
  }
  if (total < LEAST_SHARE) {
    shares = array<f32, 64>();
    rows[0] = row_of(cell);
    shares[0] = select(0.0, 1.0, rows[0] < sites.cells);
  }
  for (var p = 0u; p < PLANES; p++) {
    var value = vec4f(0.0);
    for (var at = 0; at < 64; at++) {
      if (shares[at] != 0.0) {
        value += shares[at] * before_at(rows[at], p);
      }
    }
    after[number * PLANES + p] = value;
  }
}
