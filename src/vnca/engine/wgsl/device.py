"""The GPU that WebGPU finds: its buffers, and shaders made ready to run on it."""

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import BackendUnavailableError, OutOfMemoryError

LIMITS = (
    "max-buffer-size",
    "max-storage-buffer-binding-size",
    "max-storage-buffers-per-shader-stage",
)
"""What is asked for as large as the adapter has it; a browser promises 128 MiB a binding."""
_GROUPS = 65535  # along an axis of a dispatch


def no_device(*, half: bool = False) -> str | None:
    """Why there is no GPU to compute on, or nothing if there is; `half` asks for 16-bit floats."""
    try:
        gpu = device()
    # What is missing is told in errors of the driver's own: a loader, a driver, a device.
    except Exception as error:
        return f"WebGPU finds no device ({' '.join(str(error).split())[:200]})"
    if half and "shader-f16" not in gpu.features:
        return f"{name()} has no 16-bit floats in shaders; use precision float32"
    return None


@cache
def device() -> Any:
    """The device, opened when it is first asked for."""
    adapter = _adapter()
    wanted = [feature for feature in ("shader-f16",) if feature in adapter.features]
    limits = {name: adapter.limits[name] for name in LIMITS}
    return adapter.request_device_sync(required_features=wanted, required_limits=limits)


@cache
def _adapter() -> Any:
    import wgpu

    # Mesa's drivers and Triton each bring an LLVM, which get along in this order alone.
    if importlib.util.find_spec("triton") is not None:
        importlib.import_module("triton")
    return wgpu.gpu.request_adapter_sync(power_preference="high-performance")


def name() -> str:
    """What the device is called."""
    return str(_adapter().info["device"])


def binding_bytes() -> int:
    """How many bytes of an array a shader binds at once."""
    limits = device().limits
    return min(limits["max-storage-buffer-binding-size"], limits["max-buffer-size"])


def source(*parts: str, **constants: int) -> str:
    """A shader of some files of this folder, one after the other, below its constants."""
    folder = files("vnca.engine.wgsl")
    numbers = [f"const {key.upper()} = {value}u;" for key, value in constants.items()]
    return "\n".join([*numbers, *(folder.joinpath(f"{part}.wgsl").read_text() for part in parts)])


@cache
def pipeline(code: str, entry: str) -> Any:
    """A shader ready to run; compiled once for each source."""
    gpu = device()
    module = gpu.create_shader_module(code=code)
    return gpu.create_compute_pipeline(
        layout="auto", compute={"module": module, "entry_point": entry}
    )


@dataclass(frozen=True, eq=False)
class Buffer:
    """Numbers on the device.

    Attributes:
        handle: Of WebGPU.
        size: Bytes.
    """

    handle: Any
    size: int

    @classmethod
    def of(cls, array: AnyArray, *, uniform: bool = False) -> "Buffer":
        """An array on the device; what is uniform is small and the same for all threads."""
        buffer = cls.empty(array.nbytes, uniform=uniform)
        if array.nbytes:
            device().queue.write_buffer(buffer.handle, 0, np.ascontiguousarray(array))
        return buffer

    @classmethod
    def empty(cls, size: int, *, uniform: bool = False) -> "Buffer":
        """So many bytes of zeros.

        Raises:
            OutOfMemoryError: If the device cannot bind as many.
        """
        import wgpu

        most = binding_bytes()
        if size > most:
            raise OutOfMemoryError(
                f"backend wgsl: an array of {size / 2**20:.0f} MiB, and {name()} binds at most "
                f"{most / 2**20:.0f} MiB; paint at a lower `refine`, or use another backend"
            )
        kind = wgpu.BufferUsage.UNIFORM if uniform else wgpu.BufferUsage.STORAGE
        usage = kind | wgpu.BufferUsage.COPY_DST | wgpu.BufferUsage.COPY_SRC
        # Bindings are never empty, and sizes are multiples of four.
        handle = device().create_buffer(size=max(16, -(-size // 4) * 4), usage=usage)
        return cls(handle, size)

    def read(self, kind: Any) -> AnyArray:
        """The numbers as a flat array of a type."""
        return np.frombuffer(device().queue.read_buffer(self.handle), kind)[
            : self.size // np.dtype(kind).itemsize
        ].copy()


def bound(ready: Any, bindings: Mapping[int, Buffer], group: int = 0) -> Any:
    """Buffers as the bindings of a pipeline, by their numbers."""
    entries = [
        {"binding": number, "resource": {"buffer": buffer.handle}}
        for number, buffer in bindings.items()
    ]
    return device().create_bind_group(layout=ready.get_bind_group_layout(group), entries=entries)


def dispatched(ready: Any, groups: Sequence[Any], count: int) -> None:
    """Run a pipeline with bind groups on so many groups of threads."""
    encoder = device().create_command_encoder()
    run = encoder.begin_compute_pass()
    run.set_pipeline(ready)
    for number, group in enumerate(groups):
        run.set_bind_group(number, group)
    rows = -(-count // _GROUPS) or 1
    run.dispatch_workgroups(-(-count // rows), rows)
    run.end()
    device().queue.submit([encoder.finish()])


def require_device() -> None:
    """Raise `BackendUnavailableError` unless there is a GPU to compute on."""
    if (reason := no_device()) is not None:
        raise BackendUnavailableError(f"backend wgsl cannot run: {reason}")
