"""The Triton kernels of a step's gradients; those of the step itself are in `step_kernels.py`."""

# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false

import triton
import triton.language as tl

from vnca.engine.triton.step_kernels import (
    filter_weight,
    hidden_block,
    output_weights,
    perceive,
    prior_block,
)


# Sizes that differ from step to step or frame to frame must not compile the kernels anew.
@triton.jit(do_not_specialize=["cells", "changing"])
def perceive_kernel(
    state,
    rows,
    neighbours,
    perceived,
    cells,
    changing,
    scales,
    C: tl.constexpr,
    WIDTH: tl.constexpr,
    TILE: tl.constexpr,
):
    """What the changing cells perceive, `[m, 5C]`, for `weights_kernel`."""
    number: tl.constexpr = state.dtype.element_ty
    channels = tl.arange(0, WIDTH)[None, :]
    at = tl.program_id(0) * TILE + tl.arange(0, TILE)
    inside = at < changing
    cell = tl.load(rows + at, mask=inside, other=0)
    z = perceive(state, neighbours, cells, cell, inside, scales, C, WIDTH)
    for block in tl.static_range(5):
        to = perceived + (at[:, None] * (5 * C) + block * C + channels)
        tl.store(to, z[block].to(number), mask=inside[:, None] & (channels < C))


@triton.jit
def _kept_block(
    perceived,
    priors,
    at,
    rows,
    inside,
    number,
    block: tl.constexpr,
    C: tl.constexpr,
    P: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
):
    """One of the six blocks of `hidden_inputs`, from what `perceive_kernel` wrote."""
    if block < 5:
        channels = tl.arange(0, WIDTH)[None, :]
        wanted = inside[:, None] & (channels < C)
        of = perceived + (at[:, None] * (5 * C) + block * C + channels)
        z = tl.load(of, mask=wanted, other=0)
    else:
        z = prior_block(priors, rows, inside, P, PRIOR_WIDTH)
    return z.to(number)


@triton.jit
def _add_product(
    kept,
    to_h,
    total,
    number,
    block: tl.constexpr,
    C: tl.constexpr,
    P: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
    PRECISION: tl.constexpr,
):
    z = _kept_block(
        kept[0], kept[1], kept[2], kept[3], kept[4], number, block, C, P, WIDTH, PRIOR_WIDTH
    )
    total = tl.dot(tl.trans(to_h), z, total, input_precision=PRECISION)
    tl.debug_barrier()  # see `hidden_layer`
    return total


@triton.jit
def _add_products(
    kept,
    to_h,
    sums,
    number,
    C: tl.constexpr,
    P: tl.constexpr,
    WIDTH: tl.constexpr,
    PRIOR_WIDTH: tl.constexpr,
    PRECISION: tl.constexpr,
):
    """The gradient of the hidden layer, transposed, times each block of what was kept, added.

    As `[UNITS, WIDTH]`, and not the other way round: warps share out the rows of a product, sixteen
    at a time, and where there are no more all of them hold the same.
    """
    return (
        _add_product(kept, to_h, sums[0], number, 0, C, P, WIDTH, PRIOR_WIDTH, PRECISION),
        _add_product(kept, to_h, sums[1], number, 1, C, P, WIDTH, PRIOR_WIDTH, PRECISION),
        _add_product(kept, to_h, sums[2], number, 2, C, P, WIDTH, PRIOR_WIDTH, PRECISION),
        _add_product(kept, to_h, sums[3], number, 3, C, P, WIDTH, PRIOR_WIDTH, PRECISION),
        _add_product(kept, to_h, sums[4], number, 4, C, P, WIDTH, PRIOR_WIDTH, PRECISION),
        _add_product(kept, to_h, sums[5], number, 5, C, P, WIDTH, PRIOR_WIDTH, PRECISION),
    )


@triton.jit
def _store_lines(to, first, count, units, values, H: tl.constexpr):
    """Store `values` `[UNITS, WIDTH]`, transposed, as `count` lines from line `first` of `to`."""
    lines = tl.arange(0, values.shape[1])[None, :]
    wanted = (lines < count) & (units < H)[:, None]
    tl.store(to + ((first + lines) * H + units[:, None]), values, mask=wanted)


