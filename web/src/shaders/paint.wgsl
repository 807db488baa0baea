// What is seen of a state: the mean over each part of a cell, as `painting/__init__.py` paints it.

struct Paint {
  parts: u32,       // Of a cell along each axis.
  samples: u32,     // Points along each axis of a part.
  layer: u32,       // Of the rim: how far outwards it is.
  cells: u32,       // How many cells are painted: the active ones, or those of the rim.
  margin: i32,      // How far beyond the box of the smoke cells are active: nothing is seen there.
}

@group(2) @binding(0) var<uniform> now: Paint;

// `state_at` reads the states. `painted_at` and `set_painted` are by row and part: linear colour, and
// the factor of density. Of the rim, rows that follow the active ones: minus the layer in which its
// colour was found, or 0.

fn linear_of(colour: vec3f) -> vec3f {
  let shown = clamp(colour + 0.5, vec3f(0.0), vec3f(1.0));
  return select(pow((shown + 0.055) / 1.055, vec3f(2.4)), shown / 12.92, shown <= vec3f(0.04045));
}

fn part_of(number: u32) -> vec3u {
  return vec3u(number / (now.parts * now.parts), (number / now.parts) % now.parts, number % now.parts);
}

// The state between the cells around a place `twice / (2 · along)` cells from the centre of one.
fn seen_at(cell: vec3i, twice: vec3i, along: i32) -> vec4f {
  let lower = select(vec3i(0), vec3i(-1), twice < vec3i(0));
  let fraction = vec3f(twice) / f32(2 * along) - vec3f(lower);
  var between: array<vec4f, PLANES>;
  for (var corner = 0u; corner < 8u; corner++) {
    let step = vec3i(vec3u(corner >> 2u, (corner >> 1u) & 1u, corner & 1u));
    let row = row_of(bordered(cell + lower + step));
    if (row >= sites.cells) {
      continue;
    }
    let share = select(1.0 - fraction, fraction, step == vec3i(1));
    for (var p = 0u; p < PLANES; p++) {
      between[p] += share.x * share.y * share.z * state_at(row, p);
    }
  }
  return seen_of(between);
}

@compute @workgroup_size(64)
fn paint(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  let parts = now.parts * now.parts * now.parts;
  if (number >= now.cells * parts) {
    return;
  }
  let row = number / parts;
  let cell = cell_of(row);
  let part = part_of(number % parts);
  let along = i32(now.parts * now.samples);
  var sum = vec4f(0.0);
  let count = now.samples * now.samples * now.samples;
  for (var s = 0u; s < count; s++) {
    let sample = vec3u(s / (now.samples * now.samples), (s / now.samples) % now.samples, s % now.samples);
    var seen: vec4f;
    if (UNITS4 == 0u) {
      seen = state_at(row, 0u);
    } else {
      seen = seen_at(cell, 2 * vec3i(part * now.samples + sample) + 1 - along, along);
    }
    sum += vec4f(linear_of(seen.xyz), 1.0 + clamp(seen.w, -0.5, 0.5));
  }
  set_painted(row, number % parts, sum / f32(count));
}

// A layer of the rim: the mean of those of the six parts beside each that were known a layer before.
@compute @workgroup_size(64)
fn rim(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let parts = now.parts * now.parts * now.parts;
  let number = thread.y * groups.x * 64u + thread.x;
  if (number >= now.cells * parts) {
    return;
  }
  let row = sites.cells + number / parts;
  let own = number % parts;
  if (now.layer == 0u) {
    set_painted(row, own, vec4f(1.0, 1.0, 1.0, 0.0));
    return;
  }
  if (painted_at(row, own).w != 0.0) {
    return;
  }
  let size = i32(now.parts);
  let fine = cell_of(row) * size + vec3i(part_of(own));
  var sum = vec4f(0.0);
  for (var way = 0u; way < 6u; way++) {
    var beside = fine;
    beside[way / 2u] += i32(way & 1u) * 2 - 1;
    let coarse = vec3i(floor((vec3f(beside) + 0.5) / f32(size)));
    let there = row_of(coarse);
    let inside_box = all(coarse >= sites.lower + now.margin) && all(coarse < sites.upper - now.margin);
    if (there == NOWHERE || !inside_box) {
      continue;
    }
    let inside = vec3u(beside - coarse * size);
    let colour = painted_at(there, (inside.x * now.parts + inside.y) * now.parts + inside.z);
    let known = -colour.w;
    if (known < 0.0 || (known > 0.0 && known < f32(now.layer))) {
      sum += vec4f(colour.xyz, 1.0);
    }
  }
  if (sum.w > 0.0) {
    set_painted(row, own, vec4f(sum.xyz / sum.w, -f32(now.layer)));
  }
}
