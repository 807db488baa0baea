"""What an earlier run finished: whether that is all, and whether it can be gone on from."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file
from vnca.io.provenance import read_provenance
from vnca.painting.unfinished import Source

if TYPE_CHECKING:
    from vnca.painting.painter import Painter

MARK = "painting"
"""Entry of a painted file that tells frames of one painting from those of others."""


def is_complete(painter: "Painter") -> bool:
    """Whether every frame is there, painted by this rule in this way from what it is now."""
    if painter.chunk.state_out is not None and not painter.chunk.state_out.exists():
        return False
    for frame in painter.frames:
        target = painter.target(frame)
        if not target.exists() or not frame.path.exists():
            return False
        if frame.path.stat().st_mtime_ns > target.stat().st_mtime_ns:
            return False
        try:
            told = read_provenance(target)
        except FileFormatError:
            return False
        if told is None or told.facts.get(MARK) != painter.mark:
            return False
    return True


def require_unchanged(painter: "Painter", sources: Sequence[Source | None]) -> None:
    """Refuse to go on unless finished frames and what they were painted from are there.

    Args:
        painter: Of the painting.
        sources: What it was painted from.

    Raises:
        FileFormatError: If these are not its frames.
        OptionError: If one is gone, or has changed.
    """
    first = painter.chunk.first
    if not painter.chunk.begin <= len(sources) <= first + len(painter.frames) or any(
        source and not 0 <= source.frame <= at for at, source in enumerate(sources)
    ):
        raise FileFormatError(
            f"{painter.unfinished_path}: its frames are not those of the sequence or the chunk; "
            "start anew without `resume`"
        )
    for frame, source in zip(painter.frames, sources[first:], strict=False):
        if source is None:
            continue
        if not painter.target(frame).exists():
            raise OptionError(
                f"{painter.target(frame)}: was finished but is gone; start anew without `resume`"
            )
        origin = painter.sequence[source.frame].path
        status = existing_file(origin).stat()
        if (status.st_size, status.st_mtime_ns) != source[1:]:
            raise OptionError(
                f"{origin}: has changed since it was painted; start anew without `resume`"
            )
