"""Claims of the study ``range-observer``, evaluated from its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from mathnavi.estimators.ranging.observer import FeedForward
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.studies.ranging.range_observer.identities import Identities
from mathnavi.sim.studies.ranging.range_observer.observer_run import RunErrors
from mathnavi.sim.studies.ranging.range_observer.runs import (
    MOTIONS,
    MOVING,
    PRINTED_GAINS,
    SHOWN,
    TURNING,
    ObserverGains,
)

FEED_FORWARDS: tuple[FeedForward, ...] = tuple(name for name in get_args(FeedForward) if name != "none")
AS_PRINTED = ObserverGains("none", *PRINTED_GAINS)
OBSERVER = ObserverGains("s", *PRINTED_GAINS)
Q_ZERO, EXACT = 1e-7, 1e-9  # [m^2/s] of |Q|, [rad/s] and [rad] of a feed-forward on the truth
FALL = (4.0, 11.0)  # times by which the printed observer's error falls from k = 1 to k = 10
SAME = 1e-3  # [rad] by which z(0) as printed may be off Psi(x(0))
SMALL = 0.01  # [m] that counts as arbitrarily small
STILL = "standing still"


@dataclass(frozen=True)
class LockResults:
    """Results from which the claims are evaluated."""

    identities: Sequence[Identities]
    start_error: Array  # (3,) [rad] z(0) as printed less Psi(x(0))
    thesis: Mapping[tuple[str, FeedForward], Sequence[RunErrors]]  # by motion, at the printed gains, without noise
    noisy: Mapping[tuple[str, ObserverGains], Sequence[RunErrors]]  # by motion
    true_start: Mapping[FeedForward, RunErrors]  # from z(0) = Psi(x(0)), without noise
    drawn: Mapping[tuple[str, str, float], Sequence[RunErrors]]  # as printed, by sensors, drive and k, 100 readings/s
    fast: Mapping[tuple[str, float], Sequence[RunErrors]]  # likewise by sensors and k, 1000 readings/s
    averaged: Sequence[tuple[float, float]]  # [m] RMS errors by the mean of both rays and by the one that errs


def claims(e: LockResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    return [_identities(e), _as_printed(e), *_printed(e)]


def median(errors: Sequence[RunErrors], name: str = "position") -> float:
    """Median over runs of one of their errors."""
    return float(np.median([getattr(verdict, name) for verdict in errors]))


def locked(errors: Sequence[RunErrors]) -> int:
    """Number of runs that kept lock in X."""
    return sum(verdict.locked for verdict in errors)


def largest(identities: Sequence[Identities], name: str) -> float:
    """Largest residual of those that are not guarded."""
    return float(np.nanmax([getattr(each, name) for each in identities]))


def falls(e: LockResults) -> dict[tuple[str, str], list[float]]:
    """Ratio, by sensors and drive, of the position errors at k = 1 and k = 10, where lock is kept at both."""
    return {
        (sensors, drive): [
            slow.position / fast.position
            for slow, fast in zip(errors, e.drawn[sensors, drive, 10.0], strict=True)
            if slow.locked and fast.locked
        ]
        for (sensors, drive, k), errors in e.drawn.items()
        if k == 1.0
    }


# ---- what is asked for


def _identities(e: LockResults) -> Claim:
    Q, s, rho_dot, manifold = (largest(e.identities, name) for name in ("Q", "s", "rho_dot", "manifold"))
    return Claim(
        "range.identities", "target", "Q vanishes on the truth, and each feed-forward is Ψ_*F there.", "C.4",
        f"|Q| <= {Q_ZERO:.0e} m²/s as printed; s and rho_dot off Ψ_*F by at most {EXACT:.0e} rad/s, manifold off "
        f"Ψ(x) after a period by at most {EXACT:.0e} rad, where no denominator is guarded",
        f"|Q| <= {Q:.1e}; s {s:.1e}, rho_dot {rho_dot:.1e}, manifold {manifold:.1e}, at "
        f"{len(e.identities)} states with random inputs, {sum(np.isnan(one.s) for one in e.identities)} of them "
        "guarded",
        Q <= Q_ZERO and max(s, rho_dot, manifold) <= EXACT,
    )  # fmt: skip


def _as_printed(e: LockResults) -> Claim:
    ratios = falls(e)
    every = [ratio for group in ratios.values() for ratio in group]
    measured = f"{min(every):.1f} to {max(every):.1f} times" if every else "it keeps lock nowhere"
    print_locked = sum(locked(e.thesis[motion, "none"]) for motion in TURNING)
    ours = {name: sum(locked(e.thesis[motion, name]) for motion in TURNING) for name in FEED_FORWARDS}
    runs = sum(len(e.thesis[motion, "none"]) for motion in TURNING)
    return Claim(
        "range.as-printed", "target",
            "The observer as printed errs by 1/k where it keeps lock, and where it turns it loses lock.",
        "C.4, C.5",
        f"its position error falls {FALL[0]:g} to {FALL[1]:g} times from k = 1 to k = 10 in every run that keeps "
        "lock at both; from the thesis' start with turning inputs and gains (5, 1) it keeps lock in no run, each "
        "feed-forward in every one",
        f"{measured} ({len(every)} of {sum(len(e.drawn[s, d, 1.0]) for s, d in ratios)} runs from drawn starts keep "
        f"lock at both); turning from the thesis' start lock is kept in {print_locked} of {runs}, with "
        + ", ".join(f"{name} in {count}" for name, count in ours.items()),
        bool(every) and FALL[0] <= min(every) and max(every) <= FALL[1]
        and print_locked == 0 and all(count == runs for count in ours.values()),
    )  # fmt: skip


# ---- what is printed


def _printed(e: LockResults) -> list[Claim]:
    error = float(np.abs(e.start_error).max())
    best = min(MOVING, key=lambda motion: median(e.thesis[motion, "none"]))
    worst_of_truth = e.true_start["none"]
    ours = ", ".join(f"{name} {e.true_start[name].worst:.0e}" for name in FEED_FORWARDS)
    moving, still = e.thesis[SHOWN, "s"], e.thesis[STILL, "s"]
    return [
        Claim(
            "C.start", "printed", "x(0) = (1, -1, π/2) is z(0) = (23π/4, 242π/1101, π/2).", "C.5",
            f"to {SAME:.0e} rad with sensors at -90° and -45° in the ellipse with half-axes 3.763 and √2",
            f"off by {error:.1e} rad", error <= SAME,
        ),
        Claim(
            "C.observer", "printed", "(C.5) is an observer: from Ψ(x(0)) it stays on Ψ(x).", "C.4, Definition C.7",
            f"{SHOWN} from the thesis' start, known exactly: the position is never off by more than {SMALL} m",
            f"off by up to {worst_of_truth.worst:.2f} m; with feed-forward [m]: {ours}", worst_of_truth.worst <= SMALL,
        ),
        Claim(
            "C.converges-z", "printed", "Figures C.3 and C.4 show the convergence of the observer in Z.", "C.5",
            f"under one moving input at least, RMS of a component at the end below {HEADING} rad from every start",
            _lock_text(e, "locked_z", "in_z", "rad"), _holds(e, "locked_z"),
        ),
        Claim(
            "C.converges-x", "printed", "Figures C.5 and C.6 show its convergence in X.", "C.5",
            f"under one moving input at least, RMS at the end below {POSITION} m and {HEADING} rad from every start",
            f"{_lock_text(e, 'locked', 'position', 'm')}; least under '{best}', and not nought under any",
            _holds(e, "locked"),
        ),
        *_noise(e),
        Claim(
            "C.input", "printed", "The convergence of the observer depends on the system input.", "C.6",
            f"s: the position error at the end, median, is below {SMALL} m driving a {SHOWN} and above it standing "
            "still",
            f"{median(moving):.1e} m and {median(still):.2f} m", median(moving) < SMALL < median(still),
        ),
        _proposition(e),
    ]  # fmt: skip


def _lock_text(e: LockResults, flag: str, name: str, unit: str) -> str:
    return ", ".join(
        f"{motion} {sum(getattr(one, flag) for one in e.thesis[motion, 'none'])} of "
        f"{len(e.thesis[motion, 'none'])} ({median(e.thesis[motion, 'none'], name):.2f} {unit})"
        for motion in MOTIONS
        if motion in MOVING
    )


def _holds(e: LockResults, flag: str) -> bool:
    return any(all(getattr(one, flag) for one in e.thesis[motion, "none"]) for motion in MOVING)


def _noise(e: LockResults) -> list[Claim]:
    motions = tuple(dict.fromkeys(motion for motion, _ in e.noisy))
    tracked = {
        flag: {motion: sum(getattr(one, flag) for one in e.noisy[motion, AS_PRINTED]) for motion in motions}
        for flag in ("locked_z", "locked")
    }
    runs = len(e.noisy[motions[0], AS_PRINTED])
    ours = ", ".join(f"{median(e.noisy[motion, OBSERVER]):.3f} m" for motion in motions)
    relative = {
        gains: tuple(median([one for motion in motions for one in e.noisy[motion, gains]], name)
                     for name in ("relative_position", "relative_heading"))
        for gains in (AS_PRINTED, OBSERVER)
    }  # fmt: skip
    better = sum(mean < faulty for mean, faulty in e.averaged)
    share = float(np.median([mean / faulty for mean, faulty in e.averaged]))
    return [
        Claim(
            "C.noise-z", "printed", "With 5 % noise it tracks the true observer state quite well.", "C.5, Figure C.7",
            f"under one input at least, RMS of a component below {HEADING} rad in every run",
            "; ".join(f"{motion}: {tracked['locked_z'][motion]} of {runs}" for motion in motions),
            runs in tracked["locked_z"].values(),
        ),
        Claim(
            "C.noise-x", "printed", "With 5 % noise it tracks x as well.", "C.5, Figure C.8",
            f"under one input at least, RMS below {POSITION} m and {HEADING} rad in every run",
            "; ".join(
                f"{motion}: {tracked['locked'][motion]} of {runs} ({median(e.noisy[motion, AS_PRINTED]):.2f} m)"
                for motion in motions
            ) + f"; with s: {ours}",
            runs in tracked["locked"].values(),
        ),
        Claim(
            "C.position-better", "printed", "With noise the position is estimated much better than φ.", "C.5",
            "the relative error of (x_1, x_2) is below half that of φ, in the median",
            "as printed {:.0%} and {:.0%}, s {:.1%} and {:.1%}".format(*relative[AS_PRINTED], *relative[OBSERVER]),
            all(position < 0.5 * heading for position, heading in relative.values()),
        ),
        Claim(
            "C.vector-average", "printed", "By the vector average a true measurement compensates for a faulty one.",
            "C.5", "5 % noise on one ray: the mean of both is nearer in every run than the ray that errs",
            f"in {better} of {len(e.averaged)} runs; its RMS error is {share:.2f} of the other's, median",
            better == len(e.averaged),
        ),
    ]  # fmt: skip


def _proposition(e: LockResults) -> Claim:
    """Evaluate C.1: with two rays 100 readings a second are too few for the gain that it takes."""
    sets = tuple(dict.fromkeys(sensors for sensors, _, _ in e.drawn))
    fast = tuple(dict.fromkeys(sensors for sensors, _ in e.fast))
    errors = {
        sensors: [median(group) for (name, _), group in e.fast.items() if name == sensors]
        if sensors in fast
        else [median(group) for (name, drive, _), group in e.drawn.items() if (name, drive) == (sensors, "standard")]
        for sensors in sets
    }
    measured = "; ".join(
        f"{sensors}: {', '.join(f'{value:.2g}' for value in group)}" for sensors, group in errors.items()
    )
    return Claim(
        "C.proposition-2", "printed", "The error of (C.5) can be made arbitrarily small by k_V and k_Q.",
        "Proposition C.2",
        f"from the truth, the median position error falls with k to below {SMALL} m: k = 1 to 1000 at 100 readings a "
        "second with three and four rays, 10³ to 10⁵ at 1000 a second with two",
        f"[m] {measured}", all(group[-1] < SMALL and group[-1] < group[0] for group in errors.values()),
    )  # fmt: skip
