"""The frames of a sequence on their way to a rule: read ahead, and looked at.

Of smoke without velocity, or with one in other units than it moves by, the user is told once. Smoke
too thin to be painted is refused, as with densities in another unit than the rule was taught in.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from vnca.core import FloatArray
from vnca.core.errors import SequenceError
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, missing_velocity
from vnca.io.smoke_format import NO_VELOCITY
from vnca.io.velocity import likely_velocity_scale
from vnca.rule import SMOKE_THRESHOLD, Rule, density_scale

T = TypeVar("T")
PAIRS_CHECKED = 3
"""Frames whose velocity is compared with how their smoke moves."""


def read_ahead(
    loads: Iterable[Callable[[], T]], unwanted: Callable[[T], None] | None = None
) -> Generator[T, None, None]:
    """The results of `loads` in order, each computed in a thread one ahead of its use.

    At most two results exist at a time. An exception is raised where its result would have been.
    `unwanted` is given what was computed and is not taken, as the iterator is closed before.
    """
    with ThreadPoolExecutor(max_workers=1) as reader:
        pending: deque[Future[T]] = deque()
        try:
            for load in loads:
                pending.append(reader.submit(load))
                if len(pending) > 1:
                    yield pending.popleft().result()
            if pending:
                yield pending.popleft().result()
        finally:
            for left in pending:
                if unwanted is not None and left.exception() is None:
                    unwanted(left.result())


@dataclass
class VelocityCheck:
    """Looks at the velocity of what a rule paints: is there any, and does it move the smoke?

    Attributes:
        rule: The rule, which may be conditioned on velocity.
        format: How files are read: velocity may not be wanted.
        tell: Is given lines for the user, each at most once.
    """

    rule: Rule
    format: SmokeFormat
    tell: Callable[[str], None]
    _is_told: bool = field(default=False, init=False)
    _pairs: int = field(default=PAIRS_CHECKED, init=False)
    _before: Volume | None = field(default=None, init=False)

    def look(self, smoke: Volume, path: Path | None) -> None:
        """Tell of a frame, the first without velocity; and of one whose units seem to be others.

        Args:
            smoke: The frame.
            path: Its file; None if it has none.

        Raises:
            FileFormatError: If the file cannot be read any more.
        """
        if (
            self.format.velocity_grid == NO_VELOCITY
            or smoke.box.is_empty
            or not (self.rule.config.transport or self.rule.config.is_conditioned_on("velocity"))
        ):
            return
        if smoke.velocity_field is None:
            self._tell_of_none(smoke, path)
        elif self._pairs > 0:
            self._compare(smoke, path)

    def _tell_of_none(self, smoke: Volume, path: Path | None) -> None:
        if self._is_told:
            return
        self._is_told = True
        missing = f"frame {smoke.frame}: no velocity" if path is None else missing_velocity(path)
        self.tell(f"{missing}; frames without are painted as if their smoke rested")

    def _compare(self, smoke: Volume, path: Path | None) -> None:
        before, self._before = self._before, smoke
        if before is None or smoke.frame != before.frame + 1:
            return
        self._pairs -= 1
        scale = likely_velocity_scale(before, smoke)
        if scale != 1:
            self._pairs = 0
            off = f"{1 / scale:.0f} times too fast" if scale < 1 else f"{scale:.0f} times too slow"
            self.tell(
                f"{path or f'frame {smoke.frame}'}: the velocity seems about {off} for how the "
                "smoke moves, and carries patterns along like that; check `velocity_units`, `fps` "
                "and `time_scale`, or set `velocity_scale` fit"
            )
        if self._pairs == 0:
            self._before = None

    def watched(self, frames: Iterable[Volume], paths: Iterable[Path | None]) -> Iterator[Volume]:
        """Frames in order, each looked at.

        Args:
            frames: The frames.
            paths: Their files.
        """
        for smoke, path in zip(frames, paths, strict=True):
            self.look(smoke, path)
            yield smoke


def require_dense(densities: Iterable[FloatArray], scale: float, where: str) -> None:
    """Refuse a sequence of which nothing would be painted.

    Looks at frames up to the first that is dense enough; of none at all nothing is said.

    Args:
        densities: Of each frame, in any shape.
        scale: The density that counts as 1.
        where: What a message calls the sequence.

    Raises:
        SequenceError: If no frame holds a cell that counts as smoke.
    """
    most, typical, is_read = 0.0, 0.0, False
    for density in densities:
        is_read = True
        most = max(most, float(density.max(initial=0)))
        if most > SMOKE_THRESHOLD * scale:
            return
        if density.any():
            typical = max(typical, density_scale(density))
    if is_read:
        raise SequenceError(
            f"{where}: nothing would be painted, as the greatest density of all frames, "
            f"{most:.3g}, is below {SMOKE_THRESHOLD:.0%} of the one that counts as 1, "
            f"{scale:.3g}; "
            + (f"try `density_scale` {typical:.3g}" if most else "choose others with `frames`")
        )
