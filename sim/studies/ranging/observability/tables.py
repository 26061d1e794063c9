"""Rows and tables of the study ``observability``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mathnavi.renders.study_report import Table
from mathnavi.sim.records.statistics import Proportion
from mathnavi.sim.studies.ranging.observability.claims import RANKED, MapKey, ObservabilityResults
from mathnavi.sim.studies.ranging.observability.gramians import GramianResult
from mathnavi.sim.studies.ranging.observability.maps import ESTIMATORS, FIRST_ESTIMATES, SENSORS
from mathnavi.sim.studies.ranging.observability.measures import FlagsRank

DRAWN = tuple(name for name in ESTIMATORS if name != "fast observer")
"""the estimators that are compared over walls"""


def rows(
    e: ObservabilityResults, isolations: Mapping[tuple[str, float, str], float], gramians: Sequence[GramianResult]
) -> list[dict[str, Any]]:
    """Rows of the CSV, one for each thing that was measured, distinguished by ``what``."""
    return [
        *(_map_row(key, found, isolations[key[:3]]) for key, found in e.maps.items()),
        *(
            {"what": "states that read the same", "wall": wall, "sensors": sensors, "motion": motion,
             "least": min(n for n, _ in counts), "most": max(n for n, _ in counts), "states": len(counts)}
            for (wall, sensors, motion), counts in e.counts.items()
        ),
        *(
            {"what": "standing still" if still else "driving", "wall": "ellipse", "sensors": name, **_share(found)}
            for still, counts in ((True, e.still_found), (False, e.driving_found)) for name, found in counts.items()
        ),
        *(
            {"what": "two flags", "d_0_known": row.distance_known, "on_axis": row.on_axis, "u_1": row.u[0],
             "u_2": row.u[1], "order": row.order, "rank": row.rank, "least_singular_value": row.least}
            for row in e.flags
        ),
        *(
            {"what": "empirical Gramian", "scenario": found.case.scenario, "run": found.case.described,
             "unseen": found.unseen, "largest_deviation": None if found.unseen else float(found.deviations[0]),
             "worst": found.worst}
            for found in gramians
        ),
    ]  # fmt: skip


def _map_row(key: MapKey, found: Proportion, isolated: float) -> dict[str, Any]:
    family, value, sensors, estimator = key
    where = {"what": "map", "family": family, "value": value, "sensors": sensors, "estimator": estimator}
    return {**where, **_share(found), "isolation": isolated}


def _share(found: Proportion) -> dict[str, Any]:
    return {
        "starts": found.trials, "converged": found.events, "share": found.value, "low": found.low, "high": found.high,
    }  # fmt: skip


def map_table(e: ObservabilityResults, isolations: Mapping[tuple[str, float, str], float]) -> Table:
    """Shares of starts that converge, of the observer beside the EKF."""
    columns = ("family", "value", "sensors", "isolation [m/(m, rad)]", *(f"{name}: converged" for name in DRAWN))
    shown = [
        (family, f"{value:.3g}", sensors, f"{isolated:.3f}",
         *(e.maps[family, value, sensors, name].text() for name in DRAWN))
        for (family, value, sensors), isolated in isolations.items()
    ]  # fmt: skip
    return Table("How the map decides: starts from which the true state is found", columns, shown)


def count_table(e: ObservabilityResults) -> Table:
    """Table of how many states read the same."""
    motions = list(dict.fromkeys(motion for _, _, motion in e.counts))
    shown = []
    for wall, sensors in dict.fromkeys((wall, sensors) for wall, sensors, _ in e.counts):
        cells = [_counts(e.counts[wall, sensors, motion]) for motion in motions]
        shown.append((wall, e.rotations[wall], sensors, *cells))
    return Table("States that read the same, the true one counted", ("wall", "rotations", "sensors", *motions), shown)


def _counts(counts: Sequence[tuple[int, int]]) -> str:
    """The numbers that were found, or that there is no end of them."""
    if any(n > 20 for n, _ in counts):
        return "a continuum"
    return " or ".join(str(n) for n in sorted({n for n, _ in counts}))


def standing_table(e: ObservabilityResults) -> Table:
    """Table of the worth of standing still, by the number of sensors."""
    columns = ("sensors", "directions [°]", "poses with rank h' = 3", "least singular value, median", "standing still",
               "figure of eight")  # fmt: skip
    shown = []
    for name, angles in SENSORS.items():
        least, directions = e.still_ranks[name], " ".join(f"{angle:g}" for angle in angles)
        full = f"{(least > RANKED).sum()} of {len(least)}"
        found = e.still_found[name].text(), e.driving_found[name].text()
        shown.append((name, directions, full, f"{np.median(least):.3f}", *found))
    return Table(
        f"Poses of the standard ellipse found to 1 mm and 1 mrad, from most of {FIRST_ESTIMATES} first estimates that "
        "are off by .03 m and .03 rad",
        columns,
        shown,
    )


def flags_table(flags: Sequence[FlagsRank]) -> Table:
    """Example C.2."""
    columns = (
        "d_0",
        "flags' axis",
        "u_1 [m/s]",
        "u_2 [rad/s]",
        "order",
        "rank",
        "of",
        "least singular value but noughts",
    )
    shown = []
    for row in flags:
        where = "known" if row.distance_known else "unknown", "on it" if row.on_axis else "off it"
        inputs = f"{row.u[0]:g}", f"{row.u[1]:g}"
        shown.append((*where, *inputs, row.order, row.rank, 3 if row.distance_known else 4, f"{row.least:.2g}"))
    return Table("Example C.2: rank of d(h, y', ..., y^(order)) with the input held", columns, shown)


def gramian_table(gramians: Sequence[GramianResult]) -> Table:
    """Empirical Gramians of scenarios."""
    columns = ("scenario", "run", "components", "unseen directions", "deviation of the least seen", "which is")
    shown = [
        (found.case.scenario, found.case.described, len(found.deviations), found.unseen,
         "–" if found.unseen else f"{found.deviations[0]:.3g}", found.worst)
        for found in gramians
    ]  # fmt: skip
    return Table(
        "Empirical observability Gramians: what readings say of the start, in the state's own units", columns, shown
    )
