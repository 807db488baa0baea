"""Whether backends compute the same: times of those that do not mean nothing."""

from collections.abc import Iterable
from typing import NamedTuple

from vnca.core.errors import DisagreementError


class Difference(NamedTuple):
    """How far a backend is from what is right.

    Attributes:
        backend: Its name.
        what: The array that was compared.
        error: Norm of the difference over the norm of what is right.
        allowed: What rounding can explain.
    """

    backend: str
    what: str
    error: float
    allowed: float


def require_agreement(differences: Iterable[Difference]) -> None:
    """End here unless all backends compute the same.

    Raises:
        DisagreementError: If one is further off than rounding can explain, or not a number.
    """
    found = [
        f"{d.backend}: {d.what} is off by {d.error:.1e} (allowed: {d.allowed:.0e})"
        for d in differences
        if not d.error <= d.allowed
    ]
    if found:
        raise DisagreementError(f"the backends disagree, so nothing was timed: {'; '.join(found)}")
