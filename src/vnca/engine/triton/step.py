"""The step on NVIDIA GPUs in torch's automatic differentiation, computed by Triton kernels."""

from collections.abc import Callable, Collection, Mapping
from functools import cache
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.utils.weak import WeakTensorKeyDictionary

from vnca.core.errors import ShapeError
from vnca.engine.automaton import FILTERS, NEIGHBOURS
from vnca.engine.automaton import stencil as filters
from vnca.engine.reference.equations import Weights
from vnca.engine.tensors import changing_rows, why_no_gpu

try:
    import triton
    from triton import knobs

    from vnca.engine.triton import gradient_kernels, step_kernels
except (ImportError, AttributeError) as error:  # another Triton may lack what kernels need
    triton: Any = None
    step_kernels: Any = None
    gradient_kernels: Any = None
    _missing = str(error)
    _interpreted = False
else:
    _missing = None
    _interpreted = knobs.runtime.interpret  # TRITON_INTERPRET; setting it later has no effect

T = TypeVar("T")
Precision = Literal["ieee", "tf32x3", "tf32"]
"""Products of float32: exact, as three products on tensor cores (nearly so), as one (10 bits)."""
PROGRAMS = 4
"""Programs for each multiprocessor; they take tiles of changing cells, or of points, in turns."""
TILES = 64, 32
"""Cells that a program works on at a time in the forward and the backward pass, if their channels
are 16 or fewer."""
WARPS = 4, 8, 4
"""Of 32 threads, in a program of the forward pass, the weights' gradient and the state's."""
UNITS = {4: (32, 32), 2: (64, 32)}
"""Hidden units whose weights a program works on at a time in the forward and the backward pass, if
channels are 16 or fewer, by the bytes of a number. More take more registers than a thread has."""
GRADIENT_PRECISION: Precision = "ieee"
"""Of float32 products in the weights' gradient whatever is asked for: on tensor cores they take
more registers, too."""
TYPES = (torch.float32, torch.float16, torch.bfloat16)
OPTIONS: dict[str, Any] = {"num_stages": 1, "enable_fp_fusion": True}
FORWARD_OPTIONS: dict[str, Any] = {**OPTIONS, "maxnreg": 255}
"""Of the forward kernel, which may take all registers of a thread: by itself, the assembler for
`sm_80` gives it half of them, and spills. Given to other kernels, too, this makes those spill."""
LOWEST_CAPABILITY = (8, 0)
"""Compute capability from which on GPUs multiply tf32 and bfloat16."""
MOST_CHANNELS, MOST_PRIORS = 64, 31
"""What fits into a multiprocessor."""
LARGEST = 2**31 - 1
"""Offsets into arrays are 32-bit numbers."""
_perceivers: WeakTensorKeyDictionary = WeakTensorKeyDictionary()
_scales: WeakTensorKeyDictionary = WeakTensorKeyDictionary()


class Perceivers(NamedTuple):
    """For each cell r, all cells i and offsets o with `neighbours[o, i] == r`.

    Nearly always i is itself a neighbour of r, at the opposite offset. Where the border of a box
    repeats cells it need not be; those pairs are listed, by r.

    Attributes:
        mutual: `[n]` int32; bit o is set if `neighbours[26 - o, r]` is such an i.
        begin: `[n + 1]` int32; the other pairs of r are those from `begin[r]` to `begin[r + 1]`.
        source: Their cells i, int32.
        weights: `[5, pairs]` of the filters at their offsets o, whole numbers, before any scale.
    """

    mutual: Tensor
    begin: Tensor
    source: Tensor
    weights: Tensor

    @classmethod
    def of(cls, neighbours: Tensor) -> "Perceivers":
        """Read a table `[27, n]` backwards, on its own device."""
        n = neighbours.shape[1]
        cells = torch.arange(n, dtype=torch.int32, device=neighbours.device)
        mutual = torch.zeros_like(cells)
        pairs = []
        for offset, opposite in zip(range(NEIGHBOURS), reversed(neighbours), strict=True):
            mutual |= _looks_back(opposite, neighbours[offset], cells).int() << offset
            target = neighbours[offset]
            one_way = (target < n) & ~_looks_back(target, opposite, cells)
            source = cells[one_way]
            pairs.append(torch.stack([target[one_way], source, torch.full_like(source, offset)]))
        target, source, offset = torch.cat(pairs, dim=1)
        target, order = torch.sort(target, stable=True)
        begin = torch.searchsorted(
            target, torch.arange(n + 1, device=target.device), out_int32=True
        )
        forms = torch.from_numpy(filters(sobel_divisor=1, laplacian_divisor=1))
        weights = forms.to(offset.device)[:, offset[order].long()].contiguous()
        return cls(mutual, begin, source[order], weights)


