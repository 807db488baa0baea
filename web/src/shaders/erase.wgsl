// States made zero where a brush touches the smoke; they begin anew.

@group(1) @binding(3) var<storage, read_write> state: array<vec4f>;  // Of the batch.

@compute @workgroup_size(64)
fn erase(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  if (number < batch.rows && is_near(cell_of(batch.first + number))) {
    for (var p = 0u; p < PLANES; p++) {
      state[number * PLANES + p] = vec4f(0.0);
    }
  }
}
