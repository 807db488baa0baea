// Emission and absorption along the rays of a camera, as `rendering/` adds them up: samples lie at
// whole multiples of a step from the eye, and colour is the quotient of what is interpolated.

struct Camera {
  eye: vec4f,        // In cells of what is drawn; w: their number in a cell of the smoke.
  middle: vec4f,     // The direction of the picture's middle, for a length of depth; w: the step.
  right: vec4f,      // What is added to it for a picture's height to the right; w: aspect,
  up: vec4f,         // and for one up; w: γ times the step.
  size: vec4f,       // Of what is drawn, in cells; w: how much of the picture, from the left.
  blocks: vec4f,     // The first block of the light, in cells; w: cells along an edge of a block.
  light: vec4f,      // What a colour is multiplied by without shadow; 1 where there is a light.
}

// Where a file has no brick there is no smoke within a cell (`viewer/smoke_file.py`): rays leap.

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var shadow: texture_3d<f32>;
@group(0) @binding(3) var between: sampler;

struct Corner {
  @builtin(position) position: vec4f,
  @location(0) place: vec2f,  // −½ … ½, up.
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
  let at = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
  return Corner(vec4f(2.0 * at - 1.0, 0.0, 1.0), at - 0.5);
}

fn lit(cell: vec3f) -> f32 {
  let size = vec3f(textureDimensions(shadow));
  let at = (cell - camera.blocks.xyz) / camera.blocks.w;
  return camera.light.x - textureSampleLevel(shadow, between, (at + 0.5) / size, 0.0).x;
}

// The brick of the cell of the box that is nearest to a place, in bricks: smoke fades over the cell
// beside the box.
fn brick_of(cell: vec3f) -> vec3i {
  let parts = camera.eye.w;
  let coarse = vec3i(floor((cell - 0.5) / parts)) + smoke.lower;
  return clamp(coarse, smoke.lower, smoke.upper - 1) >> vec3u(3);
}

fn is_stored(brick: vec3i) -> bool {
  let at = brick - smoke.first;
  if (any(at < vec3i(0)) || any(at >= smoke.span)) {
    return false;
  }
  return word_at(u32((at.x * smoke.span.y + at.y) * smoke.span.z + at.z)) != NONE;
}

// The depth at which a ray leaves a brick.
fn leaving(brick: vec3i, way: vec3f) -> f32 {
  let low = vec3f(8 * brick - smoke.lower) * camera.eye.w + 0.5;
  let far = select(low, low + 8.0 * camera.eye.w, way > vec3f(0.0));
  let depth = (far - camera.eye.xyz) / way;
  return min(depth.x, min(depth.y, depth.z));
}

@fragment
fn march(@location(0) place: vec2f) -> @location(0) vec4f {
  let ray = camera.middle.xyz + place.x * camera.right.w * camera.right.xyz + place.y * camera.up.xyz;
  let step = camera.middle.w;
  // Lengths are those of a cell; what is drawn has cubic cells.
  let way = normalize(ray);
  let a = (vec3f(-0.5) - camera.eye.xyz) / way;
  let b = (camera.size.xyz - 0.5 - camera.eye.xyz) / way;
  let near = max(max(min(a.x, b.x), max(min(a.y, b.y), min(a.z, b.z))), 0.0);
  let far = min(max(a.x, b.x), min(max(a.y, b.y), max(a.z, b.z)));
  let first = ceil(near / step);
  let last = floor(far / step);
  var colour = vec3f(0.0);
  var seen = 0.0;
  for (var k = first; k <= last; k += 1.0) {
    let cell = camera.eye.xyz + k * step * way;
    let brick = brick_of(cell);
    if (!is_stored(brick)) {
      k = max(k, ceil(leaving(brick, way) / step) - 1.0);
      continue;
    }
    let value = textureSampleLevel(drawn, between, (cell + 0.5) / camera.size.xyz, 0.0);
    if (value.w <= 0.0) {
      continue;
    }
    let weight = (1.0 - seen) * (1.0 - exp(-camera.up.w * value.w));
    var hue = value.xyz / value.w;
    if (camera.light.y > 0.0) {
      hue *= lit(cell);
    }
    colour += weight * hue;
    seen += weight;
    if (seen > 0.9995) {
      break;
    }
  }
  return vec4f(colour, seen);
}
