// The state on the cells of another frame: cells active in both keep theirs, new ones start at zero.

@group(0) @binding(0) var<storage, read> former: array<u32>;  // The row each had, or 0xffffffff.
@group(0) @binding(1) var<storage, read> before: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> after: array<vec4f>;

@compute @workgroup_size(64)
fn carry(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let row = thread.y * groups.x * 64u + thread.x;
  if (row >= arrayLength(&former)) {
    return;
  }
  let had = former[row];
  for (var p = 0u; p < PLANES; p++) {
    var value = vec4f(0.0);
    if (had != 0xffffffffu) {
      value = before[had * PLANES + p];
    }
    after[row * PLANES + p] = value;
  }
}
