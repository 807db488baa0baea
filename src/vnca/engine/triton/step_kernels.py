"""The Triton kernels of a step: its mask, and the new state.

Triton works on blocks whose sides are powers of two. Channels, priors and hidden units are padded
to them: what is beyond is loaded as zero and never stored. The inputs of the hidden layer are six
blocks, one for each filter and one for the priors; W1 is cut alike.

No program adds to memory that another adds to, so results are the same bits in every run: programs
sum the gradients of the weights each for itself, and cells collect the gradient of the state from
the cells that perceived them.
"""

import torch
import triton
import triton.language as tl
from torch import Tensor

from vnca.engine.automaton import mask_key, mask_threshold, stencil

# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false


FORMS = tuple(map(tuple, stencil(sobel_divisor=1, laplacian_divisor=1).astype(int).tolist()))
"""The filters `[5, 27]` before their scales, whole numbers."""
BLOCK = 1024

# Triton 3.4, which comes with torch 2.8, keeps it in its language.
constexpr_function = getattr(triton, "constexpr_function", None) or vars(tl)["constexpr_function"]


@constexpr_function
def filter_weight(number, offset):
    """Weight of a filter at an offset; a number that is known when a kernel is compiled."""
    return FORMS[number][offset]


@triton.jit
def perceive(state, neighbours, cells, rows, inside, scales, C: tl.constexpr, WIDTH: tl.constexpr):
    """State, gradient along x, y and z, and Laplacian of a tile of cells, each `[TILE, WIDTH]`.

    The filters are whole numbers, known when the kernel is compiled; the result is multiplied by
    `scales`. Offsets are added up in 32 bits, here and below, before there is a pointer: pointers
    to 27 lines of the table would fill registers all through the kernel.
    """
    channels = tl.arange(0, WIDTH)[None, :]
    wanted = inside[:, None] & (channels < C)
    own = tl.zeros([rows.shape[0], WIDTH], tl.float32)
    x, y, z, laplacian = own, own, own, own
    for offset in tl.static_range(27):
        around = tl.load(neighbours + (rows + offset * cells), mask=inside, other=0)
        s = tl.load(state + (around[:, None] * C + channels), mask=wanted, other=0).to(tl.float32)
        if filter_weight(0, offset) != 0:
            own = s
        if filter_weight(1, offset) != 0:
            x += filter_weight(1, offset) * s
        if filter_weight(2, offset) != 0:
            y += filter_weight(2, offset) * s
        if filter_weight(3, offset) != 0:
            z += filter_weight(3, offset) * s
        laplacian += filter_weight(4, offset) * s
    return own * scales[0], x * scales[1], y * scales[2], z * scales[3], laplacian * scales[4]


@triton.jit
def prior_block(priors, rows, inside, P: tl.constexpr, PRIOR_WIDTH: tl.constexpr):
    """The priors of a tile of cells `[TILE, PRIOR_WIDTH]`, and behind them a column of ones."""
    columns = tl.arange(0, PRIOR_WIDTH)[None, :]
    wanted = inside[:, None] & (columns < P)
    p = tl.load(priors + (rows[:, None] * P + columns), mask=wanted, other=0).to(tl.float32)
    return tl.where(inside[:, None] & (columns == P), 1.0, p)


@triton.jit
def hidden_inputs(
    state,
    neighbours,
    priors,
    cells,
    rows,
    inside,
    scales,
    C: tl.constexpr,
    P: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
):
    """What the hidden layer of a tile of cells sees, in six blocks of the state's type.

    After the priors comes a column of ones: W1 is taken as zero there, and its gradient is that of
    b1.
    """
    own, x, y, z, laplacian = perceive(state, neighbours, cells, rows, inside, scales, C, WIDTH)
    p = prior_block(priors, rows, inside, P, PRIOR_WIDTH)
    kind: tl.constexpr = state.dtype.element_ty
    return own.to(kind), x.to(kind), y.to(kind), z.to(kind), laplacian.to(kind), p.to(kind)


@triton.jit
def _columns(hidden, units, first, count, H, INPUTS: tl.constexpr, WIDTH: tl.constexpr):
    inputs = tl.arange(0, WIDTH)[:, None]
    wanted = (inputs < count) & (units < H)[None, :]
    return tl.load(hidden + (units[None, :] * INPUTS + first + inputs), mask=wanted, other=0)


@triton.jit
def hidden_block(
    hidden,
    units,
    number,
    block: tl.constexpr,
    C: tl.constexpr,
    P: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
):
    """W1ᵀ of some hidden units, for one of the six blocks of their inputs: `[WIDTH, UNITS]`."""
    inputs: tl.constexpr = 5 * C + P
    if block < 5:
        part = _columns(hidden, units, block * C, C, H, inputs, WIDTH)
    else:
        part = _columns(hidden, units, 5 * C, P, H, inputs, PRIOR_WIDTH)
    return part.to(number)


@triton.jit
def output_weights(output, units, number, C: tl.constexpr, H: tl.constexpr, WIDTH: tl.constexpr):
    """W2ᵀ `[UNITS, WIDTH]` of some hidden units."""
    channels = tl.arange(0, WIDTH)[None, :]
    wanted = (units < H)[:, None] & (channels < C)
    return tl.load(output + (channels * H + units[:, None]), mask=wanted, other=0).to(number)


