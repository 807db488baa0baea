// What the cells of a rule are conditioned on: position, density, velocity, as `rule/conditioning.py`;
// and `tell_fields` adds fields of the smoke.

struct Condition {
  place: mat4x4f,   // From index coordinates to −1 … 1 in the box of the training.
  columns: vec3i,   // The first column of position, density and velocity; −1 where there is none.
  width: u32,       // Numbers a cell is told, the 1 included.
  scales: vec2f,    // Density and speed that count as 1.
  unused: vec2f,
  guide: vec4f,     // A direction, in which velocity is turned by a part.
}

@group(1) @binding(0) var<uniform> given: Condition;
@group(1) @binding(1) var<storage, read_write> told: array<f32>;  // Of the batch.

const SPEED_LIMIT = 2.0;
const DENSITY_LIMIT = 4.0;

@compute @workgroup_size(64)
fn condition(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  if (number >= batch.rows) {
    return;
  }
  let cell = cell_of(batch.first + number);
  let first = number * given.width;
  for (var k = 0u; k + 1u < given.width; k++) {
    told[first + k] = 0.0;
  }
  told[first + given.width - 1u] = 1.0;
  if (given.columns.x >= 0) {
    let at = clamp((given.place * vec4f(vec3f(cell), 1.0)).xyz, vec3f(-1.0), vec3f(1.0));
    for (var axis = 0u; axis < 3u; axis++) {
      told[first + u32(given.columns.x) + axis] = at[axis];
    }
  }
  if (given.columns.y >= 0) {
    told[first + u32(given.columns.y)] = min(density_at(cell) / given.scales.x, DENSITY_LIMIT);
  }
  if (given.columns.z >= 0) {
    let own = velocity_at(cell) / given.scales.y;
    let turned = guided(own, given.guide, 1.0);
    let limited = turned * (SPEED_LIMIT / max(length(turned), SPEED_LIMIT));
    for (var axis = 0u; axis < 3u; axis++) {
      told[first + u32(given.columns.z) + axis] = limited[axis];
    }
  }
  tell_fields(first, cell);
}
