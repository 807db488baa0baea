"""What the Triton kernels take of a GPU's multiprocessor, found by compiling them without one.

Run `python benchmarks/device/compile.py --csv FILE`; it takes no GPU. Each kernel is compiled for
each generation of GPUs as a rule of the presets launches it. It fails if anything spills from
registers to memory, or takes more shared memory than a multiprocessor gives a program.
"""

import argparse
import csv
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import torch
import triton
from triton import knobs
from triton.backends.compiler import GPUTarget
from triton.compiler import ASTSource

from vnca.engine.triton import decode, decode_kernels, gradient_kernels, step, step_kernels

SHARED = {80: 163, 90: 227, 120: 99}
"""Shared memory that a program may take on each generation, by compute capability, in KiB: of an
A100, an H100 and a GeForce of the 50 series. Of a GeForce of the 30 and 40 series it is 99, too."""
CHANNELS, PRIORS, HIDDEN = 12, 7, 128
NUMBERS = {
    "tf32x3": (torch.float32, "fp32", "tf32x3"),
    "tf32": (torch.float32, "fp32", "tf32"),
    "float16": (torch.float16, "fp16", "tf32x3"),
    "bfloat16": (torch.bfloat16, "bf16", "tf32x3"),
}
"""Numbers of states and weights, in torch and in Triton, and what float32 products are made of."""
WHOLE = {"rows", "neighbours", "place", "mutual", "begin", "source", "order", "hashes"}
SINGLE = {"partials", "to_between", "weights"}
"""Arguments that are arrays of int32, and of float32 whatever the state is."""
SIZES = {"cells", "changing", "portion", "pairs", "points", "key", "threshold"}


@dataclass(frozen=True)
class Launch:
    """How a kernel is launched.

    Attributes:
        name: Of the operation and the kernel.
        kernel: The function.
        constants: What it is compiled for.
        options: Of the compiler.
    """

    name: str
    kernel: Any
    constants: dict[str, Any]
    options: dict[str, Any]


@dataclass(frozen=True)
class Taken:
    """What a compiled kernel takes: a row of the table."""

    triton: str
    kernel: str
    numbers: str
    capability: int
    warps: int
    registers: int
    """Of a thread."""
    shared_bytes: int
    """Of a program."""
    stack_bytes: int
    """Of a thread: what it spills, because it has no more registers."""

    @property
    def problem(self) -> str | None:
        """Why it is not to be launched so, or nothing."""
        if self.stack_bytes:
            return f"spills {self.stack_bytes} bytes a thread"
        most = SHARED[self.capability] * 1024
        if self.shared_bytes > most:
            return f"takes {self.shared_bytes} bytes of shared memory of {most}"
        return None


def launches(numbers: str) -> Iterator[Launch]:
    """All kernels, as a rule of the presets launches them."""
    dtype, _, precision = NUMBERS[numbers]
    state = torch.empty(2, CHANNELS, dtype=dtype)
    priors, hidden = torch.empty(1, PRIORS), torch.empty(HIDDEN, 5 * CHANNELS + PRIORS)
    sizes = {**step._sizes(state, priors, hidden, backward=False), "PRECISION": precision}
    options = {"num_warps": step.WARPS[0], **step.FORWARD_OPTIONS}
    yield Launch("step forward", step_kernels.forward_kernel, sizes, options)
    sizes = {**step._sizes(state, priors, hidden, backward=True)}
    sizes["PRECISION"] = step.GRADIENT_PRECISION
    options = {"num_warps": step.WARPS[1], **step.OPTIONS}
    yield Launch("step weights", gradient_kernels.weights_kernel, sizes, options)
    sizes = {name: sizes[name] for name in ("C", "WIDTH", "TILE")}
    options = {"num_warps": step.WARPS[2], **step.OPTIONS}
    yield Launch("step perceive", gradient_kernels.perceive_kernel, sizes, options)
    yield Launch("step state", gradient_kernels.state_kernel, sizes, options)
    yield Launch(
        "step mask", step_kernels._mask_kernel, {"BLOCK": step_kernels.BLOCK}, step.OPTIONS
    )
    tensors = (state, state, state, torch.empty(32, CHANNELS))
    for name, tile, warps, precise in zip(
        ("forward", "network"),
        decode.TILES,
        decode.WARPS,
        (precision, decode.NETWORK_PRECISION),
        strict=False,
    ):
        yield Launch(
            f"decode {name}",
            getattr(decode_kernels, f"{name}_kernel"),
            {**decode._sizes(tensors, tile), "PRECISION": precise},
            {"num_warps": warps, **step.OPTIONS},
        )
    sizes = decode._sizes(tensors, decode.TILES[2])
    sizes = {name: sizes[name] for name in ("C", "WIDTH", "TILE")}
    options = {"num_warps": decode.WARPS[2], **step.OPTIONS}
    yield Launch("decode state", decode_kernels.state_kernel, sizes, options)


