// One step: s' = s + m · W2 relu(W1 [perception ‖ priors ‖ 1]), the bias being W1's last column.
//
// A row of the state is PLANES vectors of four channels; of what cells are told, TOLD vectors, whose
// last number is the 1. A group of threads draws the mask for some cells and then shares those that
// change among its threads: the others cost nothing but a copy. `state_at` reads the states of all
// cells; `told` and `next` are those of the batch.

struct Step {
  key: u32,         // What hashes are combined with in this step.
  threshold: u32,   // The hash from which a cell does not change.
  always: u32,      // 1 where all cells change.
  unused: u32,
}

const THREADS = 64u;
const CELLS_OF_GROUP = 256u;
const FILTERS = 5u;
const INPUTS = FILTERS * PLANES + TOLD;
const OF_UNIT = INPUTS + PLANES;

@group(0) @binding(2) var<uniform> now: Step;
@group(0) @binding(3) var<uniform> stencil: array<vec4f, 54>;  // By neighbour: four filters; the fifth.
@group(0) @binding(4) var<storage, read> weights: array<vec4<Factor>>;  // By unit: of W1, of W2.
@group(0) @binding(5) var<storage, read> told: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> next: array<vec4f>;

var<workgroup> changing: array<u32, CELLS_OF_GROUP>;
var<workgroup> found: atomic<u32>;

// Wellons' lowbias32, as in `engine/automaton.py`.
fn mix_bits(given: u32) -> u32 {
  var value = given;
  value ^= value >> 16u;
  value *= 0x7feb352du;
  value ^= value >> 15u;
  value *= 0x846ca68bu;
  value ^= value >> 16u;
  return value;
}

fn changes(row: u32) -> bool {
  if (now.always == 1u) {
    return true;
  }
  let cell = vec3u(cell_of(row));
  let hash = mix_bits(cell.x + mix_bits(cell.y + mix_bits(cell.z)));
  return mix_bits(hash ^ now.key) < now.threshold;
}

fn update(row: u32) {
  var inputs: array<vec4<Factor>, INPUTS>;
  var perceived: array<vec4f, FILTERS * PLANES>;
  let cell = cell_of(row);
  for (var k = 0u; k < 27u; k++) {
    let offset = vec3i(vec3u(k / 9u, (k / 3u) % 3u, k % 3u)) - 1;
    let beside = row_of(bordered(cell + offset));
    if (beside >= sites.cells) {
      continue;  // The outside is zero.
    }
    let four = stencil[2u * k];
    let fifth = stencil[2u * k + 1u].x;
    for (var p = 0u; p < PLANES; p++) {
      let seen = state_at(beside, p);
      perceived[p] += four.x * seen;
      perceived[PLANES + p] += four.y * seen;
      perceived[2u * PLANES + p] += four.z * seen;
      perceived[3u * PLANES + p] += four.w * seen;
      perceived[4u * PLANES + p] += fifth * seen;
    }
  }
  for (var i = 0u; i < FILTERS * PLANES; i++) {
    inputs[i] = vec4<Factor>(perceived[i]);
  }
  for (var i = 0u; i < TOLD; i++) {
    inputs[FILTERS * PLANES + i] = vec4<Factor>(told[(row - batch.first) * TOLD + i]);
  }
  var change: array<vec4f, PLANES>;
  for (var unit = 0u; unit < HIDDEN; unit++) {
    let first = unit * OF_UNIT;
    var sum = 0.0;
    for (var i = 0u; i < INPUTS; i++) {
      sum += f32(dot(inputs[i], weights[first + i]));
    }
    if (sum > 0.0) {
      let hidden = Factor(sum);
      for (var p = 0u; p < PLANES; p++) {
        change[p] += vec4f(hidden * weights[first + INPUTS + p]);
      }
    }
  }
  for (var p = 0u; p < PLANES; p++) {
    next[(row - batch.first) * PLANES + p] = state_at(row, p) + change[p];
  }
}

@compute @workgroup_size(THREADS)
fn step(
  @builtin(workgroup_id) group: vec3u,
  @builtin(num_workgroups) groups: vec3u,
  @builtin(local_invocation_index) thread: u32,
) {
  // The language zeroes it; Mesa 22's software driver does not.
  if (thread == 0u) {
    atomicStore(&found, 0u);
  }
  workgroupBarrier();
  let first = (group.y * groups.x + group.x) * CELLS_OF_GROUP;
  for (var at = thread; at < CELLS_OF_GROUP; at += THREADS) {
    if (first + at >= batch.rows) {
      continue;
    }
    let row = batch.first + first + at;
    if (changes(row)) {
      changing[atomicAdd(&found, 1u)] = row;
    } else {
      for (var p = 0u; p < PLANES; p++) {
        next[(row - batch.first) * PLANES + p] = state_at(row, p);
      }
    }
  }
  workgroupBarrier();
  let count = atomicLoad(&found);
  for (var at = thread; at < count; at += THREADS) {
    update(changing[at]);
  }
}
