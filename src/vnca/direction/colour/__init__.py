"""What is done with the colours of a painting, by what was asked and by the pictures of styles."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import parse_colour
from vnca.core.errors import OptionError
from vnca.direction.colour.oklab import oklab
from vnca.direction.colour.palette import Matching, Recolouring, main_colours
from vnca.io.picture import read_image

_EXCHANGE = re.compile(r"\s*(\d+|#[0-9a-fA-F]{6})\s*=\s*(#[0-9a-fA-F]{6})\s*")


@dataclass(frozen=True, eq=False)
class Editing:
    """Changes to the colours as a whole, made ready once for a painting."""

    changes: tuple[Recolouring | Matching, ...] = ()

    def of(self, colour: FloatArray) -> FloatArray:
        """Linear RGB `[n, 3]`, changed."""
        for change in self.changes:
            colour = change.of(colour)
        return colour

    @classmethod
    def asked(
        cls, recolour: Sequence[str], match: Path | None, picture: AnyArray | None
    ) -> "Editing":
        """What some options ask for.

        Args:
            recolour: Exchanges, each as `require_exchange` wants it.
            match: A picture whose palette is wanted.
            picture: That of the style, `[r, c, 3]`, linear RGB; None if the model has none.

        Raises:
            OptionError: If there is no such colour, or no picture to know it from.
            FileFormatError: If the picture to match cannot be read.
        """
        changes: list[Recolouring | Matching] = []
        if (recolour or match is not None) and picture is None:
            name = "recolour" if recolour else "match"
            raise OptionError(f"`{name}`: the model has no picture whose colours could be changed")
        if recolour:
            changes.append(_recolouring(recolour, main_colours(picture)))  # type: ignore[arg-type]
        if match is not None:
            changes.append(Matching.between(picture, read_image(match)))  # type: ignore[arg-type]
        return cls(tuple(changes))


def require_exchange(text: str) -> tuple[str, str]:
    """An old colour and the new one: `#aabbcc=#112233`, or a number of the palette for the old.

    Raises:
        OptionError: If the text is none.
    """
    found = _EXCHANGE.fullmatch(text)
    if found is None:
        raise OptionError(
            f"`recolour` {text!r}: expected OLD=NEW, such as #1b2a49=#7a1f1f or 2=#7a1f1f"
        )
    return found[1], found[2]


def _recolouring(recolour: Sequence[str], main: AnyArray) -> Recolouring:
    old, new = main.copy(), main.copy()
    for text in recolour:
        before, after = require_exchange(text)
        if before.startswith("#"):
            wanted = oklab(np.array(parse_colour(before)))
            which = int(np.linalg.norm(main - wanted, axis=1).argmin())
            old[which] = wanted
        else:
            which = int(before) - 1
            if not 0 <= which < len(main):
                raise OptionError(
                    f"`recolour` {text!r}: the picture has main colours 1 to {len(main)}"
                )
        new[which] = oklab(np.array(parse_colour(after)))
    return Recolouring(old, new)
