"""Transcriptions by name."""

from __future__ import annotations

from collections.abc import Callable

from controllers.ocp.transcriptions.euler import Euler
from controllers.ocp.transcriptions.hermite_simpson import HermiteSimpson
from controllers.ocp.transcriptions.multiple_shooting import MultipleShooting
from controllers.ocp.transcriptions.pseudospectral import LegendreGaussLobatto
from controllers.ocp.transcriptions.scheme import Scheme
from controllers.ocp.transcriptions.trapezoid import Trapezoid

SCHEMES: dict[str, Callable[[], Scheme]] = {
    "euler": Euler,
    "trapezoid": Trapezoid,
    "hermite-simpson": HermiteSimpson,
    "multiple-shooting": MultipleShooting,
    "legendre-gauss-lobatto": LegendreGaussLobatto,
}


def scheme(name: str) -> Scheme:
    """The transcription called ``name`` as it comes by default; ValueError for one that is not known."""
    if name not in SCHEMES:
        raise ValueError(f"scheme = {name!r} is not known; allowed: {', '.join(SCHEMES)}")
    return SCHEMES[name]()
