"""Parts of an observer in the sense of Definition 2.1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import casadi
from annotated_types import Interval

from mathnavi.interfaces.bounds import Each, Within
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.number_lists import NumberList
from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.mission import TextbookMission

LARGEST_RATE = 1e4  # [1/s] of a gain or a pole: faster ones would need too small steps
_ALLOWED = f"finite values from -{LARGEST_RATE:g} to {LARGEST_RATE:g}"
_RATES = Interval(ge=-LARGEST_RATE, le=LARGEST_RATE)

RateOfError = Annotated[float, Within(_RATES, allowed=_ALLOWED)]
Poles = Annotated[NumberList, Each(_RATES, allowed=_ALLOWED)]


@dataclass(frozen=True, eq=False)
class ObserverLaw:
    """Observer z' = F^(z, u, y), x^ = Phi(z); z tracks Psi(x) (Figure 2.1)."""

    size: int  # of z
    F: Callable[[casadi.SX, casadi.SX, casadi.SX], casadi.SX]  # (z, u, y) -> z'
    Psi: Callable[[Array], Array]  # (n,) -> (size,)
    Phi: Callable[[Array, Array], Array | None]  # (z, an x nearby) -> x^ (n,); None if there is none


def identity(x: Array, near: Array | None = None) -> Array:
    """Copy of x (n,): Psi and Phi of an identity observer (Definition 2.3)."""
    return x.copy()


def check_system(fits: bool, mission: TextbookMission, allowed: str) -> None:
    """Raise FieldError unless the mission's system ``fits`` the observer."""
    if not fits:
        raise FieldError(f"system = {mission.system.name!r}; allowed with this observer: {allowed}")
