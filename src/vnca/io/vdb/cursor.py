"""Reading forwards through a range of a file, never past its end."""

import struct
from functools import cache
from typing import Any, BinaryIO

from vnca.core.errors import FileFormatError


class Cursor:
    """A position in a stream between two bounds.

    Every length found in a file goes through `take` or `expect`, which compare it with what is
    left: a corrupt length is an error, not an allocation.

    Args:
        stream: Seekable; one cursor at a time uses it.
        start: First byte.
        end: One past the last byte.
        label: What is being read, for messages.
    """

    def __init__(self, stream: BinaryIO, start: int, end: int, label: str) -> None:
        self._stream = stream
        self.position = start
        self.end = end
        self.label = label
        stream.seek(start)

    @property
    def remaining(self) -> int:
        """Bytes left before the end."""
        return self.end - self.position

    def error(self, what: str) -> FileFormatError:
        """An error to raise, naming the thing being read and where the cursor stands."""
        return FileFormatError(f"{self.label}: {what} (at byte {self.position})")

    def expect(self, count: int) -> None:
        """Make sure that `count` bytes are left.

        Raises:
            FileFormatError: If not.
        """
        if not 0 <= count <= self.end - self.position:
            raise self.error(
                f"truncated or corrupt: needs {count} bytes more, {self.remaining} are left"
            )

    def take(self, count: int) -> bytes:
        """The next `count` bytes.

        Raises:
            FileFormatError: If fewer are left, or the file cannot be read.
        """
        self.expect(count)
        try:
            data = self._stream.read(count)
        except OSError as error:
            raise self.error(f"cannot be read ({error.strerror})") from error
        if len(data) != count:
            raise self.error("the file became shorter while it was read")
        self.position += count
        return data

    def seek(self, position: int) -> None:
        """Go on at `position`, which is not behind the cursor.

        Raises:
            FileFormatError: If it is, or lies beyond the end.
        """
        self.expect(position - self.position)
        self.position = position
        self._stream.seek(position)

    def unpack(self, layout: str) -> Any:
        """The next little-endian value of `layout` (as `struct`), or a tuple of several."""
        form = _form(layout)
        values = form.unpack(self.take(form.size))
        return values[0] if len(values) == 1 else values

    def string(self) -> bytes:
        """The next string. Reference: `util/Name.h`, `readString`."""
        return self.take(self.unpack("I"))


@cache
def _form(layout: str) -> struct.Struct:
    return struct.Struct(f"<{layout}")


def encode_string(text: bytes) -> bytes:
    """`text` as the format stores it. Reference: `util/Name.h`, `writeString`."""
    return struct.pack("<I", len(text)) + text