# Sizes that differ from step to step or frame to frame must not compile the kernels anew.
@triton.jit(do_not_specialize=["changing", "portion"])
def weights_kernel(
    perceived,
    rows,
    priors,
    hidden,
    bias,
    output,
    gradient,
    to_perceived,
    place,
    partials,
    changing,
    portion,
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
    """Gradients of the weights of the hidden units from `portion` on, and of what was perceived.

    It is launched for one portion of UNITS after the other: with a loop over them, too, it takes
    more registers than there are. Writes a program's sums to `partials`
    `[programs, 5C + P + 1 + C, H]` (W1ᵀ, b1, W2); adds to `to_perceived` `[m, 5C]`, zeros at first,
    the gradient of z before its scales; and writes to `place` `[n]` where in `rows` a changing cell
    is.
    """
    number: tl.constexpr = perceived.dtype.element_ty
    channels = tl.arange(0, WIDTH)[None, :]
    partial = partials + tl.program_id(0) * (6 * C + P + 1) * H
    units = portion + tl.arange(0, UNITS)
    zeros = tl.zeros([UNITS, WIDTH], tl.float32)
    sums = (zeros, zeros, zeros, zeros, zeros, tl.zeros([UNITS, PRIOR_WIDTH], tl.float32))
    sum_second = zeros

    for tile in range(tl.program_id(0), tl.cdiv(changing, TILE), tl.num_programs(0)):
        at = tile * TILE + tl.arange(0, TILE)
        inside = at < changing
        wanted = inside[:, None] & (channels < C)
        cell = tl.load(rows + at, mask=inside, other=0)
        tl.store(place + cell, at, mask=inside)
        g = tl.load(gradient + (cell[:, None] * C + channels), mask=wanted, other=0)
        b = tl.load(bias + units, mask=units < H, other=0).to(tl.float32)
        h = tl.zeros([TILE, UNITS], tl.float32) + b[None, :]
        for block in tl.static_range(6):
            z = _kept_block(
                perceived, priors, at, cell, inside, number, block, C, P, WIDTH, PRIOR_WIDTH
            )
            first = hidden_block(hidden, units, number, block, C, P, H, WIDTH, PRIOR_WIDTH)
            h = tl.dot(z, first, h, input_precision=PRECISION)
            tl.debug_barrier()  # see `hidden_layer`
        second = output_weights(output, units, number, C, H, WIDTH)
        to_h = tl.dot(g, tl.trans(second), input_precision=PRECISION)
        to_h = tl.where(h <= 0, 0.0, to_h).to(number)
        h = tl.where(h < 0, 0.0, h).to(number)
        sum_second = tl.dot(tl.trans(h), g, sum_second, input_precision=PRECISION)
        tl.debug_barrier()
        kept = perceived, priors, at, cell, inside
        sums = _add_products(kept, to_h, sums, number, C, P, WIDTH, PRIOR_WIDTH, PRECISION)
        for block in tl.static_range(5):
            first = hidden_block(hidden, units, number, block, C, P, H, WIDTH, PRIOR_WIDTH)
            to_z = tl.dot(to_h, tl.trans(first), input_precision=PRECISION)
            to_z *= scales[block]
            to = to_perceived + (at[:, None] * (5 * C) + block * C + channels)
            to_z += tl.load(to, mask=wanted, other=0).to(tl.float32)
            tl.store(to, to_z.to(number), mask=wanted)
            tl.debug_barrier()

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
        other = tl.load(neighbours + (cell + (26 - offset) * cells), mask=counts, other=0)
        spot = tl.load(place + other, mask=counts, other=-1)[:, None]
        given = (spot >= 0) & (channels < C)
        z = to_perceived + (spot * (5 * C) + channels)
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
        z = to_perceived + (spot * (5 * C) + channels)
        for block in tl.static_range(5):
            weight = tl.load(weights + (block * pairs + pair), mask=counts, other=0)[:, None]
            total += weight * tl.load(z + block * C, mask=given, other=0).to(tl.float32)

    total = tl.where(inside[:, None], total, 0.0)  # the outside, row n, is a constant
    tl.store(to_state + at, total, mask=(cell <= cells)[:, None] & (channels < C))