def _looks_back(there: Tensor, back: Tensor, cells: Tensor) -> Tensor:
    """Which `cells` are found again by looking from the rows `there` along the table `back`."""
    n = len(cells)
    if n == 0:
        return torch.zeros_like(cells, dtype=torch.bool)
    return (there < n) & (back[there.clamp(max=n - 1).long()] == cells)


def unavailable(device: str) -> str | None:
    """Why the Triton kernels cannot run on a device, or nothing if they can."""
    if _missing is not None:
        return f"the package triton is not installed, or does not load ({_missing})"
    if _interpreted:
        return None
    if not device.startswith("cuda"):
        return f"the Triton kernels work on NVIDIA GPUs, not on {device}"
    if torch.version.hip is not None:
        return "the Triton kernels work on NVIDIA GPUs, not on AMD's"
    return why_no_gpu(device) or _why_no_kernel()


@cache
def _why_no_kernel() -> str | None:
    """Why Triton, C compiler and driver cannot run a kernel here, or nothing if they can."""
    capability = torch.cuda.get_device_capability()
    if capability < LOWEST_CAPABILITY:
        name, needed = torch.cuda.get_device_name(), LOWEST_CAPABILITY
        return (
            f"{name} has compute capability {capability[0]}.{capability[1]}, and the Triton "
            f"kernels need {needed[0]}.{needed[1]}"
        )
    hashes = torch.arange(1000, dtype=torch.int32)
    drawn = {"seed": 1, "step": 2, "probability": 0.5}
    versions = f"triton {triton.__version__} with torch {torch.__version__}"
    try:
        found = step_kernels.changing_rows(hashes.cuda(), **drawn).cpu()
    except Exception as error:  # Triton's compiler, the C compiler's and the driver's are many
        lines = str(error).strip().splitlines() or [type(error).__name__]
        return f"{versions} cannot run a kernel on this GPU ({lines[0][:200]})"
    if not torch.equal(found, changing_rows(hashes, **drawn)):
        return f"{versions} computes wrongly on this GPU"
    return None


def update(
    state: Tensor,
    rows: Tensor,
    neighbours: Tensor,
    priors: Tensor,
    weights: Weights,
    stencil: Tensor,
    *,
    precision: Precision | None = None,
) -> Tensor:
    """The state after one step, as `vnca.engine.reference.equations.update` has it.

    Differentiable, once, in the state and the weights. Beyond the two states, memory is kept for
    nothing: the backward pass computes the hidden layer anew. The same bits in every run on one
    kind of GPU.

    Args:
        state: `[n + 1, C]`, float32, float16 or bfloat16; the last row is the outside, always
            zero. Products are of numbers of this type, sums are float32.
        rows: `[m]` cells that change in this step, int32, ascending; not checked.
        neighbours: `[27, n]` rows of the state around each cell, int32; n for the outside; not
            checked. What is derived from the table is kept with it: do not change it in place.
        priors: `[n, P]`.
        weights: W1, b1 and W2.
        stencil: `[5, 27]` from `vnca.engine.automaton`, with any divisors.
        precision: Of float32 products; by default `tf32x3`, or `tf32` if torch is told that this
            is enough (`torch.set_float32_matmul_precision`).

    Raises:
        ShapeError: If shapes or types are not as above, or too large.
    """
    _check(state, rows, neighbours, priors, weights)
    precision = precision or default_precision()
    trained = torch.is_grad_enabled() and any(t.requires_grad for t in (state, *weights))
    perceivers = _known(_perceivers, Perceivers.of, neighbours) if trained else None
    scales = _known(_scales, _read_scales, stencil)
    tensors = (state, rows, neighbours, priors, *weights)
    result = _Update.apply(*tensors, perceivers, scales, precision)
    assert isinstance(result, Tensor)
    return result


