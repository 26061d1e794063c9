"""Claims of the study ``active-control``, evaluated from its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Band
from mathnavi.sim.studies.ranging.active_control.flights import (
    COMPARED,
    FAST,
    LIMIT,
    LIMITS,
    SENSES_FIRST,
    SLOW,
    TRACKS,
)

SOONER = {"circle": 2.0, "random": 4.0}  # times, that active inputs shall be
_LEAST = 1e-9  # [s]

Key = tuple[str, float]
"""mode, bound of the turn rate [rad/s]"""


@dataclass(frozen=True)
class ActiveControlResults:
    """Results from which the claims are evaluated."""

    medians: Mapping[Key, Band]  # [s] until the error is below the limit for good
    found: Mapping[Key, tuple[int, int]]  # runs in which it is so before the end, of so many
    touched: Mapping[Key, int]  # runs in which the robot touched the wall
    tracks: Mapping[str, Sequence[Mapping[str, Any]]]  # summaries of runs that keep a path
    searched: Mapping[tuple[str, float], Band]  # [s] with the pose known, by mode or "best" and limit [m]
    seconds: float  # of a run

    def factor(self, mode: str, turn_rate: float) -> float:
        """Ratio of the times until a robot finds itself: another mode's over that of active inputs."""
        return self.medians[mode, turn_rate].median / max(_LEAST, self.medians["active", turn_rate].median)

    def sooner(self, mode: str, limit: float) -> float:
        """Ratio of the times until a known pose is found to a limit [m]: with random inputs over another mode's."""
        return self.searched["random", limit].median / self.searched[mode, limit].median


def claims(e: ActiveControlResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    return [_active(e), _limit(e), _decides(e), _basis(e), _deliberate(e)]


def _active(e: ActiveControlResults) -> Claim:
    slow = {mode: e.factor(mode, SLOW) for mode in SOONER}
    fast = " and ".join(f"{e.factor(mode, FAST):.2f} times sooner than {mode}" for mode in SOONER)
    bands = ", ".join(f"{mode} {e.medians[mode, SLOW].text()}" for mode in COMPARED)
    factors = " and ".join(f"{factor:.2f} times sooner than {mode}" for mode, factor in slow.items())
    return Claim(
        "range.active", "target", "Active inputs find the pose sooner than a fixed circle and than random inputs.",
        "C.1, C.3, C.6",
        f"at {SLOW} rad/s, two sensors and an EKF from .3 m and .3 rad: median time of the last error above {LIMIT} m "
        f"at least {SOONER['circle']:g} times sooner than the circle and {SOONER['random']:g} times than random inputs",
        f"{factors}; medians in s: {bands}; touched the wall: "
        f"{', '.join(f'{mode} {e.touched[mode, SLOW]}' for mode in COMPARED)}; at {FAST:g} rad/s {fast}",
        all(slow[mode] >= least for mode, least in SOONER.items()),
    )  # fmt: skip


def _limit(e: ActiveControlResults) -> Claim:
    found = (
        f"{limit} m: best {e.searched['best', limit].text()} s, {e.sooner('best', limit):.2f} times sooner than "
        f"random, active {e.sooner('active', limit):.2f} times"
        for limit in LIMITS
    )
    return Claim(
        "range.active-limit", "target",
        f"No inputs find the pose {SOONER['random']:g} times sooner than random ones.",
        "C.6",
        "with the pose known, the best of every sequence of inputs brings the posterior Cramer-Rao bound below "
        f"{LIMIT} m, and below {LIMITS[-1]} m, less than {SOONER['random']:g} times sooner than random inputs, in the "
        "median",
        "; ".join(found), all(e.sooner("best", limit) < SOONER["random"] for limit in LIMITS),
    )  # fmt: skip


def _decides(e: ActiveControlResults) -> Claim:
    slow = {mode: band for (mode, turn_rate), band in e.medians.items() if turn_rate == SLOW}
    soonest, latest = (pick(slow, key=lambda mode: slow[mode].median) for pick in (min, max))
    return Claim(
        "C.input-decides", "printed", "Observability, and how an observer converges, depend on the exciting control.",
        "C.1, C.6", "from the same starts, the medians of the best and of the worst input differ beyond their bands",
        f"{soonest} {slow[soonest].text()} s, {latest} {slow[latest].text()} s (a run ends after {e.seconds:g} s)",
        slow[soonest].high < slow[latest].low,
    )  # fmt: skip


def _basis(e: ActiveControlResults) -> Claim:
    own = e.medians["singular-value", SLOW]
    others = {mode: e.medians[mode, SLOW] for mode in COMPARED}
    return Claim(
        "C.basis", "printed",
        "How feasible and output-flow equivalent states meet may be the basis for the design of active observers.",
        "Abstract, C.3.1",
        "the input with the greatest least singular value of [dh; dh'/dt], to first order (C.1), finds the pose sooner "
        "than circle and random inputs",
        f"medians in s: singular-value {own.text()}, " + ", ".join(f"{m} {b.text()}" for m, b in others.items()),
        all(own.median < others[mode].median for mode in SOONER),
    )  # fmt: skip


def _deliberate(e: ActiveControlResults) -> Claim:
    shares = {mode: e.found[mode, SLOW] for mode in ("active", "random", "circle", "still")}
    first = [_sum(e.tracks[kind]) for kind in TRACKS]
    return Claim(
        "C.deliberate", "printed", "To succeed in reconstructing the state the exciting control has to be deliberate.",
        "C.6", f"within {e.seconds:g} s active inputs bring the error below {LIMIT} m for good more often than inputs "
        "that nobody chose, random ones and none",
        "found: " + ", ".join(f"{mode} {k} of {n}" for mode, (k, n) in shares.items())
        + f"; keeping a path on a slippery floor, touched the wall: {TRACKS[0]} {first[0]}, {SENSES_FIRST} {first[1]}",
        all(_share(shares["active"]) > _share(shares[mode]) for mode in ("random", "still")),
    )  # fmt: skip


def _share(found: tuple[int, int]) -> float:
    return found[0] / found[1]


def _sum(summaries: Sequence[Mapping[str, Any]]) -> str:
    return f"{sum(bool(one['touched_wall']) for one in summaries)} of {len(summaries)}"
