// What a finger does: to the smoke that it points at, erase the state or change the mix of rules.

struct Brush {
  eye: vec4f,       // Of the ray, in cells; w: the radius, cells.
  way: vec4f,       // A unit vector; w: γ of a cell of density 1.
  size: vec4f,      // Of what is drawn, in its cells; w: parts of a cell.
  amount: f32,      // What is added to the mix.
}

@group(1) @binding(0) var<uniform> brush: Brush;
@group(1) @binding(1) var drawn: texture_3d<f32>;
@group(1) @binding(2) var<storage, read_write> hit: vec4f;           // The cell met; w: 1 if any.
@group(1) @binding(3) var<storage, read_write> state: array<vec4f>;
@group(1) @binding(4) var<storage, read_write> brushed: array<f32>;

// Where half of the light is gone.
@compute @workgroup_size(1)
fn meet() {
  var reached = 0.0;
  hit = vec4f(0.0);
  let way = brush.way.xyz;
  let a = (vec3f(-0.5) - brush.eye.xyz) / way;
  let b = (brush.size.xyz - 0.5 - brush.eye.xyz) / way;
  let near = max(max(min(a.x, b.x), max(min(a.y, b.y), min(a.z, b.z))), 0.0);
  let far = min(max(a.x, b.x), min(max(a.y, b.y), max(a.z, b.z)));
  for (var depth = near; depth <= far; depth += 0.5) {
    let cell = brush.eye.xyz + depth * way;
    let at = clamp(vec3i(floor(cell + 0.5)), vec3i(0), vec3i(brush.size.xyz) - 1);
    reached += 0.5 * brush.way.w * textureLoad(drawn, at, 0).w;
    if (reached > 0.7) {
      hit = vec4f((cell - 0.5) / brush.size.w - 0.5, 1.0);
      return;
    }
  }
}

fn is_near(cell: vec3i) -> bool {
  return hit.w > 0.0 && distance(vec3f(cell), hit.xyz + vec3f(smoke.lower)) <= brush.eye.w;
}

@compute @workgroup_size(64)
fn erase(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let row = thread.y * groups.x * 64u + thread.x;
  if (row < sites.cells && is_near(cell_of(row))) {
    for (var p = 0u; p < PLANES; p++) {
      state[row * PLANES + p] = vec4f(0.0);
    }
  }
}

@compute @workgroup_size(4, 4, 4)
fn blend(@builtin(global_invocation_id) thread: vec3u) {
  let side = smoke.upper - smoke.lower;
  let at = vec3i(thread);
  if (any(at >= side) || !is_near(at + smoke.lower)) {
    return;
  }
  let number = u32((at.x * side.y + at.y) * side.z + at.z);
  brushed[number] = clamp(brushed[number] + brush.amount, -1.0, 1.0);
}
