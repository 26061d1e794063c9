"""Arrays of a run's log and their shapes: n samples, k estimates, p plans with b breakpoints in all.

| array | shape |
|---|---|
| ``t`` | (n,) [s], increasing |
| ``truth.x``, ``command.u``, ``measurement.NAME`` | (n, any) |
| ``truth.activation`` | (n, any), where actuators have their own states |
| ``truth.estimands`` | (n, any), where the scenario declares what there is to estimate |
| ``cramer_rao.deviation`` | (n, any) |
| ``estimate.t``, ``estimate.x``, ``estimate.NAME`` | (k,) [s], (k, any), (k, ...), ``deviation`` one of the names |
| ``plan.offsets`` | (p + 1,) from 0 to b: index of the breakpoint at which each plan begins |
| ``plan.t``, ``plan.x``, ``plan.u``, ``plan.phase`` | (b,) [s], (b, any), (b, any), (b,) |
| ``plan.adopted``, ``plan.cost`` | (p,) [s], (p,) |

Plans are finite, but for the input of each one's last breakpoint. In the log of a fleet the name of the vehicle is the
prefix of all names but ``t``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.log import DEVIATION as DEVIATION

TIME, TRUTH, COMMAND = "t", "truth.x", "command.u"
ACTIVATION, ESTIMANDS = "truth.activation", "truth.estimands"
CRAMER_RAO = "cramer_rao.deviation"
SAMPLED, ESTIMATED, PLANNED = "measurement.", "estimate.", "plan."
_LATER = 1e-6  # [s] by which an estimate may be later than the last sample, for rounding
MOST = 1e150  # of commands and plans, so that their squares are finite
_PLANS = {"t": 1, "x": 2, "u": 2, "phase": 1}  # dimensions of the arrays that have a row for each breakpoint


def check_arrays(arrays: Mapping[str, Array], path: Path, prefix: str = "") -> None:
    """Raise RunFolderError for an array of a vehicle that is missing, or has another shape than above.

    ``prefix`` is the prefix of the names in the file.
    """
    names = (TIME, TRUTH, COMMAND)
    if missing := [name if name == TIME else f"{prefix}{name}" for name in names if name not in arrays]:
        if not prefix and any(name.endswith(f".{TRUTH}") for name in arrays):
            raise RunFolderError(f"{str(path)!r} is the log of a fleet; allowed: the run of a single vehicle")
        raise RunFolderError(f"{str(path)!r} lacks {', '.join(missing)}")
    t, x, u = (arrays[name] for name in names)
    if not (t.ndim == 1 and len(t) >= 2 and all(rows.ndim == 2 and len(rows) == len(t) for rows in (x, u))):
        raise RunFolderError(
            f"{str(path)!r}: t {t.shape}, {prefix}truth.x {x.shape} and {prefix}command.u {u.shape} are not (n,), "
            "(n, nx) and (n, nu) with n at least 2"
        )
    if not (np.isfinite(t).all() and (np.diff(t) > 0.0).all()):
        raise RunFolderError(f"{str(path)!r}: t is not finite and increasing")
    for name, rows in arrays.items():
        if (name.startswith(SAMPLED) or name in (ACTIVATION, ESTIMANDS, CRAMER_RAO)) and not (
            rows.ndim == 2 and len(rows) == len(t)
        ):
            raise _wrong(path, prefix, name, rows, f"({len(t)}, any)")
    if not (np.abs(u) <= MOST).all():
        raise RunFolderError(f"{str(path)!r}: {prefix}{COMMAND} is not finite, or beyond {MOST:g}")
    if "estimate.t" in arrays and (arrays["estimate.t"] > t[-1] + _LATER).any():
        raise RunFolderError(f"{str(path)!r}: {prefix}estimate.t goes on after the last sample, at {t[-1]:g} s")
    _check_estimates(arrays, path, prefix)
    _check_plans(arrays, path, prefix)


def _check_estimates(arrays: Mapping[str, Array], path: Path, prefix: str) -> None:
    of_estimates = {name: rows for name, rows in arrays.items() if name.startswith(ESTIMATED)}
    if not of_estimates:
        return
    times = of_estimates.get("estimate.t", np.empty(()))
    if times.ndim != 1 or not (np.isfinite(times).all() and (np.diff(times) >= 0.0).all()):
        raise RunFolderError(f"{str(path)!r}: {prefix}estimate.t is not (k,), finite and increasing")
    if "estimate.x" not in of_estimates:
        raise RunFolderError(f"{str(path)!r} lacks {prefix}estimate.x")
    for name, rows in of_estimates.items():
        if rows.ndim < 1 or len(rows) != len(times) or (name == "estimate.x" and rows.ndim != 2):
            raise _wrong(path, prefix, name, rows, f"({len(times)}, any)")


def _check_plans(arrays: Mapping[str, Array], path: Path, prefix: str) -> None:
    of_plans = {name.removeprefix(PLANNED): rows for name, rows in arrays.items() if name.startswith(PLANNED)}
    if not of_plans:
        return
    if missing := [name for name in ("offsets", *_PLANS, "adopted", "cost") if name not in of_plans]:
        raise RunFolderError(f"{str(path)!r} lacks {', '.join(f'{prefix}{PLANNED}{name}' for name in missing)}")
    offsets, breakpoints = of_plans["offsets"], len(np.atleast_1d(of_plans["t"]))
    if not (
        offsets.ndim == 1
        and offsets.dtype.kind in "iu"
        and len(offsets) >= 2
        and (offsets[0], offsets[-1]) == (0, breakpoints)
        and (np.diff(offsets.astype(np.int64)) > 0).all()
    ):
        raise RunFolderError(
            f"{str(path)!r}: {prefix}plan.offsets {offsets.shape} are not whole numbers that increase from 0 to the "
            f"{breakpoints} breakpoints of {prefix}plan.t"
        )
    for name, ndim in _PLANS.items():
        rows = of_plans[name]
        if rows.ndim != ndim or len(rows) != breakpoints:
            raise _wrong(path, prefix, f"{PLANNED}{name}", rows, f"({breakpoints},{' any' * (ndim - 1)})")
    held = np.setdiff1d(np.arange(breakpoints), offsets[1:].astype(np.int64) - 1)  # the last of a plan holds no input
    for name, rows in (("x", of_plans["x"]), ("u", of_plans["u"][held])):
        if not (np.abs(rows) <= MOST).all():
            raise RunFolderError(f"{str(path)!r}: {prefix}plan.{name} is not finite, or beyond {MOST:g}")
    for name in ("adopted", "cost"):
        if (rows := of_plans[name]).shape != (len(offsets) - 1,):
            raise _wrong(path, prefix, f"{PLANNED}{name}", rows, f"({len(offsets) - 1},)")
    if not (np.isfinite(of_plans["t"]).all() and (np.diff(of_plans["adopted"]) >= 0.0).all()):
        raise RunFolderError(f"{str(path)!r}: {prefix}plan.t is not finite, or {prefix}plan.adopted does not increase")


def _wrong(path: Path, prefix: str, name: str, rows: Array, allowed: str) -> RunFolderError:
    return RunFolderError(f"{str(path)!r}: {prefix}{name} has the shape {rows.shape}; allowed: {allowed}")