class _Update(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> Tensor:
        *tensors, ctx.perceivers, ctx.scales, ctx.precision = inputs
        tensors = [tensor.contiguous() for tensor in tensors]
        ctx.save_for_backward(*tensors)
        state, rows, neighbours = tensors[:3]
        if len(rows) == 0:
            return state.clone()
        out = torch.empty_like(state)
        sizes = _sizes(state, tensors[3], tensors[4], backward=False)
        with torch.cuda.device_of(state):
            count = programs(len(rows), sizes["TILE"], rows.device)
            step_kernels.forward_kernel[(count,)](
                *tensors,
                out,
                neighbours.shape[1],
                len(rows),
                ctx.scales,
                **sizes,
                PRECISION=ctx.precision,
                num_warps=WARPS[0],
                **FORWARD_OPTIONS,
            )
        return out

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, *grad_outputs: Tensor
    ) -> tuple[Tensor | None, ...]:
        gradient = grad_outputs[0].contiguous()
        tensors = ctx.saved_tensors
        state, rows, neighbours, priors, *weights = tensors
        hidden = weights[0]
        n, channels, units = neighbours.shape[1], state.shape[1], len(hidden)
        sizes = _sizes(state, priors, hidden, backward=True)
        count = programs(len(rows), sizes["TILE"], rows.device)
        # Unsummed gradients of W1ᵀ, b1 and W2, one below the other.
        partials = state.new_empty(
            (count, hidden.shape[1] + 1 + channels, units), dtype=torch.float32
        )
        perceived = state.new_empty(len(rows), FILTERS * channels)
        to_perceived = torch.zeros_like(perceived)
        place = torch.full((n,), -1, dtype=torch.int32, device=state.device)
        to_state = torch.empty_like(state)
        with torch.cuda.device_of(state):
            if count:
                few = {name: sizes[name] for name in ("C", "WIDTH", "TILE")}
                gradient_kernels.perceive_kernel[(triton.cdiv(len(rows), few["TILE"]),)](
                    state,
                    rows,
                    neighbours,
                    perceived,
                    n,
                    len(rows),
                    ctx.scales,
                    **few,
                    num_warps=WARPS[2],
                    **OPTIONS,
                )
                for portion in range(0, units, sizes["UNITS"]):
                    gradient_kernels.weights_kernel[(count,)](
                        perceived,
                        rows,
                        priors,
                        *weights,
                        gradient,
                        to_perceived,
                        place,
                        partials,
                        len(rows),
                        portion,
                        ctx.scales,
                        **sizes,
                        PRECISION=GRADIENT_PRECISION,
                        num_warps=WARPS[1],
                        **OPTIONS,
                    )
            tile = sizes["TILE"]
            gradient_kernels.state_kernel[(triton.cdiv(n + 1, tile),)](
                gradient,
                to_perceived,
                place,
                neighbours,
                *ctx.perceivers,
                to_state,
                n,
                len(ctx.perceivers.source),
                channels,
                sizes["WIDTH"],
                tile,
                num_warps=WARPS[2],
                **OPTIONS,
            )
        total = partials.sum(0)
        split = total.split([hidden.shape[1], 1, channels])
        to_weights = (split[0].t(), split[1][0], split[2])
        to_weights = (g.to(w.dtype) for g, w in zip(to_weights, weights, strict=True))
        return to_state, None, None, None, *to_weights, None, None, None


