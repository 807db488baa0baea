"""The Triton kernels of decoding and of its gradient; see this folder's README.

Channels, units and what is seen are padded to powers of two: what is beyond is loaded as zero and
never stored. No program adds to memory that another adds to, so results are the same bits in every
run.
"""

# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false

import triton
import triton.language as tl


@triton.jit
def _reduced(x):
    """Whether q is odd, and r, of x = qπ + r with |r| ≤ π/2.

    π is taken in three parts, the first of 8 and the second of 9 bits; q times them is exact.
    """
    # So far out floats are nearly a period apart: zero. Infinity becomes no number.
    x = tl.where(tl.abs(x) > 1e7, x - x, x)
    q = tl.floor(x * 0.318309886 + 0.5)
    r = ((x - q * 3.140625) - q * 9.670257568359375e-4) - q * 6.278329573e-7
    return (q.to(tl.int32) & 1) == 1, r


# Those of Triton's library have a way for arguments of any size that takes all registers there are.
@triton.jit
def _sine(x):
    """Within 2e-7 up to 10⁵; see DECODE.md."""
    is_odd, r = _reduced(x)
    square = r * r
    odd = square * (2.6000246e-6 * square - 1.98066016e-4)
    odd = square * (square * (odd + 8.3330171e-3) - 0.166666567)
    value = r + r * odd
    return tl.where(is_odd, -value, value)


@triton.jit
def _cosine(x):
    is_odd, r = _reduced(x)
    square = r * r
    even = square * (-2.61935497e-7 * square + 2.47692915e-5)
    even = square * (square * (even - 1.38885691e-3) + 4.16666567e-2) - 0.5
    value = 1 + square * even
    return tl.where(is_odd, -value, value)


@triton.jit
def _share(fractions, point, inside, corner):
    """What a corner, z fastest, counts at some points."""
    x = tl.load(fractions + 3 * point, mask=inside, other=0).to(tl.float32)
    y = tl.load(fractions + (3 * point + 1), mask=inside, other=0).to(tl.float32)
    z = tl.load(fractions + (3 * point + 2), mask=inside, other=0).to(tl.float32)
    x = tl.where((corner & 4) != 0, x, 1 - x)
    y = tl.where((corner & 2) != 0, y, 1 - y)
    z = tl.where((corner & 1) != 0, z, 1 - z)
    return x * y * z


@triton.jit
def _interpolate(state, rows, fractions, points, at, inside, C: tl.constexpr, WIDTH: tl.constexpr):
    """The state `[TILE, WIDTH]` at some points."""
    channels = tl.arange(0, WIDTH)[None, :]
    wanted = inside[:, None] & (channels < C)
    total = tl.zeros([at.shape[0], WIDTH], tl.float32)
    for corner in tl.static_range(8):
        row = tl.load(rows + (corner * points + at), mask=inside, other=0)
        s = tl.load(state + (row[:, None] * C + channels), mask=wanted, other=0).to(tl.float32)
        total += _share(fractions, at, inside, corner)[:, None] * s
    return total


@triton.jit
def _transposed(weights, INPUTS, OUTPUTS, FROM: tl.constexpr, TO: tl.constexpr):
    """Weights `[OUTPUTS, INPUTS]` as `[FROM, TO]`."""
    i = tl.arange(0, FROM)[:, None]
    o = tl.arange(0, TO)[None, :]
    wanted = (i < INPUTS) & (o < OUTPUTS)
    return tl.load(weights + (o * INPUTS + i), mask=wanted, other=0).to(tl.float32)


@triton.jit
def _bias(bias, OUTPUTS, TO: tl.constexpr):
    o = tl.arange(0, TO)
    return tl.load(bias + o, mask=o < OUTPUTS, other=0).to(tl.float32)[None, :]


@triton.jit
def _matrices(
    first,
    second,
    third,
    output,
    C: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    UNITS: tl.constexpr,
):
    """The weights of all layers, transposed."""
    return (
        _transposed(first, C, H, WIDTH, UNITS),
        _transposed(second, H, H, UNITS, UNITS),
        _transposed(third, H, H, UNITS, UNITS),
        _transposed(output, H, 4, UNITS, WIDTH),
    )


@triton.jit
def _hidden_biases(first_bias, second_bias, third_bias, H: tl.constexpr, UNITS: tl.constexpr):
    """Those of the sine layers."""
    return (
        _bias(first_bias, H, UNITS),
        _bias(second_bias, H, UNITS),
        _bias(third_bias, H, UNITS),
    )


