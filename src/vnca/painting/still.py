"""Smoke of which a rule is not told how it moves: the user is told, once."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from vnca.core.volume import Volume
from vnca.io.smoke import SmokeFormat, missing_velocity
from vnca.io.smoke_format import NO_VELOCITY
from vnca.rule.rule import Rule


@dataclass
class StillSmoke:
    """Looks for smoke without velocity among what a rule paints.

    Attributes:
        rule: The rule, which may be conditioned on velocity.
        format: How files are read: velocity may not be wanted.
        tell: Is given the line for the user.
    """

    rule: Rule
    format: SmokeFormat
    tell: Callable[[str], None]
    _is_told: bool = field(default=False, init=False)

    def look(self, smoke: Volume, path: Path | None) -> None:
        """Tell of a frame, the first without velocity; and what of its file could be that.

        Args:
            smoke: The frame.
            path: Its file; None if it has none.

        Raises:
            FileFormatError: If the file cannot be read any more.
        """
        if (
            self._is_told
            or not self.rule.config.is_conditioned_on("velocity")
            or self.format.velocity_grid == NO_VELOCITY
            or smoke.velocity_field is not None
            or smoke.box.is_empty
        ):
            return
        self._is_told = True
        missing = f"frame {smoke.frame}: no velocity" if path is None else missing_velocity(path)
        self.tell(f"{missing}; frames without are painted as if their smoke rested")

    def watched(self, frames: Iterable[Volume], paths: Iterable[Path | None]) -> Iterator[Volume]:
        """Frames in order, each looked at.

        Args:
            frames: The frames.
            paths: Their files.
        """
        for smoke, path in zip(frames, paths, strict=True):
            self.look(smoke, path)
            yield smoke
