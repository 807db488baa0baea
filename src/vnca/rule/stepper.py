"""A rule bound to the kernel that applies it."""

from collections.abc import Callable

from vnca.core.typing import FloatArray, IntArray
from vnca.engine.backend import array_step
from vnca.engine.native.step import Precision
from vnca.engine.stencil import stencil
from vnca.rule.rule import Rule

Step = Callable[[FloatArray, IntArray, IntArray, FloatArray], FloatArray]
"""A step: the new state from state, changing rows, neighbours and priors."""


def stepper(
    rule: Rule,
    backend: str = "auto",
    *,
    threads: int | None = None,
    precision: Precision = "float32",
) -> Step:
    """The step of a rule on arrays.

    Args:
        rule: Its weights and filters.
        backend: `auto`, `native` or `reference`.
        threads: How many the native kernel uses; by default one for each core.
        precision: What the native kernel rounds the factors of its products to.

    Raises:
        BackendUnavailableError: If the backend asked for cannot run here, or not so.
    """
    apply = array_step(backend, threads=threads, precision=precision)
    filters = stencil(
        sobel_divisor=rule.config.sobel_divisor, laplacian_divisor=rule.config.laplacian_divisor
    )

    def step(
        state: FloatArray, rows: IntArray, neighbours: IntArray, priors: FloatArray
    ) -> FloatArray:
        return apply(state, rows, neighbours, priors, rule.hidden, rule.bias, rule.output, filters)

    return step