# Sizes that differ from call to call must not compile the kernels anew.
@triton.jit(do_not_specialize=["points"])
def forward_kernel(
    state,
    rows,
    fractions,
    first,
    first_bias,
    second,
    second_bias,
    third,
    third_bias,
    output,
    output_bias,
    out,
    points,
    C: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    UNITS: tl.constexpr,
    TILE: tl.constexpr,
    PRECISION: tl.constexpr,
):
    """What is seen `[m, 4]` at points. Programs take tiles of them in turns."""
    w1, w2, w3, w4 = _matrices(first, second, third, output, C, H, WIDTH, UNITS)
    b1, b2, b3 = _hidden_biases(first_bias, second_bias, third_bias, H, UNITS)
    b4 = _bias(output_bias, 4, WIDTH)
    seen = tl.arange(0, WIDTH)[None, :]
    for tile in range(tl.program_id(0), tl.cdiv(points, TILE), tl.num_programs(0)):
        at = tile * TILE + tl.arange(0, TILE)
        inside = at < points
        s = _interpolate(state, rows, fractions, points, at, inside, C, WIDTH)
        h = _sine(tl.dot(s, w1, input_precision=PRECISION) + b1)
        h = _sine(tl.dot(h, w2, input_precision=PRECISION) + b2)
        h = _sine(tl.dot(h, w3, input_precision=PRECISION) + b3)
        h = s + tl.dot(h, w4, input_precision=PRECISION) + b4
        to = out + (at[:, None] * 4 + seen)
        tl.store(to, h.to(out.dtype.element_ty), mask=inside[:, None] & (seen < 4))


@triton.jit
def _store(to, INPUTS, OUTPUTS, values, FROM: tl.constexpr, TO: tl.constexpr):
    """Store `values` `[FROM, TO]` as `[INPUTS, OUTPUTS]`."""
    i = tl.arange(0, FROM)[:, None]
    o = tl.arange(0, TO)[None, :]
    tl.store(to + (i * OUTPUTS + o), values, mask=(i < INPUTS) & (o < OUTPUTS))


@triton.jit
def _store_bias(to, OUTPUTS, values, TO: tl.constexpr):
    o = tl.arange(0, TO)
    tl.store(to + o, values, mask=o < OUTPUTS)


