// How much light reaches each place, as `rendering/light.py` finds it: how much smoke lies between it
// and the light, and each part of the sky, layer by layer away from them, of means over blocks of
// cells. All ways are swept at once.

struct Light {
  first: vec3i,     // The lowest block: blocks hold the cells from block · times on.
  times: i32,       // Cells along an edge of a block.
  size: vec3i,      // How many blocks there are along each axis.
  layer: i32,
  origin: vec3i,    // Index coordinates of the first cell of what is drawn, the cell beside the box.
  strength: f32,
  facing: vec2f,    // How bright smoke is that faces the light, and a sky.
  parts: vec2f,     // Of the strength: that of the light, and that of the sky.
  octaves: vec4f,   // Two weights, and two parts of the extinction.
}

// Where light comes from: first the light, then the parts of the sky.
struct Way {
  shift: vec2f,     // Blocks along the two other axes that light comes from, a layer before.
  half: f32,        // Half the way through a block along the ray, times γ.
  main: u32,        // The axis that layers follow,
  weight: f32,
  is_up: u32,       // and 1 where the light stands where that axis leads to.
}

@group(0) @binding(0) var<uniform> light: Light;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> thickness: array<f32>;
@group(0) @binding(3) var<storage, read_write> depth: array<f32>;
@group(0) @binding(4) var shadow: texture_storage_3d<rgba16float, write>;
@group(0) @binding(5) var<storage, read> ways: array<Way>;

fn number(block: vec3i) -> u32 {
  return u32((block.x * light.size.y + block.y) * light.size.z + block.z);
}

fn number_of(way: u32, block: vec3i) -> u32 {
  return way * u32(light.size.x * light.size.y * light.size.z) + number(block);
}

@compute @workgroup_size(4, 4, 4)
fn gather(@builtin(global_invocation_id) thread: vec3u) {
  let block = vec3i(thread);
  if (any(block >= light.size)) {
    return;
  }
  var sum = 0.0;
  let corner = (light.first + block) * light.times - light.origin;
  for (var x = 0; x < light.times; x++) {
    for (var y = 0; y < light.times; y++) {
      for (var z = 0; z < light.times; z++) {
        let at = corner + vec3i(x, y, z);
        if (all(at >= vec3i(0)) && all(at < vec3i(textureDimensions(drawn)))) {
          sum += textureLoad(drawn, at, 0).w;
        }
      }
    }
  }
  thickness[number(block)] = sum / f32(light.times * light.times * light.times);
}

// A block of a layer by its place there; outside it is nothing.
fn block_of(way: u32, layer: i32, place: vec2i) -> vec3i {
  let main = ways[way].main;
  let along = select(layer, light.size[main] - 1 - layer, ways[way].is_up == 1u);
  switch (main) {
    case 0u: { return vec3i(along, place.x, place.y); }
    case 1u: { return vec3i(place.x, along, place.y); }
    default: { return vec3i(place.x, place.y, along); }
  }
}

fn behind(way: u32, layer: i32, place: vec2i) -> f32 {
  let block = block_of(way, layer, place);
  if (any(block < vec3i(0)) || any(block >= light.size)) {
    return 0.0;
  }
  return depth[number_of(way, block)] + ways[way].half * thickness[number(block)];
}

@compute @workgroup_size(8, 8)
fn sweep(@builtin(global_invocation_id) thread: vec3u) {
  let place = vec2i(thread.xy);
  let way = thread.z;
  let block = block_of(way, light.layer, place);
  if (any(block < vec3i(0)) || any(block >= light.size)) {
    return;
  }
  var value = 0.0;
  if (light.layer > 0) {
    let shift = ways[way].shift;
    let low = floor(shift);
    let part = shift - low;
    let at = place + vec2i(low);
    let before = light.layer - 1;
    let first = mix(behind(way, before, at), behind(way, before, at + vec2i(1, 0)), part.x);
    let second = mix(behind(way, before, at + vec2i(0, 1)), behind(way, before, at + vec2i(1, 1)), part.x);
    value = mix(first, second, part.y) + ways[way].half * thickness[number(block)];
  }
  depth[number_of(way, block)] = value;
}

fn passed(way: u32, block: vec3i) -> f32 {
  let reached = exp(-depth[number_of(way, block)] * light.octaves.zw);
  return ways[way].weight * dot(light.octaves.xy, reached);
}

@compute @workgroup_size(4, 4, 4)
fn shade(@builtin(global_invocation_id) thread: vec3u) {
  let block = vec3i(thread);
  if (any(block >= light.size)) {
    return;
  }
  var sky = 0.0;
  for (var way = 1u; way < arrayLength(&ways); way++) {
    sky += passed(way, block);
  }
  let taken = max(1.0 - vec2f(passed(0u, block), sky) / light.facing, vec2f(0.0));
  textureStore(shadow, block, vec4f(light.strength * dot(light.parts, taken), 0.0, 0.0, 0.0));
}
