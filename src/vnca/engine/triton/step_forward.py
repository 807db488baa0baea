"""The Triton kernel of a step, and what its gradient shares with it; see this folder's README.

Triton works on blocks whose sides are powers of two. Channels, priors and hidden units are padded
to them: what is beyond is loaded as zero and never stored. The inputs of the hidden layer are six
blocks, one for each filter and one for the priors; W1 is cut alike.
"""

# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false

import triton
import triton.language as tl

from vnca.engine.stencil import stencil

FORMS = tuple(map(tuple, stencil(sobel_divisor=1, laplacian_divisor=1).astype(int).tolist()))
"""The filters `[5, 27]` before their scales, whole numbers."""


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
    number: tl.constexpr = state.dtype.element_ty
    return (
        own.to(number),
        x.to(number),
        y.to(number),
        z.to(number),
        laplacian.to(number),
        p.to(number),
    )


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