@triton.jit(do_not_specialize=["points"])
def network_kernel(
    state,
    rows,
    fractions,
    first,
    first_bias,
    second,
    second_bias,
    third,
    third_bias,
    output,
    output_bias,
    gradient,
    to_between,
    partials,
    points,
    C: tl.constexpr,
    H: tl.constexpr,
    WIDTH: tl.constexpr,
    UNITS: tl.constexpr,
    TILE: tl.constexpr,
    PRECISION: tl.constexpr,
):
    """Gradients of the weights, and of the state at the points.

    Writes the latter to `to_between` `[m, C]`, and a program's sums to `partials` `[programs, …]`:
    weights, transposed, and bias of each layer in turn.
    """
    to_w1 = tl.zeros([WIDTH, UNITS], tl.float32)
    to_w2 = tl.zeros([UNITS, UNITS], tl.float32)
    to_w3 = tl.zeros([UNITS, UNITS], tl.float32)
    to_w4 = tl.zeros([UNITS, WIDTH], tl.float32)
    to_b1 = tl.zeros([UNITS], tl.float32)
    to_b2 = tl.zeros([UNITS], tl.float32)
    to_b3 = tl.zeros([UNITS], tl.float32)
    to_b4 = tl.zeros([WIDTH], tl.float32)
    channels = tl.arange(0, WIDTH)[None, :]
    for tile in range(tl.program_id(0), tl.cdiv(points, TILE), tl.num_programs(0)):
        at = tile * TILE + tl.arange(0, TILE)
        inside = at < points
        s = _interpolate(state, rows, fractions, points, at, inside, C, WIDTH)
        # Weights come from cache when they are multiplied. Barriers keep the compiler from fetching
        # those of later products beforehand, for which there are not enough registers.
        w = _transposed(first, C, H, WIDTH, UNITS)
        a1 = tl.dot(s, w, input_precision=PRECISION) + _bias(first_bias, H, UNITS)
        h1 = _sine(a1)
        tl.debug_barrier()
        w = _transposed(second, H, H, UNITS, UNITS)
        a2 = tl.dot(h1, w, input_precision=PRECISION) + _bias(second_bias, H, UNITS)
        h2 = _sine(a2)
        tl.debug_barrier()
        w = _transposed(third, H, H, UNITS, UNITS)
        a3 = tl.dot(h2, w, input_precision=PRECISION) + _bias(third_bias, H, UNITS)
        h3 = _sine(a3)
        tl.debug_barrier()

        wanted = inside[:, None] & (channels < 4)
        g = tl.load(gradient + (at[:, None] * 4 + channels), mask=wanted, other=0).to(tl.float32)
        to_w4 = tl.dot(tl.trans(h3), g, to_w4, input_precision=PRECISION)
        to_b4 += tl.sum(g, 0)
        tl.debug_barrier()
        w = _transposed(output, H, 4, UNITS, WIDTH)
        to_a = tl.dot(g, tl.trans(w), input_precision=PRECISION) * _cosine(a3)
        tl.debug_barrier()
        to_w3 = tl.dot(tl.trans(h2), to_a, to_w3, input_precision=PRECISION)
        to_b3 += tl.sum(to_a, 0)
        tl.debug_barrier()
        w = _transposed(third, H, H, UNITS, UNITS)
        to_a = tl.dot(to_a, tl.trans(w), input_precision=PRECISION) * _cosine(a2)
        tl.debug_barrier()
        to_w2 = tl.dot(tl.trans(h1), to_a, to_w2, input_precision=PRECISION)
        to_b2 += tl.sum(to_a, 0)
        tl.debug_barrier()
        w = _transposed(second, H, H, UNITS, UNITS)
        to_a = tl.dot(to_a, tl.trans(w), input_precision=PRECISION) * _cosine(a1)
        tl.debug_barrier()
        to_w1 = tl.dot(tl.trans(s), to_a, to_w1, input_precision=PRECISION)
        to_b1 += tl.sum(to_a, 0)
        tl.debug_barrier()
        w = _transposed(first, C, H, WIDTH, UNITS)
        to_s = g + tl.dot(to_a, tl.trans(w), input_precision=PRECISION)
        to = to_between + (at[:, None] * C + channels)
        tl.store(to, to_s, mask=inside[:, None] & (channels < C))

    to = partials + tl.program_id(0) * ((C + 1) * H + 2 * (H + 1) * H + (H + 1) * 4)
    _store(to, C, H, to_w1, WIDTH, UNITS)
    to += C * H
    _store_bias(to, H, to_b1, UNITS)
    to += H
    _store(to, H, H, to_w2, UNITS, UNITS)
    to += H * H
    _store_bias(to, H, to_b2, UNITS)
    to += H
    _store(to, H, H, to_w3, UNITS, UNITS)
    to += H * H
    _store_bias(to, H, to_b3, UNITS)
    to += H
    _store(to, H, 4, to_w4, UNITS, WIDTH)
    to += H * 4
    _store_bias(to, 4, to_b4, WIDTH)


@triton.jit(do_not_specialize=["points", "cells"])
def state_kernel(
    to_between,
    fractions,
    order,
    begin,
    to_state,
    points,
    cells,
    C: tl.constexpr,
    WIDTH: tl.constexpr,
    TILE: tl.constexpr,
):
    """Gradient of the state: each cell collects from the points that it is a corner of.

    Those of cell r are `order[begin[r]]` to `order[begin[r + 1]]`, as corner · m + point.
    """
    channels = tl.arange(0, WIDTH)[None, :]
    cell = tl.program_id(0) * TILE + tl.arange(0, TILE)
    inside = cell < cells  # the outside, row n, is a constant
    first = tl.load(begin + cell, mask=inside, other=0)
    last = tl.load(begin + cell + 1, mask=inside, other=0)
    total = tl.zeros([TILE, WIDTH], tl.float32)
    for k in range(tl.max(last - first)):
        counts = first + k < last
        pair = tl.load(order + first + k, mask=counts, other=0)
        corner = pair // points
        point = pair % points
        share = _share(fractions, point, counts, corner)[:, None]
        wanted = counts[:, None] & (channels < C)
        from_point = tl.load(to_between + point[:, None] * C + channels, mask=wanted, other=0)
        total += tl.where(counts[:, None], share * from_point, 0.0)
    at = to_state + cell[:, None] * C + channels
    stored = total.to(to_state.dtype.element_ty)
    tl.store(at, stored, mask=(cell <= cells)[:, None] & (channels < C))
