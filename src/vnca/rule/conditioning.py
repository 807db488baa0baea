"""What a rule is conditioned on beside its perception: a list of inputs by name.

Reference: VNCA section 3.3, "Encoding Priors".
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import GridError, OptionError, ShapeError
from vnca.core.lattice import Placement
from vnca.core.volume import Volume
from vnca.engine.domain import Domain

if TYPE_CHECKING:
    from vnca.rule import Rule

SPEED_LIMIT = 2.0
"""No cell is conditioned on a normalised speed above this: training has hardly met faster smoke,
and what a rule has not met it paints badly. Nor must a file in other units blow a state up."""
DENSITY_LIMIT = 4.0
"""Nor on a greater normalised density."""
STYLES = tuple(f"style_{number}" for number in range(1, 9))
"""What a rule of several styles is conditioned on: the share of each, all of them together 1. It
lists as many of them, the first ones in this order, as it has styles."""
_SQUARABLE = 1e18
"""Single precision holds the square of it."""


@dataclass(frozen=True)
class Conditioning:
    """One input of a rule: some numbers that every cell is conditioned on.

    Attributes:
        name: By which configurations and model files list it.
        width: How many numbers a cell.
        values: What the cells of a domain are conditioned on in a frame, `[n, width]`, from domain,
            smoke and rule; about as large as 1. It is called once a frame.
        scale: Of a named field the value that counts as 1; such an input needs nothing but what a
            model file holds. None of what is computed.
    """

    name: str
    width: int
    values: Callable[[Domain, Volume, "Rule"], FloatArray]
    scale: float | None = None

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise OptionError(f"`name` {self.name!r}: expected a name, of letters, digits and _")
        if self.width < 1:
            raise OptionError(f"`width` {self.width}: at least one number is needed")

    @classmethod
    def of_field(cls, name: str, *, width: int = 1, scale: float = 1.0) -> "Conditioning":
        """A named field of the smoke, such as its temperature: see `Volume.fields`.

        Args:
            name: That of the field.
            width: How many numbers it has at a cell.
            scale: The value that counts as 1.

        Raises:
            OptionError: If the name, the width or the scale cannot be.
        """
        if not 0 < abs(scale) < np.inf:
            raise OptionError(f"`scale` {scale}: must be finite, and not 0")

        def values(domain: Domain, smoke: Volume, rule: "Rule") -> FloatArray:
            del rule
            field = smoke.named_fields.get(name)
            if field is None:
                raise GridError(
                    f"frame {smoke.frame}: the rule is conditioned on {name}, and the smoke has no "
                    "such field; name it in `fields`"
                )
            given = field.gather(domain.cells).reshape(len(domain), -1) / scale
            return given.astype(np.float32)

        return cls(name, width, values, scale)


def is_known(name: str) -> bool:
    """Whether an input of a name is registered, or one of vnca's own."""
    return name in _KNOWN


def conditioning_named(name: str) -> Conditioning:
    """A registered input.

    Raises:
        OptionError: If there is none of that name.
    """
    if name not in _KNOWN:
        raise OptionError(
            f"`conditioning` {name}: expected some of {', '.join(_KNOWN)}; others have to be made "
            "known with `register_conditioning` first"
        )
    return _KNOWN[name]


def register_conditioning(conditioning: Conditioning) -> None:
    """Make an input known, so that rules can list it, and models that do can be read.

    It takes the place of one of the same name that was registered before.

    Raises:
        OptionError: If it is named like one of vnca's own.
    """
    if conditioning.name in _OWN:
        raise OptionError(f"`name` {conditioning.name}: expected another than {', '.join(_OWN)}")
    _KNOWN[conditioning.name] = conditioning


def columns(names: Iterable[str]) -> Mapping[str, slice]:
    """Which columns of the conditioning `[n, P]` each of some inputs takes, in their order.

    Raises:
        OptionError: If one is not known.
    """
    found, begin = {}, 0
    for name in names:
        end = begin + conditioning_named(name).width
        found[name], begin = slice(begin, end), end
    return found


