// How much smoke lies between each place and the light, as `rendering/light.py` finds it: layer by
// layer away from the light, of means over blocks of cells.

struct Light {
  first: vec3i,     // The lowest block: blocks hold the cells from block · times on.
  main: u32,        // The axis that layers follow,
  size: vec3i,      // How many blocks there are along each axis.
  times: i32,       // Cells along an edge of a block.
  origin: vec3i,    // Index coordinates of the first cell of what is drawn, the cell beside the box.
  is_up: u32,       // 1 where the light stands where that axis leads to.
  shift: vec2f,     // Blocks along the two other axes that light comes from, a layer before.
  half: f32,        // Half the way through a block along the ray, times γ.
  layer: i32,
}

@group(0) @binding(0) var<uniform> light: Light;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> thickness: array<f32>;
@group(0) @binding(3) var<storage, read_write> depth: array<f32>;
@group(0) @binding(4) var reached: texture_storage_3d<rgba16float, write>;

fn number(block: vec3i) -> u32 {
  return u32((block.x * light.size.y + block.y) * light.size.z + block.z);
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
  thickness[number(block)] = light.half * sum / f32(light.times * light.times * light.times);
}

// A block of a layer by its place there; outside it is nothing.
fn block_of(layer: i32, place: vec2i) -> vec3i {
  let along = select(layer, light.size[light.main] - 1 - layer, light.is_up == 1u);
  switch (light.main) {
    case 0u: { return vec3i(along, place.x, place.y); }
    case 1u: { return vec3i(place.x, along, place.y); }
    default: { return vec3i(place.x, place.y, along); }
  }
}

fn behind(layer: i32, place: vec2i) -> f32 {
  let block = block_of(layer, place);
  if (any(block < vec3i(0)) || any(block >= light.size)) {
    return 0.0;
  }
  return depth[number(block)] + thickness[number(block)];
}

@compute @workgroup_size(8, 8)
fn sweep(@builtin(global_invocation_id) thread: vec3u) {
  let place = vec2i(thread.xy);
  let block = block_of(light.layer, place);
  if (any(block >= light.size)) {
    return;
  }
  var value = 0.0;
  if (light.layer > 0) {
    let low = floor(light.shift);
    let part = light.shift - low;
    let at = place + vec2i(low);
    let before = light.layer - 1;
    let first = mix(behind(before, at), behind(before, at + vec2i(1, 0)), part.x);
    let second = mix(behind(before, at + vec2i(0, 1)), behind(before, at + vec2i(1, 1)), part.x);
    value = mix(first, second, part.y) + thickness[number(block)];
  }
  depth[number(block)] = value;
  textureStore(reached, block, vec4f(value, 0.0, 0.0, 0.0));
}
