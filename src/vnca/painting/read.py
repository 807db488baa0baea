"""A frame that was read to be painted, and whose file stays open for writing."""

from dataclasses import dataclass
from typing import Any

from vnca.core.errors import FileFormatError, VncaError
from vnca.core.volume import Volume
from vnca.io.sequence import Frame
from vnca.io.vdb import VdbFile
from vnca.painting.state import Ready
from vnca.painting.unfinished import Source


@dataclass(eq=False)
class Read:
    """A frame to be painted, and where it is from.

    Attributes:
        source: What it is from.
        frame: Which one it is.
        smoke: As fine as it is painted; or of which parts can be had.
        file: Stays open for writing.
        ready: The same made ready, until that is taken.
    """

    source: Source
    frame: Frame
    smoke: Any
    file: VdbFile | None
    ready: Ready | None

    def take(self) -> Volume | Ready:
        """The frame, made ready the first time: what that takes is not kept while it is written."""
        ready, self.ready = self.ready, None
        return ready or self.smoke

    def require_unchanged(self) -> None:
        """Refuse to copy from a file that was written to since it was read.

        Raises:
            FileFormatError: If it was.
        """
        if self.file is not None:
            status = self.file.status
            if (status.st_size, status.st_mtime_ns) != self.source[1:]:
                raise FileFormatError(f"{self.frame.path}: has changed while it was painted")

    def close(self) -> None:
        """Close the file."""
        if self.file is not None:
            self.file.close()


def close(read: Read | VncaError | None) -> None:
    """Close the file of a frame, if it could be read."""
    if isinstance(read, Read):
        read.close()
