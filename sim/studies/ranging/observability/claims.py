"""Claims of the study ``observability``, evaluated from its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Proportion
from mathnavi.sim.studies.ranging.observability.maps import FIRST_ESTIMATES, SENSORS
from mathnavi.sim.studies.ranging.observability.measures import FlagsRank, PropositionTrial

MapKey = tuple[str, float, str, str]
"""family, value, sensors, estimator"""

ACTIVE_INPUT = "figure of eight"
FEW = ("1", "2s", "2t")  # sensors of which standing still is not enough
RANKED = 1e-6  # [m per m or rad] a least singular value above which the rank is full
FAILING, FINDING = 0.1, 0.85  # shares of starts from which a robot that stands still does not, and does, find itself


@dataclass(frozen=True)
class ObservabilityResults:
    """Results from which the claims are evaluated."""

    counts: Mapping[tuple[str, str, str], Sequence[tuple[int, int]]]  # by wall, sensors, motion: states, known images
    rotations: Mapping[str, int]  # of each wall
    still_ranks: Mapping[str, Array]  # by sensors: least singular values of h' over poses
    still_found: Mapping[str, Proportion]  # by sensors: poses that are found exactly
    driving_found: Mapping[str, Proportion]
    flags: Sequence[FlagsRank]
    moving: Sequence[PropositionTrial]
    standing: Sequence[PropositionTrial]
    equal_rates: Array  # [m] least differences of the output flow on {Q = 0}, NaN where it does not reach
    maps: Mapping[MapKey, Proportion]


def claims(e: ObservabilityResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    return [*_targets(e), *_definitions(e), _of_the_map(e)]


def _targets(e: ObservabilityResults) -> list[Claim]:
    ellipse = [
        pair for key, counts in e.counts.items() if key[0] == "ellipse" and key[2] == ACTIVE_INPUT for pair in counts
    ]
    full = {name: int((values > RANKED).sum()) for name, values in e.still_ranks.items()}
    ranks = ", ".join(f"{name}: {full[name]} of {len(e.still_ranks[name])}" for name in SENSORS)
    found = ", ".join(f"{name}: {e.still_found[name].value:.0%}" for name in SENSORS)
    many = [name for name in SENSORS if name not in FEW]
    return [
        Claim(
            "range.indistinguishable", "target", "In the ellipse exactly two states are indistinguishable.", "C.2, C.4",
            "x and its image under the half-turn, with 1 to 4 sensors and a figure of eight: 2 at every state",
            f"{sum(pair == (2, 2) for pair in ellipse)} of {len(ellipse)} states have exactly that one other; "
            f"{_elsewhere(e)}",
            all(pair == (2, 2) for pair in ellipse),
        ),
        Claim(
            "range.standing-still", "target", "Standing still is not enough with one or two sensors only.", "2.3, C.3",
            f"rank h' < 3 at every pose and at most {FAILING:.0%} found to 1 mm with one or two; rank 3 at every pose "
            f"and at least {FINDING:.0%} with three and more (first estimates off by .03 m and .03 rad; found from "
            f"most of {FIRST_ESTIMATES})",
            f"poses with rank 3: {ranks}; found: {found}",
            all(full[n] == 0 and e.still_found[n].value <= FAILING for n in FEW)
            and all(full[n] == len(e.still_ranks[n]) and e.still_found[n].value >= FINDING for n in many),
        ),
        _flags(e.flags),
    ]  # fmt: skip


def _elsewhere(e: ObservabilityResults) -> str:
    parts = []
    for wall, rotations in e.rotations.items():
        counts = {n for key, pairs in e.counts.items() if key[0] == wall and key[2] == ACTIVE_INPUT for n, _ in pairs}
        if wall != "ellipse":
            parts.append(f"{wall} (rotations: {rotations}) {_set(counts)}")
    return "elsewhere " + ", ".join(parts)


def _flags(flags: Sequence[FlagsRank]) -> Claim:
    stands = {row.rank for row in flags if row.u[0] == 0.0}
    straight = {row.rank for row in flags if row.on_axis and row.u[1] == 0.0}
    moves, arcs = (
        tuple(
            {row.rank for row in flags if row.distance_known is known and row.u[0] != 0.0 and wanted(row)}
            for known in (True, False)
        )
        for wanted in (_first_order_off_axis, _second_order_on_arc)
    )
    return Claim(
        "range.flags-ranks", "target", "Two flags and a camera localise a robot that moves.", "Example C.2",
        "d(h, y') has rank 3 (d_0 known) and 4 (unknown) where u_1 != 0 and less than 3 where u_1 = 0; along the "
        "flags' axis straight on is not enough, an arc is",
        f"u_1 = 0: {_set(stands)}; u_1 != 0: {_set(moves[0])} and {_set(moves[1])}; along the axis straight on "
        f"{_set(straight)}, on an arc with y'' {_set(arcs[0])} and {_set(arcs[1])}",
        max(stands) < 3 and max(straight) < 3 and moves == arcs == ({3}, {4}),
    )  # fmt: skip


def _first_order_off_axis(row: FlagsRank) -> bool:
    return not row.on_axis and row.order == 1


def _second_order_on_arc(row: FlagsRank) -> bool:
    return row.on_axis and row.order == 2 and row.u[1] != 0.0


def _set(values: set[int]) -> str:
    return "/".join(str(value) for value in sorted(values))


def _definitions(e: ObservabilityResults) -> list[Claim]:
    n, moving, standing = len(e.moving), e.moving, e.standing
    promised = [trial for trial in (*moving, *standing) if trial.singleton]
    kept = sum(trial.weakly_observable for trial in promised)
    weakly = sum(trial.weakly_observable for trial in moving)
    wholly = sum(trial.weakly_observable and trial.others == 0 for trial in moving)
    still = sum(trial.singleton for trial in standing)
    met = sum(trial.singleton for trial in moving)
    apart = e.equal_rates[np.isfinite(e.equal_rates)]
    found = ", ".join(f"{name}: {e.still_found[name].value:.0%}" for name in SENSORS)
    return [
        Claim(
            "C.small-time", "printed", "Small-time observable at x_1: for any x_2 some input makes a difference by T.",
            "Definition C.8", "for every x_2, x_2 = x_1 not excepted",
            "with x_2 = x_1 none can, so as printed no state is; with x_2 != x_1 the ellipse is so, weakly, at "
            f"{weakly} of {n} states, and for all x_2 at {wholly}, because of the image",
            False,
        ),
        Claim(
            "C.proposition-1", "printed",
            "Where FS_y, OF and a neighbourhood have x_0 alone in common, it is weakly small-time observable there.",
            "Proposition C.1", "whenever (C.1) holds, no state nearby reads the same, over .3 s nor over .03 s",
            f"so at {kept} of {len(promised)} states where (C.1) holds, of {n} in motion and {len(standing)} at rest",
            kept == len(promised) > 0,
        ),
        Claim(
            "C.singleton", "printed", "Under suitable assumptions the two sets fulfil what Proposition C.1 asks for.",
            "C.4", "with two sensors (C.1) holds at every state in motion; standing still it cannot",
            f"in motion at {met} of {n}, standing still at {still} of {len(standing)}",
            met == n and still == 0,
        ),
        Claim(
            "C.output-flow", "printed", "Q = 0 characterises the set of output flow equivalent states.", "C.4",
            "on {Q = 0}, the ranges change by the same amounts (.3 s)",
            f"only at first: beyond .1 m of the state and its image they differ by {apart.min():.2g} m at least, "
            f"{np.median(apart):.2g} m in the median of {len(apart)} states",
            bool(apart.min() < 1e-9),
        ),
        Claim(
            "C.zero-input", "printed", "Standing still, convergence of the observer is not possible.", "2.3",
            "no start from which the state is found, whatever the number of sensors",
            f"found to 1 mm: {found}; from three sensors on the ranges alone fix the state",
            max(each.value for each in e.still_found.values()) <= FAILING,
        ),
    ]  # fmt: skip


def _of_the_map(e: ObservabilityResults) -> Claim:
    """Evaluate the claim for two sensors: from one to three their number would say more than the wall."""
    shares = {key: found for key, found in e.maps.items() if key[2] in ("2s", "2t") and key[3] == "observer"}
    least, most = min(shares, key=lambda key: shares[key].value), max(shares, key=lambda key: shares[key].value)
    return Claim(
        "C.map", "printed", "The convergence of the observer depends on the environment.", "C.6; left open in 3.2",
        "two sensors: between walls the shares of starts that converge differ beyond their 95 % limits",
        f"from {_rate_text(least, shares[least])} to {_rate_text(most, shares[most])}",
        shares[least].high < shares[most].low,
    )  # fmt: skip


def _rate_text(key: MapKey, found: Proportion) -> str:
    return f"{key[0]} {key[1]:.3g} with {key[2]}: {found.text()}"
