"""One step of the cellular automaton: a readable reference, and fast kernels held to it."""

from vnca.kernels.update.backend import choose, stepper, torch_step

__all__ = ["choose", "stepper", "torch_step"]
