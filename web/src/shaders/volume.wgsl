// What is drawn: density, and colour times density, at every cell of the box and one beside it.
//
// `painted_at` reads what a rule has painted, `brushed_at` how much more of it is seen at a cell.

struct Volume {
  parts: i32,              // Of a cell along each axis.
  is_plain: u32,           // 1 shows the smoke as it was.
  has_under: u32,          // 1 where another rule's volume lies under this one.
  mixed: f32,              // How much of this one is seen over it everywhere,
  strength: f32,           // Of the colour.
  density_strength: f32,
  scale: f32,              // The density that counts as 1.
  unused: f32,
}

@group(1) @binding(0) var<uniform> look: Volume;
@group(1) @binding(3) var under: texture_3d<f32>;
@group(1) @binding(4) var drawn: texture_storage_3d<rgba16float, write>;

// The density at the centre of a part of a cell; beyond the outermost cells of the box it stays.
fn density_of(fine: vec3i) -> f32 {
  if (look.parts == 1) {
    return density_at(fine);
  }
  let place = (vec3f(fine) + 0.5) / f32(look.parts) - 0.5;
  let below = floor(place);
  let part = place - below;
  var sum = 0.0;
  for (var corner = 0u; corner < 8u; corner++) {
    let step = vec3i(vec3u(corner >> 2u, (corner >> 1u) & 1u, corner & 1u));
    let share = select(1.0 - part, part, step == vec3i(1));
    let cell = clamp(vec3i(below) + step, smoke.lower, smoke.upper - 1);
    sum += share.x * share.y * share.z * density_at(cell);
  }
  return sum;
}

@compute @workgroup_size(4, 4, 4)
fn volume(@builtin(global_invocation_id) thread: vec3u) {
  let size = textureDimensions(drawn);
  if (any(thread >= size)) {
    return;
  }
  let fine = vec3i(thread) - 1 + smoke.lower * look.parts;
  let coarse = vec3i(floor((vec3f(fine) + 0.5) / f32(look.parts)));
  var value = vec4f(0.0);
  if (all(coarse >= smoke.lower) && all(coarse < smoke.upper)) {
    let density = density_of(fine) / look.scale;
    if (density > 0.0) {
      var colour = vec4f(1.0);
      let row = row_of(coarse);
      if (row != NOWHERE && look.is_plain == 0u) {
        let inside = fine - coarse * look.parts;
        let part = u32((inside.x * look.parts + inside.y) * look.parts + inside.z);
        colour = painted_at(row, part);
        colour.w = select(1.0, colour.w, row < sites.cells);
      }
      let shown = 1.0 + look.strength * (colour.xyz - 1.0);
      let thick = density * (1.0 + look.density_strength * (colour.w - 1.0));
      value = vec4f(shown * thick, thick);
    }
    if (look.has_under == 1u) {
      let at = coarse - smoke.lower;
      let side = smoke.upper - smoke.lower;
      let more = brushed_at(u32(at.x), u32(at.y * side.z + at.z));
      value = mix(textureLoad(under, thread, 0), value, clamp(look.mixed + more, 0.0, 1.0));
    }
  }
  textureStore(drawn, thread, value);
}