def _sizes(state: Tensor, priors: Tensor, hidden: Tensor, *, backward: bool) -> dict[str, int]:
    """What the kernels of a pass are compiled for."""
    width = max(16, triton.next_power_of_2(state.shape[1]))
    prior_width = max(16, triton.next_power_of_2(priors.shape[1] + 1))
    units = 16 * UNITS[state.element_size()][backward] // width
    units = min(units, triton.next_power_of_2(len(hidden)))
    return {
        "C": state.shape[1],
        "P": priors.shape[1],
        "H": len(hidden),
        "WIDTH": width,
        "PRIOR_WIDTH": prior_width,
        "UNITS": max(16, units),
        "TILE": max(16, 16 * TILES[backward] // width),
    }


def default_precision() -> Precision:
    """Of float32 products, unless one is asked for: what torch is told to be enough."""
    return "tf32x3" if torch.get_float32_matmul_precision() == "highest" else "tf32"


def programs(count: int, tile: int, device: torch.device) -> int:
    """How many programs take tiles of so many cells or points in turns."""
    processors = 1
    if device.type == "cuda":
        processors = torch.cuda.get_device_properties(device).multi_processor_count
    return min(triton.cdiv(count, tile), PROGRAMS * processors)


def require_layout(
    operation: str, arrays: Mapping[str, tuple[Tensor, tuple[int, ...]]], indices: Collection[str]
) -> None:
    """Refuse arrays that kernels cannot read.

    Args:
        operation: What a message calls it.
        arrays: Each with the shape expected, by name; all are to be where the first is.
        indices: Names of those that hold int32.

    Raises:
        ShapeError: Naming the first of another shape, type or place.
    """
    where = next(iter(arrays.values()))[0].device
    for name, (tensor, shape) in arrays.items():
        whole = name in indices
        if tuple(tensor.shape) != shape:
            problem = f"expected shape {shape}, got {tuple(tensor.shape)}"
        elif tensor.dtype not in ((torch.int32,) if whole else TYPES):
            problem = f"expected {'int32' if whole else 'float32 or shorter'}, got {tensor.dtype}"
        elif tensor.device != where:
            problem = f"expected on {where} like the state, got {tensor.device}"
        else:
            continue
        raise ShapeError(f"{operation}: {name}: {problem}")


def _check(
    state: Tensor, rows: Tensor, neighbours: Tensor, priors: Tensor, weights: Weights
) -> None:
    """Everything but the values of indices, which the CPU does not know."""
    n = neighbours.shape[1] if neighbours.ndim == 2 else 0
    c, p = (t.shape[1] if t.ndim == 2 else 0 for t in (state, priors))
    h = len(weights.hidden)
    shapes = {
        "state": (state, (n + 1, c)),
        "rows": (rows, (rows.numel(),)),
        "neighbours": (neighbours, (NEIGHBOURS, n)),
        "priors": (priors, (n, p)),
        "hidden weights": (weights.hidden, (h, FILTERS * c + p)),
        "hidden bias": (weights.bias, (h,)),
        "output weights": (weights.output, (c, h)),
    }
    require_layout("update step", shapes, ("rows", "neighbours"))
    if not (1 <= c <= MOST_CHANNELS and p <= MOST_PRIORS and h >= 1):
        raise ShapeError(
            f"update step: {c} channels, {p} priors, {h} hidden units: the Triton kernels work "
            f"with 1 to {MOST_CHANNELS} channels, up to {MOST_PRIORS} priors and at least one unit"
        )
    if max(NEIGHBOURS, FILTERS * c, p) * n > LARGEST:
        raise ShapeError(
            f"update step: {n} cells of {c} channels: too many for the 32-bit offsets of the "
            "Triton kernels"
        )


def _known(results: WeakTensorKeyDictionary, compute: Callable[[Tensor], T], of: Tensor) -> T:
    """The result for a tensor, computed once: all steps of a rollout share table and filters."""
    if of not in results:
        results[of] = compute(of)
    return results[of]


def _read_scales(stencil: Tensor) -> tuple[float, ...]:
    """What each filter is a multiple of the kernels' whole numbers by; waits for the GPU."""
    given = stencil.detach().cpu().double().numpy()
    forms = filters(sobel_divisor=1, laplacian_divisor=1).astype(np.float64)
    if given.shape == forms.shape:
        scales = (given * forms).sum(axis=1) / (forms**2).sum(axis=1)
        if np.allclose(given, scales[:, None] * forms, rtol=1e-6, atol=0):
            return tuple(scales.tolist())
    raise ShapeError(
        "update step: stencil: the Triton kernels know only multiples of the identity, the three "
        "Sobel filters and the 27-point Laplacian"
    )
