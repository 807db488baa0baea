// What is seen of a state between cells: its first four channels and what three sine layers add.
//
// out = s[:4] + W4 h3 + b4, h_k = sin(W_k h_(k-1) + b_k), h_0 = s; see `engine/DECODE.md`. UNITS4 is a
// quarter of the units of a layer. Behind each other lie, as vectors of four: W1, b1, W2, b2, W3, b3,
// W4, b4. With UNITS4 0 there is no decoder.

@group(1) @binding(0) var<storage, read> decoder: array<vec4f>;

// sin: the languages promise no more than three digits of it, and only near zero. Reduced by
// multiples of π in two parts, then a polynomial: 2e-7 up to arguments of some thousands.
fn sine(angle: vec4f) -> vec4f {
  let turns = round(angle * 0.318309886);
  let rest = (angle - turns * 3.140625) - turns * 9.67653589793e-4;
  let square = rest * rest;
  let series = 1.0 + square * (-1.66666667e-1 + square * (8.33333310e-3
    + square * (-1.98408744e-4 + square * (2.75255616e-6 - square * 2.38843770e-8))));
  let even = 1.0 - 2.0 * abs(turns - 2.0 * floor(0.5 * turns));
  return rest * series * even;
}

fn seen_of(between: array<vec4f, PLANES>) -> vec4f {
  if (UNITS4 == 0u) {
    return between[0];
  }
  var state = between;
  var below: array<vec4f, max(UNITS4, 1u)>;
  var above: array<vec4f, max(UNITS4, 1u)>;
  var at = 0u;
  for (var unit = 0u; unit < UNITS4; unit++) {
    var sum = decoder[4u * UNITS4 * PLANES + unit];
    for (var p = 0u; p < PLANES; p++) {
      let start = 4u * unit * PLANES + p;
      let values = state[p];
      sum += vec4f(
        dot(values, decoder[start]), dot(values, decoder[start + PLANES]),
        dot(values, decoder[start + 2u * PLANES]), dot(values, decoder[start + 3u * PLANES]),
      );
    }
    below[unit] = sine(sum);
  }
  at = 4u * UNITS4 * PLANES + UNITS4;
  for (var layer = 0u; layer < 2u; layer++) {
    for (var unit = 0u; unit < UNITS4; unit++) {
      var sum = decoder[at + 4u * UNITS4 * UNITS4 + unit];
      for (var k = 0u; k < UNITS4; k++) {
        let start = at + 4u * unit * UNITS4 + k;
        let values = below[k];
        sum += vec4f(
          dot(values, decoder[start]), dot(values, decoder[start + UNITS4]),
          dot(values, decoder[start + 2u * UNITS4]), dot(values, decoder[start + 3u * UNITS4]),
        );
      }
      above[unit] = sine(sum);
    }
    below = above;
    at += 4u * UNITS4 * UNITS4 + UNITS4;
  }
  var result = state[0] + decoder[at + 4u * UNITS4];
  for (var k = 0u; k < UNITS4; k++) {
    let values = below[k];
    result += vec4f(
      dot(values, decoder[at + k]), dot(values, decoder[at + UNITS4 + k]),
      dot(values, decoder[at + 2u * UNITS4 + k]), dot(values, decoder[at + 3u * UNITS4 + k]),
    );
  }
  return result;
}
