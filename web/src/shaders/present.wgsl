// The picture on the screen: in front of the soft background of films, as sRGB.

struct Screen {
  background: vec4f,  // Linear; w: 1 where it is soft.
  exposure: f32,      // What light is multiplied by.
  wipe: f32,          // Where the line between two halves stands, 0 … 1; 2: none.
  size: vec2f,        // Pixels.
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var picture: texture_2d<f32>;
@group(0) @binding(2) var between: sampler;

fn srgb(linear: vec3f) -> vec3f {
  let value = clamp(linear, vec3f(0.0), vec3f(1.0));
  return select(1.055 * pow(value, vec3f(1.0 / 2.4)) - 0.055, 12.92 * value, value <= vec3f(0.0031308));
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
  return vec4f(vec2f(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn present(@builtin(position) at: vec4f) -> @location(0) vec4f {
  let place = at.xy / screen.size;
  let seen = textureSampleLevel(picture, between, place, 0.0);
  var behind = screen.background.xyz;
  if (screen.background.w > 0.0) {
    let away = 2.0 * place - 1.0;
    let weight = cos(3.14159265 * min(sqrt(dot(away, away) / 2.0), 1.0));
    behind *= 1.0 + weight * select(vec3f(0.4), 0.8 * (1.0 - behind), weight > 0.0);
    let noise = fract(52.9829189 * fract(0.06711056 * floor(at.x) + 0.00583715 * floor(at.y))) - 0.5;
    let dithered = clamp(srgb(behind) + noise / 255.0, vec3f(0.0), vec3f(1.0));
    behind = select(
      pow((dithered + 0.055) / 1.055, vec3f(2.4)), dithered / 12.92, dithered <= vec3f(0.04045)
    );
  }
  var colour = srgb(screen.exposure * seen.xyz + (1.0 - seen.w) * behind);
  if (abs(at.x - screen.wipe * screen.size.x) < 1.0) {
    colour = mix(colour, vec3f(1.0), 0.5);
  }
  return vec4f(colour, 1.0);
}