def priors(domain: Domain, smoke: Volume, rule: "Rule") -> FloatArray:
    """What the cells of a domain are conditioned on: `[n, P]`, the rule's inputs in their order.

    Inputs that the rule switches off, and velocity where the smoke has none, are zero. A rule of
    several styles is to paint in its first: see `in_shares` for others.

    Raises:
        GridError: If the smoke lacks what the rule is conditioned on.
        ShapeError: If a registered input gives another number of values than it says.
    """
    config = rule.config
    given = np.zeros((len(domain), config.conditioning_width), dtype=np.float32)
    for name, where in columns(config.conditioning).items():
        if not config.is_conditioned_on(name):
            continue
        values = conditioning_named(name).values(domain, smoke, rule)
        if values.shape != given[:, where].shape:
            raise ShapeError(
                f"conditioning {name}: expected {given[:, where].shape} values, got {values.shape}"
            )
        if not np.isfinite(values).all():
            raise GridError(f"frame {smoke.frame}: conditioning {name}: not all finite")
        given[:, where] = values
    return given


def in_shares(conditioning: AnyArray, rule: "Rule", shares: AnyArray) -> FloatArray:
    """What cells are conditioned on, `[n, P]`, of a rule of several styles that is to mix them.

    Args:
        conditioning: `[n, P]`; it stays as it is.
        rule: Of K styles.
        shares: Of each style, together 1: `[K]`, or `[n, K]` where they differ from cell to cell.
    """
    where = rule.config.style_columns
    assert where is not None, "a rule of one style has nothing to mix"
    mixed = conditioning.copy()
    mixed[:, where] = shares
    return mixed


def _position(domain: Domain, smoke: Volume, rule: "Rule") -> FloatArray:
    """(2i + 1)/H − 1, −1 to 1, in the box where the rule was trained.

    What lies outside counts as at its border. Of a rule that does not know where that was, it
    is the domain's box.
    """
    box, cells = domain.box, domain.cells
    if rule.place is not None:
        there = rule.place.lattice.to_world
        place = Placement.between(smoke.index_to_world, there, domain.box, f"frame {smoke.frame}")
        box, cells = rule.place.box, place.cells(cells)
    at = (2 * (cells - np.asarray(box.lower)) + 1) / np.asarray(box.shape) - 1
    return np.clip(at, -1, 1).astype(np.float32)


def _density(domain: Domain, smoke: Volume, rule: "Rule") -> FloatArray:
    density = smoke.density_field.gather(domain.cells)
    return np.minimum(density / rule.scales.density, DENSITY_LIMIT)[:, None]


def _velocity(domain: Domain, smoke: Volume, rule: "Rule") -> FloatArray:
    if smoke.velocity_field is None:
        return np.zeros((len(domain), 3), np.float32)
    return normalised_velocity(smoke.velocity_field.gather(domain.cells), rule)


def normalised_velocity(velocity: FloatArray, rule: "Rule") -> FloatArray:
    """What cells are conditioned on of a velocity `[n, 3]`, cells per frame, limited in speed.

    Zero if the rule switches it off.
    """
    if not rule.config.velocity_prior:
        return np.zeros_like(velocity)
    given = np.clip(velocity / rule.scales.velocity, -_SQUARABLE, _SQUARABLE)
    speed = np.linalg.norm(given, axis=-1, keepdims=True)
    return given * (SPEED_LIMIT / np.maximum(speed, SPEED_LIMIT))


def _share(number: int) -> Callable[[Domain, Volume, "Rule"], FloatArray]:
    """All of the first style, nothing of the others."""

    def values(domain: Domain, smoke: Volume, rule: "Rule") -> FloatArray:
        del smoke, rule
        return np.full((len(domain), 1), number == 0, np.float32)

    return values


# To give every rule a further input to choose from, list it here.
_OWN = {
    each.name: each
    for each in (
        Conditioning("position", 3, _position),
        Conditioning("density", 1, _density),
        Conditioning("velocity", 3, _velocity),
        *(Conditioning(name, 1, _share(number)) for number, name in enumerate(STYLES)),
    )
}
_KNOWN = dict(_OWN)
