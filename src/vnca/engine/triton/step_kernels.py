"""The Triton kernels of a step: its mask, the new state, and the gradients.

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


@triton.constexpr_function
def filter_weight(number, offset):
    """Weight of a filter at an offset; a number that is known when a kernel is compiled."""
    return FORMS[number][offset]


@triton.jit
def perceive(state, neighbours, cells, rows, inside, scales, C: tl.constexpr, WIDTH: tl.constexpr):
    """State, gradient along x, y and z, and Laplacian of a tile of cells, each `[TILE, WIDTH]`.

    The filters are whole numbers, known when the kernel is compiled; the result is multiplied by
    `scales`.
    """
    channels = tl.arange(0, WIDTH)[None, :]
    wanted = inside[:, None] & (channels < C)
    own = tl.zeros([rows.shape[0], WIDTH], tl.float32)
    x, y, z, laplacian = own, own, own, own
    for offset in tl.static_range(27):
        around = tl.load(neighbours + offset * cells + rows, mask=inside, other=0)
        s = tl.load(state + around[:, None] * C + channels, mask=wanted, other=0).to(tl.float32)
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

    After the priors comes a column of ones: W1 is zero there, and its gradient is that of b1.
    """
    own, x, y, z, laplacian = perceive(state, neighbours, cells, rows, inside, scales, C, WIDTH)
    columns = tl.arange(0, PRIOR_WIDTH)[None, :]
    wanted = inside[:, None] & (columns < P)
    p = tl.load(priors + rows[:, None] * P + columns, mask=wanted, other=0).to(tl.float32)
    p = tl.where(inside[:, None] & (columns == P), 1.0, p)
    kind: tl.constexpr = state.dtype.element_ty
    return own.to(kind), x.to(kind), y.to(kind), z.to(kind), laplacian.to(kind), p.to(kind)


@triton.jit
def _columns(hidden, units, first, count, H, INPUTS: tl.constexpr, WIDTH: tl.constexpr):
    inputs = tl.arange(0, WIDTH)[:, None]
    wanted = (inputs < count) & (units < H)[None, :]
    return tl.load(hidden + units[None, :] * INPUTS + first + inputs, mask=wanted, other=0)


@triton.jit
def hidden_weights(
    hidden,
    units,
    number: tl.constexpr,
    C: tl.constexpr,
    P: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
):
    """W1ᵀ of some hidden units, in six blocks `[WIDTH, UNITS]`."""
    inputs: tl.constexpr = 5 * C + P
    return (
        _columns(hidden, units, 0, C, H, inputs, WIDTH).to(number),
        _columns(hidden, units, C, C, H, inputs, WIDTH).to(number),
        _columns(hidden, units, 2 * C, C, H, inputs, WIDTH).to(number),
        _columns(hidden, units, 3 * C, C, H, inputs, WIDTH).to(number),
        _columns(hidden, units, 4 * C, C, H, inputs, WIDTH).to(number),
        _columns(hidden, units, 5 * C, P, H, inputs, PRIOR_WIDTH).to(number),
    )


@triton.jit
def output_weights(output, units, number, C: tl.constexpr, H: tl.constexpr, WIDTH: tl.constexpr):
    """W2ᵀ `[UNITS, WIDTH]` of some hidden units."""
    channels = tl.arange(0, WIDTH)[None, :]
    wanted = (units < H)[:, None] & (channels < C)
    return tl.load(output + channels * H + units[:, None], mask=wanted, other=0).to(number)


