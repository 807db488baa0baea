"""Drawing the mask of a step on an NVIDIA GPU: the bits of `mask.py`."""

# Numbers known when a kernel is compiled are written in capitals, as is the custom in Triton. Its
# functions are not typed as what they are inside a kernel.
# ruff: noqa: N803
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportCallIssue=false

import torch
import triton
import triton.language as tl
from torch import Tensor

from vnca.engine.mask import mask_key, mask_threshold

BLOCK = 1024


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
    """Rows `[m]` of the cells that change, as `vnca.engine.mask.changing_rows` draws them.

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
