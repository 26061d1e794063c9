"""Errors of estimates against a reference, what another system found at the same times.

An estimate is *sure and wrong* where its status says that it may be used and its error is beyond what its covariance
allows in all but one of a thousand cases: e' P^-1 e above the 0.999 quantile of chi-square. The errors of the reference
itself are not known, and count as the estimate's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from mathnavi.interfaces.signal_names import difference, name_and_unit
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.attitude_figures import attitude_figures, is_quaternion
from mathnavi.sim.records.sensor_log import EstimateHistory

_CHANCE = 1e-3  # of an error that counts as wrong


def reference_figures(found: EstimateHistory, t: Array, reference: Array, names: Sequence[str]) -> dict[str, float]:
    """Figures by the names of a summary, with units; NaN for one that cannot be had.

    Args:
        found: estimates (k, m) at times t [s].
        t: times (n,) [s] of the reference, that of each estimate among them.
        reference: values (n, m).
        names: "name [unit]" (m,) of either; the first two in metres are a position, an angle in radians a heading.

    Returns:
        Root mean squares over the times at which the estimate may be used, ``position_rms_m``, ``heading_rms_deg`` and
        ``rms NAME [UNIT]`` of all others; ``nees_mean`` there, by m, so that it is one of a consistent estimate;
        ``usable_share``, ``wrong_share`` of all times, and ``initialising_s``, when it could be used first. Of a
        quaternion, "NAME w [-]" and so on, those of ``attitude_figures``.
    """
    rows = np.clip(np.searchsorted(t, found.t - 1e-9), 0, len(t) - 1)
    usable, shares = found.usable, usable_figures(found)
    if is_quaternion(names):
        return {**attitude_figures(found.x, found.covariance, usable, reference[rows]), **shares}
    pairs = zip(names, found.x.T, reference[rows].T, strict=True)
    errors = np.column_stack([difference(name, x, true) for name, x, true in pairs])
    nees = squared_by_covariance(errors, found.covariance)
    units = [name_and_unit(name)[1] for name in names]
    position = [k for k, unit in enumerate(units) if unit == "m"][:2]
    figures: dict[str, float] = {}
    rest = list(range(len(names)))
    if len(position) == 2:
        distance = np.hypot(*errors[:, position].T)[usable]
        figures["position_rms_m"] = _rms(distance)
        figures["position_error_max_m"] = float(distance.max()) if len(distance) else math.nan
        rest = [k for k in rest if k not in position]
    if units.count("rad") == 1:
        heading = units.index("rad")
        figures["heading_rms_deg"] = math.degrees(_rms(errors[usable, heading]))
        rest.remove(heading)
    figures |= {f"rms {names[k]}": _rms(errors[usable, k]) for k in rest}
    wrong = usable & (nees > chdtri(len(names), _CHANCE))
    figures["nees_mean"] = float(nees[usable].mean()) / len(names) if usable.any() else math.nan
    figures["wrong_share"] = float(wrong.mean())
    return {**figures, **shares}


def usable_figures(found: EstimateHistory) -> dict[str, float]:
    """The share of all times at which an estimate may be used, and the time until it first may; NaN if it never may."""
    usable = found.usable
    first = float(found.t[int(np.argmax(usable))] - found.t[0]) if usable.any() else math.nan
    return {"usable_share": float(usable.mean()), "initialising_s": first}


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if len(errors) else math.nan


def squared_by_covariance(errors: Array, covariance: Array) -> Array:
    """e' P^-1 e (k,) of errors (k, m) with covariances (k, m, m); NaN without a covariance.

    An error in a direction that has no deviation, as a filter declares whose particles are all the same, is infinite.
    """
    nees = np.full(len(errors), np.nan)
    known = np.isfinite(covariance).all(axis=(1, 2))
    variances, axes = np.linalg.eigh(covariance[known])
    along = np.square(np.einsum("kmj,km->kj", axes, errors[known]))
    with np.errstate(divide="ignore"):
        terms = np.divide(along, np.maximum(variances, 0.0), out=np.zeros_like(along), where=along > 0.0)
    nees[known] = terms.sum(axis=1)
    return nees
