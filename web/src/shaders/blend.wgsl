// How much more of the second rule is seen: `brushed_at` reads it and `set_brushed` writes it.

@compute @workgroup_size(4, 4, 4)
fn blend(@builtin(global_invocation_id) thread: vec3u) {
  let side = smoke.upper - smoke.lower;
  let at = vec3i(thread);
  if (any(at >= side) || !is_near(at + smoke.lower)) {
    return;
  }
  let row = u32(at.x);
  let place = u32(at.y * side.z + at.z);
  set_brushed(row, place, clamp(brushed_at(row, place) + brush.amount, -1.0, 1.0));
}
