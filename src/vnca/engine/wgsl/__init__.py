"""The backend on any GPU, in WGSL, through the package wgpu: AMD, Intel and Apple too.

The page of `vnca view` runs the same shaders in a browser.
"""

import importlib.util
from functools import cache, partial

from vnca.engine import ArrayDecode, Backend, Compute, Job, Session
from vnca.engine.numpy import decode_parts


class WgslBackend(Backend):
    """Runs on what Vulkan, Metal or Direct3D find, forward only."""

    name = "wgsl"
    precisions = ("float32", "float16")
    has_gradients = False

    def missing(self, compute: Compute) -> str | None:
        """See `Backend.missing`."""
        return _missing(compute.precision)

    def session(self, job: Job) -> Session:
        """See `Backend.session`."""
        from vnca.engine.wgsl.session import WgslSession

        return WgslSession.open(job)

    def array_decode(self, *, threads: int | None = None) -> ArrayDecode:
        """See `Backend.array_decode`."""
        from vnca.engine.wgsl.decode import POINTS_AT_ONCE, decode

        parts = partial(decode_parts, decode=decode, points_at_once=POINTS_AT_ONCE)
        return ArrayDecode(decode, parts)


@cache
def _missing(precision: str) -> str | None:
    if importlib.util.find_spec("wgpu") is None:
        return "it needs wgpu; install vnca[webgpu]"
    from vnca.engine.wgsl.device import no_device

    return no_device(half=precision == "float16")


BACKEND = WgslBackend()