def compiled(launch: Launch, numbers: str, capability: int) -> Taken:
    """Compile a kernel."""
    names, number = launch.kernel.arg_names, NUMBERS[numbers][1]
    signature: dict[str, Any] = {}
    for name in names:
        if name in launch.constants:
            signature[name] = "constexpr"
        elif name in SIZES:
            signature[name] = "i32"
        elif name == "scales":
            signature[name] = ("fp32",) * 5
        elif name == "changes":
            signature[name] = "*i1"
        else:
            signature[name] = f"*{'i32' if name in WHOLE else 'fp32' if name in SINGLE else number}"
    source = ASTSource(
        launch.kernel,
        signature,
        {(names.index(name),): value for name, value in launch.constants.items()},
        # Torch's arrays begin at multiples of more than this.
        {(at,): [["tt.divisibility", 16]] for at, n in enumerate(names) if signature[n][0] == "*"},
    )
    target = GPUTarget("cuda", capability, 32)
    result: Any = triton.compile(source, target=target, options=launch.options)
    registers, stack = _told(result.asm["cubin"])
    return Taken(
        triton.__version__,
        launch.name,
        numbers,
        capability,
        result.metadata.num_warps,
        registers,
        result.metadata.shared,
        stack,
    )


def _told(cubin: bytes) -> tuple[int, int]:
    """Registers of a thread, and bytes of its stack, as the assembler wrote them down."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "kernel.cubin"
        file.write_bytes(cubin)
        command = [knobs.nvidia.cuobjdump.path, "-res-usage", str(file)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = re.search(r"REG:(\d+) STACK:(\d+)", said)
    assert found is not None, f"expected what cuobjdump tells, got {said}"
    return int(found[1]), int(found[2])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--csv", type=Path, metavar="FILE")
    parser.add_argument("--numbers", nargs="+", choices=NUMBERS, default=list(NUMBERS))
    parser.add_argument("--capability", nargs="+", type=int, choices=SHARED, default=list(SHARED))
    parser.add_argument("--kernel", nargs="+", metavar="NAME", help="all unless given")
    options = parser.parse_args()
    rows = []
    for numbers in options.numbers:
        for launch in launches(numbers):
            if options.kernel and launch.name not in options.kernel:
                continue
            for capability in options.capability:
                rows.append(compiled(launch, numbers, capability))
                print(*asdict(rows[-1]).values(), rows[-1].problem or "", flush=True)
    if options.csv is not None:
        options.csv.parent.mkdir(parents=True, exist_ok=True)
        with options.csv.open("w", newline="") as file:
            names = [field.name for field in fields(Taken)]
            table = csv.DictWriter(file, names, lineterminator="\n")
            table.writeheader()
            table.writerows(map(asdict, rows))
    if any(row.problem for row in rows):
        sys.exit("some kernels are not to be launched so")


if __name__ == "__main__":
    main()
