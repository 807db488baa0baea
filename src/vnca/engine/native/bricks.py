"""Steps whose cells lie in bricks, without gradients: what paints.

The states in and around a brick are brought together once, for all of its cells, so there is no
table of the 27 neighbours of each; the mask is drawn there, too. The bits are those of `forward`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vnca.core import FloatArray, IntArray
from vnca.engine import Job, Session
from vnca.engine.automaton import Automaton, mask_key, mask_threshold
from vnca.engine.domain import Around
from vnca.engine.native import checked, default_threads, extension


def forward(
    state: FloatArray,
    around: Around,
    hashes: IntArray,
    priors: FloatArray,
    automaton: Automaton,
    step: int,
    steering: FloatArray | None = None,
    *,
    threads: int | None = None,
    out: FloatArray | None = None,
    precision: str = "float32",
    instructions: str = "",
) -> FloatArray:
    """The state `[n + 1, C]` after the step of a number.

    Bit-equal between runs and whatever the number of threads. Other Python threads run meanwhile.

    Args:
        state: `[n + 1, C]`, C at most 64; the last row is the outside, always zero.
        around: Of the cells' domain.
        hashes: `[n]`, the bits of `hash_cells` as int32.
        priors: `[n, P]`, P at most 16.
        automaton: Weights, at most 512 hidden units, filters and mask.
        step: Its number, from which the mask follows.
        steering: `[n, 3, 3]`; see `vnca.engine.native.forward`.
        threads: How many to use; by default one for each core.
        out: `[n + 1, C]` to write to; by default a new array.
        precision: What the factors of the products are rounded to.
        instructions: One of `instructions(precision)`; by default the first.

    Raises:
        BackendUnavailableError: If the extension was not built, or this machine has no bfloat16.
        OptionError: If there is no precision of that name.
        ShapeError: If arrays are not contiguous, of other shapes or types than above, or hold
            rows or places out of range.
    """
    if out is None:
        out = np.empty_like(state)
    probability = automaton.update_probability
    mask = (int(mask_key(automaton.seed, step)), int(mask_threshold(probability)), probability >= 1)
    arrays = (priors, *automaton.weights, automaton.stencil, steering, out)
    options = (threads or default_threads(), precision == "bfloat16", instructions)
    function = extension(precision).forward_bricks
    checked("update step", function, state, *around, hashes, *mask, *arrays, *options)
    return out


@dataclass(frozen=True, eq=False)
class BrickSession(Session):
    """A session of such steps, on arrays.

    Attributes:
        automaton: Weights, filters and mask.
        around: Of the domain.
        hashes: `[n]` for the mask, the bits as int32.
        conditioning: `[n, P]`.
        options: `threads` and `precision`.
        steering: `[n, 3, 3]`; None where cells are not steered.
    """

    automaton: Automaton
    around: Around
    hashes: IntArray
    conditioning: FloatArray
    options: dict[str, Any]
    steering: FloatArray | None = None

    @classmethod
    def open(cls, job: Job) -> "BrickSession":
        """On a job's domain."""
        options = {"threads": job.compute.threads, "precision": job.compute.precision}
        hashes = job.domain.hashes.view(np.int32)
        return cls(job.automaton, job.domain.around, hashes, np.asarray(job.conditioning), options)

    def conditioned(self, conditioning: Any) -> "BrickSession":
        """See `Session.conditioned`."""
        return replace(self, conditioning=np.asarray(conditioning))

    def steered(self, steering: Any) -> "BrickSession":
        """See `Session.steered`."""
        return replace(self, steering=np.asarray(steering))

    def upload(self, state: FloatArray) -> FloatArray:
        """See `Session.upload`."""
        return np.asarray(state)

    def step(self, state: FloatArray, number: int) -> FloatArray:
        """See `Session.step`."""
        return self._step(state, number, None)

    def run(
        self, state: FloatArray, numbers: range, watch: Callable[[], None] | None = None
    ) -> FloatArray:
        """See `Session.run`. Two arrays take turns: one a step would be zeroed by the system."""
        ours, spare = False, None
        for number in numbers:
            after = self._step(state, number, spare)
            spare = state if ours else None
            state, ours = after, True
            if watch is not None:
                watch()
        return state

    def read(self, state: FloatArray) -> FloatArray:
        """See `Session.read`."""
        return state

    def _step(self, state: FloatArray, number: int, out: FloatArray | None) -> FloatArray:
        surroundings = (self.around, self.hashes, self.conditioning)
        how = (self.automaton, number, self.steering)
        return forward(state, *surroundings, *how, out=out, **self.options)
