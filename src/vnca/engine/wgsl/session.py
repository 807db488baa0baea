"""Steps in WGSL: everything stays on the device from the first step to the last."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.bricks import EDGE, runs_of_bricks
from vnca.core.errors import OptionError
from vnca.engine import Job, Session
from vnca.engine.automaton import FILTERS, Automaton, Weights, mask_key, mask_threshold
from vnca.engine.domain import Domain
from vnca.engine.wgsl.device import Buffer, bound, dispatched, pipeline, source
from vnca.engine.wgsl.parts import Layout, Rows, require_bindings

CELLS_OF_GROUP = 256
"""Cells whose mask a group of threads draws, as `step.wgsl` has it."""
PLACES, STATE = 16, 512
"""The first bindings of the list of cells, and of their states."""
NOWHERE = 0xFFFFFFFF
MOST_PLACES = 2**25
"""Bricks that the map may span: some thousands of cells along each axis."""


@dataclass(frozen=True, eq=False)
class WgslSession(Session):
    """A session on the device.

    Attributes:
        automaton: Its mask.
        cells: How many cells are active.
        ready: The pipeline.
        told: What the cells are conditioned on, in the parts in which their states are.
        parts: Of each of them the first row, and how many cells there are.
        fixed: The bindings of all else but the states and the step.
    """

    automaton: Automaton
    cells: int
    ready: Any
    told: Rows
    parts: tuple[Buffer, ...]
    fixed: dict[int, Buffer]

    @classmethod
    def open(cls, job: Job) -> "WgslSession":
        """Bring everything to the device."""
        automaton, half = job.automaton, job.compute.precision == "float16"
        channels, hidden = automaton.weights.output.shape
        cells, planes = len(job.domain), quarters(channels)
        told = _told(np.asarray(job.conditioning))
        wide = told.shape[1]
        states = Layout.of(cells + 1, 16 * planes, beside=4 * wide)
        sites, listed = _sites(job.domain)
        places = Rows.of(listed)
        # Beside them: weights, what the cells are told, and the states that follow.
        require_bindings(places.layout.parts + states.parts + 3)
        reading = places.layout.declared("place", "u32", PLACES)
        reading += states.declared("state", "vec4f", STATE, width="PLANES")
        code = source("sites", "step", planes=planes, told=wide // 4, hidden=hidden)
        factor = "enable f16;\nalias Factor = f16;\n" if half else "alias Factor = f32;\n"
        weights = packed(automaton.weights, channels, wide)
        each = states.each
        spans = (np.array([at, min(each, cells - at)], np.uint32) for at in range(0, cells, each))
        return cls(
            automaton,
            cells,
            pipeline(factor + reading + code, "step"),
            Rows.of(told, each),
            tuple(Buffer.of(span, uniform=True) for span in spans),
            {
                0: Buffer.of(sites, uniform=True),
                3: Buffer.of(_filters(automaton.stencil), uniform=True),
                4: Buffer.of(weights.astype(np.float16 if half else np.float32)),
                **places.bindings(PLACES),
            },
        )

    def conditioned(self, conditioning: Any) -> "WgslSession":
        """See `Session.conditioned`."""
        return replace(self, told=Rows.of(_told(np.asarray(conditioning)), self.told.layout.each))

    def upload(self, state: FloatArray) -> Rows:
        """See `Session.upload`."""
        return Rows.of(widened(state), self.told.layout.each)

    def step(self, state: Rows, number: int) -> Rows:
        """See `Session.step`."""
        automaton = self.automaton
        probability = automaton.update_probability
        always = probability >= 1
        threshold = 0 if always else mask_threshold(probability)
        now = np.array([mask_key(automaton.seed, number), threshold, always, 0], np.uint32)
        following = state.blank()
        shared = {2: Buffer.of(now, uniform=True), **self.fixed, **state.bindings(STATE)}
        groups = -(-min(self.told.layout.each, self.cells) // CELLS_OF_GROUP)
        # The last part may hold nothing but the row that is always zero.
        for at, part in enumerate(self.parts):
            own = {1: part, 5: self.told.buffers[at], 6: following.buffers[at]}
            dispatched(self.ready, [bound(self.ready, {**shared, **own})], groups)
        return following

    def read(self, state: Rows) -> FloatArray:
        """See `Session.read`."""
        channels = len(self.automaton.weights.output)
        values = state.read(np.float32).reshape(self.cells + 1, -1)
        return np.ascontiguousarray(values[:, :channels])


def quarters(count: int) -> int:
    """Vectors of four that hold so many numbers."""
    return -(-count // 4)


def widened(values: AnyArray) -> FloatArray:
    """Rows of numbers, each with zeros up to whole vectors of four."""
    width = 4 * quarters(values.shape[1])
    result = np.zeros((len(values), width), np.float32)
    result[:, : values.shape[1]] = values
    return result


def packed(weights: Weights, channels: int, told: int) -> FloatArray:
    """W1 with its bias as what the 1 among the inputs is multiplied by, and W2, by unit.

    Args:
        weights: Of the automaton.
        channels: Of a cell's state.
        told: Numbers that a cell is told, the 1 and zeros included.
    """
    hidden, bias, output = (np.asarray(each, np.float32) for each in weights)
    units, width = len(hidden), 4 * quarters(channels)
    perceived = np.zeros((units, FILTERS, width), np.float32)
    perceived[..., :channels] = hidden[:, : FILTERS * channels].reshape(units, FILTERS, channels)
    others = np.zeros((units, told), np.float32)
    others[:, : hidden.shape[1] - FILTERS * channels] = hidden[:, FILTERS * channels :]
    others[:, -1] = bias
    return np.concatenate([perceived.reshape(units, -1), others, widened(output.T)], axis=1)


def _told(conditioning: AnyArray) -> FloatArray:
    """What cells are conditioned on, and a last number that is 1."""
    count, width = conditioning.shape
    told = np.zeros((count, 4 * quarters(width + 1)), np.float32)
    told[:, :width] = conditioning
    told[:, -1] = 1
    return told


def _filters(stencil: FloatArray) -> FloatArray:
    """Of each neighbour what four filters and the fifth multiply it by, `[27, 8]`."""
    return widened(stencil.T)


def _sites(domain: Domain) -> tuple[AnyArray, AnyArray]:
    """Where cells lie, as `sites.wgsl` has it: the uniform, and the map with what is behind it.

    Raises:
        OptionError: If the cells are scattered so far that the map would be too large.
    """
    bricks, rows = domain.rows.bricks, domain.rows.values
    if not len(bricks):
        bricks, rows = np.zeros((1, 3), np.int32), np.zeros((1, EDGE, EDGE, EDGE), np.int32)
    first = bricks.min(axis=0).astype(np.int64)
    span = bricks.max(axis=0) - first + 1
    if span.prod() > MOST_PLACES:
        raise OptionError(
            f"`backend` wgsl: smoke scattered over {' × '.join(map(str, span * EDGE))} cells is "
            "more than its map holds; use another backend"
        )
    numbers = np.full(span.tolist(), NOWHERE, np.uint32)
    numbers[tuple((bricks - first).T)] = np.arange(len(bricks))
    runs, lengths = runs_of_bricks(domain.cells)
    at = numbers[tuple((runs - first).T)].astype(np.int64).repeat(lengths) * EDGE**3
    x, y, z = (domain.cells & (EDGE - 1)).T
    at += (x << 6) | (y << 3) | z
    inside = np.where(rows == len(domain), NOWHERE, rows).astype(np.uint32)
    box, wraps = domain.box, domain.border == "circular"
    sites = np.array(
        [*box.lower, len(domain), *box.upper, wraps, *first, len(bricks), *span, 0], np.int32
    )
    places = [numbers.reshape(-1), bricks.reshape(-1).astype(np.int32).view(np.uint32)]
    return sites, np.concatenate([*places, inside.reshape(-1), at.astype(np.uint32)])
