// The smoke of a frame as its file has it: bytes of bricks, made into numbers where they are read.

struct Smoke {
  lower: vec3i,     // Of the box, its lowest cell,
  density: f32,     // what the greatest byte stands for,
  upper: vec3i,     // one beyond its highest,
  speed: f32,       // and of a component of velocity; 0 without velocity.
  first: vec3i,     // The lowest brick of the map, in bricks,
  bricks: u32,      // how many bricks there are,
  span: vec3i,      // and how many the map has along each axis.
  unused: u32,
}

// `word_at` reads the map, the number of a brick or NONE; then the densities, 128 words a brick; then
// the velocities; then the fields, 256 words a brick and component.
@group(2) @binding(0) var<uniform> smoke: Smoke;

const NONE = 0xffffffffu;

// Where a cell stands among those of all bricks, or NONE.
fn stored_at(cell: vec3i) -> u32 {
  let at = (cell >> vec3u(3)) - smoke.first;
  if (any(at < vec3i(0)) || any(at >= smoke.span)) {
    return NONE;
  }
  let brick = word_at(u32((at.x * smoke.span.y + at.y) * smoke.span.z + at.z));
  let within = vec3u(cell & vec3i(7));
  return select(512u * brick + ((within.x << 6) | (within.y << 3) | within.z), NONE, brick == NONE);
}

fn byte_of(plane: u32, stored: u32) -> u32 {
  let map = u32(smoke.span.x * smoke.span.y * smoke.span.z);
  let word = word_at(map + 128u * plane * smoke.bricks + stored / 4u);
  return (word >> (8u * (stored & 3u))) & 255u;
}

fn density_at(cell: vec3i) -> f32 {
  let stored = stored_at(cell);
  if (stored == NONE) {
    return 0.0;
  }
  let part = f32(byte_of(0u, stored)) / 255.0;
  return smoke.density * part * part;
}

fn velocity_at(cell: vec3i) -> vec3f {
  let stored = stored_at(cell);
  if (stored == NONE || smoke.speed == 0.0) {
    return vec3f(0.0);
  }
  var parts: vec3f;
  for (var axis = 0u; axis < 3u; axis++) {
    let byte = i32(byte_of(axis + 1u, stored) << 24u) >> 24u;
    parts[axis] = f32(byte) / 127.0;
  }
  return smoke.speed * parts * abs(parts);
}

// A component of the fields, −1 … 1.
fn field_at(component: u32, cell: vec3i) -> f32 {
  let stored = stored_at(cell);
  if (stored == NONE) {
    return 0.0;
  }
  let planes = select(1u, 4u, smoke.speed > 0.0);
  let before = u32(smoke.span.x * smoke.span.y * smoke.span.z) + 128u * planes * smoke.bricks;
  let word = word_at(before + 256u * component * smoke.bricks + stored / 2u);
  return f32(i32(word << (16u * (1u - (stored & 1u)))) >> 16u) / 32767.0;
}

// A velocity turned towards a direction by a part; one that rests, as if it had half of `unit`.
fn guided(velocity: vec3f, guide: vec4f, unit: f32) -> vec3f {
  return mix(velocity, guide.xyz * max(length(velocity), 0.5 * unit), guide.w);
}
