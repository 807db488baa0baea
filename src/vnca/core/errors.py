"""What can go wrong by a user's hand, one class a cause.

The command line prints the message of a `VncaError` in one line and exits with code 2.
A message names the file, grid or option, what was expected and what came. Parts of it may come
from a file: they can neither add lines nor write to the terminal what it would obey.
"""

_LONGEST = 2000
_LONGEST_SHOWN = 72


def printable(text: str) -> str:
    """`text` as one line of moderate length, without characters that a terminal obeys."""
    if len(text) > _LONGEST:
        text = text[:_LONGEST] + "…"
    line = " ".join(text.split("\n"))
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


class VncaError(Exception):
    """A mistake the user can mend; the message says how."""

    def __str__(self) -> str:
        return printable(super().__str__())


class FileFormatError(VncaError):
    """A file is missing, empty, truncated, corrupt or of an unsupported kind."""


class GridError(VncaError):
    """A grid is missing, of the wrong type, or does not fit its neighbours."""


class SequenceError(VncaError):
    """A pattern or a range of frames selects nothing or leaves gaps."""


class OptionError(VncaError):
    """An option or argument has a value that cannot work."""


class TextError(OptionError):
    """Text that stands for a value cannot be read as one; knows where it cannot.

    Attributes:
        text: The text.
        at: Number of the character, from 0, at which it is no longer one.
    """

    def __init__(self, message: str, text: str, at: int) -> None:
        super().__init__(message)
        self.text, self.at = text, at

    @property
    def pointer(self) -> list[str]:
        """The text, and a line with a caret under the character."""
        # Each character as one, or the caret would point beside it.
        shown = "".join(c if c.isprintable() else " " for c in self.text)
        start = max(0, self.at - _LONGEST_SHOWN // 2)
        return [shown[start : start + _LONGEST_SHOWN], " " * (self.at - start) + "^"]


class ShapeError(VncaError):
    """Arrays that must agree in shape do not."""


class ModelError(VncaError):
    """A model file is not one, is of a newer format, or is inconsistent."""


class BackendUnavailableError(VncaError):
    """A backend or frozen network was asked for by name and is not there."""


class OutputError(VncaError):
    """An output path cannot be written."""


class DivergenceError(VncaError):
    """Training left the range of numbers, and lower learning rates did not help."""


class DisagreementError(VncaError):
    """Backends that must compute the same do not."""


class OutOfMemoryError(VncaError):
    """The work asked for does not fit into memory."""


class Terminated(KeyboardInterrupt):
    """SIGTERM: the user, or who looks after the machine, wants an end as with Ctrl-C."""


class Cancelled(KeyboardInterrupt):
    """A `Watch` wants an end as with Ctrl-C: what is finished is kept, and work can go on later."""
