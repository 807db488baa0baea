// What is seen at points given by the rows of the cells around them, as arrays are decoded: `state_at`
// reads the states.

struct Points {
  count: u32,       // How many points there are,
  outside: u32,     // and the row that stands for the outside.
  unused: vec2u,
}

@group(0) @binding(0) var<uniform> points: Points;
@group(0) @binding(1) var<storage, read> rows: array<u32>;        // By corner, z fastest, then point.
@group(0) @binding(2) var<storage, read> fractions: array<f32>;   // By point.
@group(0) @binding(3) var<storage, read_write> seen: array<vec4f>;

@compute @workgroup_size(64)
fn decode(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let point = thread.y * groups.x * 64u + thread.x;
  if (point >= points.count) {
    return;
  }
  let part = vec3f(fractions[3u * point], fractions[3u * point + 1u], fractions[3u * point + 2u]);
  var between: array<vec4f, PLANES>;
  for (var corner = 0u; corner < 8u; corner++) {
    let row = rows[corner * points.count + point];
    if (row == points.outside) {
      continue;
    }
    let upper = vec3u((corner >> 2u) & 1u, (corner >> 1u) & 1u, corner & 1u) == vec3u(1u);
    let share = select(1.0 - part, part, upper);
    for (var p = 0u; p < PLANES; p++) {
      between[p] += share.x * share.y * share.z * state_at(row, p);
    }
  }
  seen[point] = seen_of(between);
}
