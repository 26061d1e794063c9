"""Transcriptions by name, for a problem that is solved in one call, and the one that a solver needs."""

from __future__ import annotations

from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.transcriptions.collocation import GaussLegendre, LegendreGaussLobatto, RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting, Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ProblemError

SCHEMES: dict[str, Scheme] = {
    "Hermite-Simpson": HermiteSimpson(),
    "trapezoid": Trapezoid(),
    "Radau": RadauIIA(),
    "Gauss-Legendre": GaussLegendre(),
    "Legendre-Gauss-Lobatto": LegendreGaussLobatto(),
    "multiple shooting": MultipleShooting(),
    "forward Euler": Euler(),
}
"""schemes by name, with their own numbers of points and steps"""


def chosen_scheme(scheme: Scheme | str | None, method: str, options: Options | None) -> Scheme | None:
    """The scheme of a call: the one that is given, itself or by its name, or multiple shooting for FATROP.

    None for the method's own. ProblemError for an unknown name, and for "hp", whose scheme is Radau collocation.
    """
    fatrop = options is not None and options.backend.startswith("fatrop")
    if method == "hp" and (fatrop or scheme is not None):
        what = f"backend = {options.backend!r}" if fatrop and options is not None else f"scheme = {_name(scheme)!r}"
        why = ", whose steps FATROP cannot solve for the state at their ends" if fatrop else ""
        raise ProblemError(
            f"{what} with method = 'hp': it collocates by Radau's scheme{why}; allowed: method = 'auto' or 'direct'"
            + (", which then shoot, or backend = 'ipopt'" if fatrop else " with a scheme, or no scheme")
        )
    if scheme is None:
        return SCHEMES["multiple shooting"] if fatrop else None
    if isinstance(scheme, str):
        if scheme not in SCHEMES:
            raise ProblemError(f"scheme = {scheme!r}; {allowed_for(scheme, list(SCHEMES), 'a Scheme')}")
        return SCHEMES[scheme]
    if not hasattr(scheme, "interval"):
        raise ProblemError(f"scheme = {scheme!r:.80}; allowed: {', '.join(SCHEMES)}, or a Scheme")
    return scheme


def _name(scheme: Scheme | str | None) -> str:
    return str(getattr(scheme, "name", scheme))
