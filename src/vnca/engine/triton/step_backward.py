"""The Triton kernels of a step's gradient; see this folder's README.

No program adds to memory that another adds to, so results are the same bits in every run: programs
sum the gradients of the weights each for itself, and cells collect the gradient of the state from
the cells that perceived them.
"""

# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false

import triton
import triton.language as tl

from vnca.engine.triton.step_forward import (
    filter_weight,
    hidden_inputs,
    hidden_layer,
    hidden_weights,
    output_weights,
)


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