@triton.jit
def hidden_layer(
    z,
    hidden,
    bias,
    units,
    number,
    C: tl.constexpr,
    P: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
    TILE: tl.constexpr,
    PRECISION: tl.constexpr,
):
    """W1 [z ‖ priors] + b1 `[TILE, UNITS]`, before what is negative becomes zero.

    Weights come from cache when they are multiplied. Barriers keep the compiler from fetching
    those of later products beforehand, for which there are not enough registers.
    """
    b = tl.load(bias + units, mask=units < H, other=0).to(tl.float32)
    h = tl.zeros([TILE, units.shape[0]], tl.float32) + b[None, :]
    for block in tl.static_range(6):
        first = hidden_block(hidden, units, number, block, C, P, H, WIDTH, PRIOR_WIDTH)
        h = tl.dot(z[block], first, h, input_precision=PRECISION)
        tl.debug_barrier()
    return h


@triton.jit
def _copy_cells(state, out, rows, tile, changing, cells, C: tl.constexpr, TILE: tl.constexpr):
    """Copy the cells from the first of this tile's rows to the first of the next tile's."""
    begin = tl.where(tile == 0, 0, tl.load(rows + tile * TILE))
    following = (tile + 1) * TILE
    end = tl.load(rows + following, mask=following < changing, other=cells + 1)
    for start in range(begin * C, end * C, 16 * TILE):
        at = start + tl.arange(0, 16 * TILE)
        tl.store(out + at, tl.load(state + at, mask=at < end * C), mask=at < end * C)


# Sizes that differ from step to step or frame to frame must not compile the kernel anew.
@triton.jit(do_not_specialize=["cells", "changing"])
def forward_kernel(
    state,
    rows,
    neighbours,
    priors,
    hidden,
    bias,
    output,
    out,
    cells,
    changing,
    scales,
    C: tl.constexpr,
    P: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
    UNITS: tl.constexpr,
    TILE: tl.constexpr,
    PRECISION: tl.constexpr,
):
    """The new state: state + W2 relu(W1 [z ‖ priors] + b1) on `rows`, state elsewhere.

    Programs take tiles of `rows` in turns. What a tile perceives is kept while the hidden units are
    gone through, UNITS at a time: their weights come from cache, which holds them all.
    """
    number: tl.constexpr = state.dtype.element_ty
    channels = tl.arange(0, WIDTH)[None, :]
    for tile in range(tl.program_id(0), tl.cdiv(changing, TILE), tl.num_programs(0)):
        _copy_cells(state, out, rows, tile, changing, cells, C, TILE)
        at = tile * TILE + tl.arange(0, TILE)
        inside = at < changing
        cell = tl.load(rows + at, mask=inside, other=0)
        z = hidden_inputs(
            state, neighbours, priors, cells, cell, inside, scales, C, P, WIDTH, PRIOR_WIDTH
        )
        change = tl.zeros([TILE, WIDTH], tl.float32)
        for portion in range(0, H, UNITS):
            units = portion + tl.arange(0, UNITS)
            h = hidden_layer(
                z, hidden, bias, units, number, C, P, H, WIDTH, PRIOR_WIDTH, TILE, PRECISION
            )
            second = output_weights(output, units, number, C, H, WIDTH)
            h = tl.where(h < 0, 0.0, h).to(number)  # not a maximum: a NaN stays visible
            change = tl.dot(h, second, change, input_precision=PRECISION)
        at = cell[:, None] * C + channels
        wanted = inside[:, None] & (channels < C)
        before = tl.load(state + at, mask=wanted, other=0).to(tl.float32)
        tl.debug_barrier()  # other threads of this program have copied what is written below
        tl.store(out + at, (before + change).to(number), mask=wanted)


@triton.jit(do_not_specialize=["cells", "key", "threshold"])
def _mask_kernel(hashes, changes, cells, key, threshold, BLOCK: tl.constexpr):
    at = tl.program_id(0) * BLOCK + tl.arange(0, BLOCK)
    value = tl.load(hashes + at, mask=at < cells, other=0).to(tl.uint32, bitcast=True)
    value ^= key.to(tl.uint32)
    value ^= value >> 16
    value *= 0x7FEB352D
    value ^= value >> 15
    value *= 0x846CA68B
    value ^= value >> 16
    tl.store(changes + at, value < threshold.to(tl.uint32), mask=at < cells)


def changing_rows(hashes: Tensor, *, seed: int, step: int, probability: float) -> Tensor:
    """Rows `[m]` of the cells that change, as `vnca.engine.automaton.changing_rows` draws them.

    Waits for the GPU: how many rows there are is known only then.

    Args:
        hashes: `[n]`, the bits of `hash_cells` as int32.
        seed: Any integer; its low 32 bits count.
        step: Steps since the state was seeded.
        probability: Chance of a cell to change, in (0, 1].
    """
    n = len(hashes)
    if probability >= 1 or n == 0:
        return torch.arange(n, dtype=torch.int32, device=hashes.device)
    changes = torch.empty(n, dtype=torch.bool, device=hashes.device)
    key, threshold = int(mask_key(seed, step)), int(mask_threshold(probability))
    with torch.cuda.device_of(hashes):
        _mask_kernel[(triton.cdiv(n, BLOCK),)](
            hashes, changes, n, key, threshold, BLOCK, num_stages=1, enable_fp_fusion=True
        )
    return changes.nonzero().squeeze(1).int()