@triton.jit
def hidden_layer(z, first, bias, TILE: tl.constexpr, PRECISION: tl.constexpr):
    """W1 [z ‖ priors] + b1 `[TILE, UNITS]`, before what is negative becomes zero."""
    h = tl.zeros([TILE, bias.shape[0]], tl.float32) + bias[None, :]
    for block in tl.static_range(6):
        h = tl.dot(z[block], first[block], h, input_precision=PRECISION)
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

    Programs take tiles of `rows` in turns and keep the weights of UNITS hidden units meanwhile;
    if there are more units, their part is added afterwards.
    """
    number: tl.constexpr = state.dtype.element_ty
    channels = tl.arange(0, WIDTH)[None, :]
    for portion in range(0, H, UNITS):
        units = portion + tl.arange(0, UNITS)
        first = hidden_weights(hidden, units, number, C, P, H, WIDTH, PRIOR_WIDTH)
        b = tl.load(bias + units, mask=units < H, other=0).to(tl.float32)
        second = output_weights(output, units, number, C, H, WIDTH)

        for tile in range(tl.program_id(0), tl.cdiv(changing, TILE), tl.num_programs(0)):
            if portion == 0:
                _copy_cells(state, out, rows, tile, changing, cells, C, TILE)
            tl.debug_barrier()  # other threads of this program have written what is read below
            at = tile * TILE + tl.arange(0, TILE)
            inside = at < changing
            cell = tl.load(rows + at, mask=inside, other=0)
            z = hidden_inputs(
                state, neighbours, priors, cells, cell, inside, scales, C, P, WIDTH, PRIOR_WIDTH
            )
            h = hidden_layer(z, first, b, TILE, PRECISION)
            h = tl.where(h < 0, 0.0, h).to(number)  # not a maximum: a NaN stays visible
            change = tl.dot(h, second, input_precision=PRECISION)
            to = out + cell[:, None] * C + channels
            wanted = inside[:, None] & (channels < C)
            before = tl.load(to, mask=wanted, other=0).to(tl.float32)
            tl.store(to, (before + change).to(number), mask=wanted)


# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false


@triton.jit
def _add_products(z, to_h, sums, PRECISION: tl.constexpr):
    """Each block of z, transposed, times the gradient of the hidden layer, added to `sums`."""
    return (
        tl.dot(tl.trans(z[0]), to_h, sums[0], input_precision=PRECISION),
        tl.dot(tl.trans(z[1]), to_h, sums[1], input_precision=PRECISION),
        tl.dot(tl.trans(z[2]), to_h, sums[2], input_precision=PRECISION),
        tl.dot(tl.trans(z[3]), to_h, sums[3], input_precision=PRECISION),
        tl.dot(tl.trans(z[4]), to_h, sums[4], input_precision=PRECISION),
        tl.dot(tl.trans(z[5]), to_h, sums[5], input_precision=PRECISION),
    )


@triton.jit
def _store_lines(to, first, count, units, values, H: tl.constexpr):
    """Store `count` lines of `values` `[WIDTH, UNITS]` from line `first` of `to` `[lines, H]`."""
    lines = tl.arange(0, values.shape[0])[:, None]
    wanted = (lines < count) & (units < H)[None, :]
    tl.store(to + (first + lines) * H + units[None, :], values, mask=wanted)


# Sizes that differ from step to step or frame to frame must not compile the kernels anew.
@triton.jit(do_not_specialize=["cells", "changing"])
def weights_kernel(
    state,
    rows,
    neighbours,
    priors,
    hidden,
    bias,
    output,
    gradient,
    to_perceived,
    place,
    partials,
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
    """Gradients of the weights, and of what the changing cells perceived.

    Writes a program's sums to `partials` `[programs, 5C + P + 1 + C, H]` (W1ᵀ, b1, W2), the
    gradient of z before its scales to `to_perceived` `[m, 5C]`, and to `place` `[n]` where in
    `rows` a changing cell is.
    """
    number: tl.constexpr = state.dtype.element_ty
    channels = tl.arange(0, WIDTH)[None, :]
    partial = partials + tl.program_id(0) * (6 * C + P + 1) * H
    for portion in range(0, H, UNITS):
        units = portion + tl.arange(0, UNITS)
        first = hidden_weights(hidden, units, number, C, P, H, WIDTH, PRIOR_WIDTH)
        b = tl.load(bias + units, mask=units < H, other=0).to(tl.float32)
        second = output_weights(output, units, number, C, H, WIDTH)
        zeros = tl.zeros([WIDTH, UNITS], tl.float32)
        sums = (zeros, zeros, zeros, zeros, zeros, tl.zeros([PRIOR_WIDTH, UNITS], tl.float32))
        sum_second = zeros
        tl.debug_barrier()  # other threads may have written what is added to below

        for tile in range(tl.program_id(0), tl.cdiv(changing, TILE), tl.num_programs(0)):
            at = tile * TILE + tl.arange(0, TILE)
            inside = at < changing
            wanted = inside[:, None] & (channels < C)
            cell = tl.load(rows + at, mask=inside, other=0)
            tl.store(place + cell, at, mask=inside)
            g = tl.load(gradient + cell[:, None] * C + channels, mask=wanted, other=0)
            z = hidden_inputs(
                state, neighbours, priors, cells, cell, inside, scales, C, P, WIDTH, PRIOR_WIDTH
            )
            h = hidden_layer(z, first, b, TILE, PRECISION)
            to_h = tl.dot(g, tl.trans(second), input_precision=PRECISION)
            to_h = tl.where(h <= 0, 0.0, to_h).to(number)
            h = tl.where(h < 0, 0.0, h).to(number)
            sum_second = tl.dot(tl.trans(g), h, sum_second, input_precision=PRECISION)
            sums = _add_products(z, to_h, sums, PRECISION)
            for block in tl.static_range(5):
                to_z = tl.dot(to_h, tl.trans(first[block]), input_precision=PRECISION)
                to_z *= scales[block]
                to = to_perceived + at[:, None] * (5 * C) + block * C + channels
                if portion > 0:
                    to_z += tl.load(to, mask=wanted, other=0).to(tl.float32)
                tl.store(to, to_z.to(number), mask=wanted)

        for block in tl.static_range(5):
            _store_lines(partial, block * C, C, units, sums[block], H)
        _store_lines(partial, 5 * C, P + 1, units, sums[5], H)
        _store_lines(partial, 5 * C + P + 1, C, units, sum_second, H)


@triton.jit(do_not_specialize=["cells", "pairs"])
def state_kernel(
    gradient,
    to_perceived,
    place,
    neighbours,
    mutual,
    begin,
    source,
    weights,
    to_state,
    cells,
    pairs,
    C: tl.constexpr,
    WIDTH: tl.constexpr,
    TILE: tl.constexpr,
):
    """Gradient of the state: each cell collects from the cells that perceived it.

    `to_perceived` and `place` are those of `weights_kernel`, -1 where a cell did not change; the
    arrays from `mutual` to `weights` are those of `Perceivers`.
    """
    channels = tl.arange(0, WIDTH)[None, :]
    cell = tl.program_id(0) * TILE + tl.arange(0, TILE)
    inside = cell < cells
    at = cell[:, None] * C + channels
    total = tl.load(gradient + at, mask=inside[:, None] & (channels < C), other=0).to(tl.float32)

    bits = tl.load(mutual + cell, mask=inside, other=0)
    for offset in tl.static_range(27):
        counts = ((bits >> offset) & 1) == 1
        other = tl.load(neighbours + (26 - offset) * cells + cell, mask=counts, other=0)
        spot = tl.load(place + other, mask=counts, other=-1)[:, None]
        given = (spot >= 0) & (channels < C)
        z = to_perceived + spot * (5 * C) + channels
        for block in tl.static_range(5):
            if filter_weight(block, offset) != 0:
                values = tl.load(z + block * C, mask=given, other=0).to(tl.float32)
                total += filter_weight(block, offset) * values

    first = tl.load(begin + cell, mask=inside, other=0)
    last = tl.load(begin + cell + 1, mask=inside, other=0)
    for k in range(tl.max(last - first)):
        pair = first + k
        counts = pair < last
        other = tl.load(source + pair, mask=counts, other=0)
        spot = tl.load(place + other, mask=counts, other=-1)[:, None]
        given = (spot >= 0) & (channels < C)
        z = to_perceived + spot * (5 * C) + channels
        for block in tl.static_range(5):
            weight = tl.load(weights + block * pairs + pair, mask=counts, other=0)[:, None]
            total += weight * tl.load(z + block * C, mask=given, other=0).to(tl.float32)

    total = tl.where(inside[:, None], total, 0.0)  # the outside, row n, is a constant
    tl.store(to_state + at, total, mask=(cell <= cells)[:, None] & (channels < C))


# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false


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
        _mask_kernel[(triton.cdiv(n, BLOCK),)](hashes, changes, n, key, threshold, BLOCK)
    return changes.nonzero().squeeze(1).int()
