"""The observer on mechanisms without a closed-form distance, which the thesis leaves open (D.6).

The metric is MuJoCo's mass matrix. Two joints, seven joints, a cart and pendulum, and mechanisms that were not made for
this: the suite of dm_control, some of which touch the ground, meet limits or are damped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.riemannian.mechanisms.figure import MechanismFigureData, figure
from mathnavi.sim.studies.riemannian.mechanisms.runs import (
    BITS,
    BUTTERWORTH,
    DENSITIES,
    DISTURBED,
    DISTURBED_TUNED,
    EKF,
    HIGH_GAIN,
    LOAD,
    OBSERVER,
    OFTEN,
    OMEGA,
    OWN,
    SUITE,
    SWEPT,
    TUNED,
    UKF,
    ComparisonCase,
    EstimatorComparison,
    MechanismMotion,
    compared,
    update_cost,
)

TUNED_AT, SHOWN_AT = 2.5, 3.0  # [rad/s]
LEAST = {"two-link": 100.0, "seven-joint": 15.0}  # times below the best Butterworth
GAINED = {"two-link": 3.0, "seven-joint": 1.8}  # times, by the disturbance
MOST = {"two-link": 150.0, "seven-joint": 300.0}  # [us]
LOADED = (OBSERVER, DISTURBED, TUNED, DISTURBED_TUNED, BUTTERWORTH, HIGH_GAIN, EKF)
INTRINSIC = (OBSERVER, TUNED, DISTURBED_TUNED)  # of the suite, which have to run throughout
SLOW = (EKF, UKF)  # estimators that are left out of the suite
NEEDED = 5  # mechanisms that were not made for this
HELPS = 1.1  # times below the best Butterworth, from which the observer helps


@configuration
class MechanismsConfig:
    """Sample sizes: runs."""

    own: Count = len(OWN)
    """mechanisms of our own, at most"""
    suite: Count = len(SUITE)
    """mechanisms of dm_control's suite, at most"""
    values: Count = len(DENSITIES)
    """of a sweep, at most, spread over it"""
    seconds: Count = 5
    """of a run"""


class Mechanisms:
    """The observer on any mechanism that MuJoCo can load, with its mass matrix as the metric (D.6)."""

    Config = MechanismsConfig
    quick = MechanismsConfig(suite=2, values=4, seconds=2)
    title = "Any mechanism: the mass matrix as the metric"
    on_terrain = False

    @staticmethod
    def run(config: MechanismsConfig, setup: Setup) -> StudyResult:
        mechanisms = OWN[: config.own]
        timed = [name for name in MOST if name in mechanisms]
        own, T = tuple(name for name in (OBSERVER, *SWEPT) if name != DISTURBED_TUNED), float(config.seconds)
        simple = tuple(name for name in (OBSERVER, *SWEPT) if name not in SLOW)
        jobs = Jobs()
        for name in mechanisms:
            tuning, motion = MechanismMotion(name, TUNED_AT, T, seed=1), MechanismMotion(name, SHOWN_AT, T, seed=2)
            jobs.add(name, compared, [ComparisonCase(tuning, motion, own, config.values, shown=name == OWN[0])])
            light, heavy = (
                MechanismMotion(name, TUNED_AT, T, LOAD, seed=1),
                MechanismMotion(name, SHOWN_AT, T, LOAD, seed=2),
            )
            jobs.add(("load", name), compared, [ComparisonCase(light, heavy, LOADED, config.values)])
        for name in SUITE[: config.suite]:
            there = f"dm_control:{name}"
            tuning, motion = (
                MechanismMotion(there, frequency, T, tracked=False, seed=seed)
                for frequency, seed in ((TUNED_AT, 1), (SHOWN_AT, 2))
            )
            jobs.add(name, compared, [ComparisonCase(tuning, motion, simple, config.values)])
        for name in timed:
            jobs.add(("cost", name), update_cost, [MechanismMotion(name, SHOWN_AT, T, seed=2)])
        done = jobs.done(setup)
        evidence = MechanismResults(
            {name: {c.estimator: c for c in done[name][0]} for name in mechanisms},
            {name: {c.estimator: c for c in done["load", name][0]} for name in mechanisms},
            {name: {c.estimator: c for c in done[name][0]} for name in SUITE[: config.suite]},
            {name: float(np.median(done["cost", name][0])) for name in timed},
        )
        grids = ", ".join(f"{name} {grid[0]:g} to {grid[-1]:g}" for name, (_, _, grid) in SWEPT.items())
        return StudyResult(
            summary=(
                f"Encoders of {BITS} bits at 1 kHz, omega = {OMEGA:g} unless it is tuned. Every estimator is run over "
                f"the same readings: joints to and fro with {SHOWN_AT:g} rad/s, the suite's with a sine on every "
                f"actuator. Baselines, and what is called tuned, are tuned on another run, at {TUNED_AT:g} rad/s: "
                f"{grids}. Error: root mean square of |qvel^ - qvel| from 1 s on.",
                "With an exact model the tuned observer has no lead over tuned high gain and Kalman filters: without "
                "noise the error is that of rounding, and all trust the model. Where it errs a higher gain alone does "
                "about what a Butterworth filter does; a disturbance state, tuned, does better.",
            ),
            rows=[
                {"mechanism": c.mechanism, "load": load, "estimator": c.estimator, "error": c.error,
                 "setting": c.setting, "at_edge": c.at_edge, "peak": c.peak, "restarts": c.restarts,
                 "refused": c.refused, "lost": c.lost, "raised": c.raised}
                for load, found in ((1.0, evidence.own), (LOAD, evidence.loaded), (1.0, evidence.suite))
                for comparisons in found.values() for c in comparisons.values()
            ],
            tables=(
                _table("Our own mechanisms", evidence.own), _loaded(evidence),
                _table("dm_control's suite", evidence.suite),
            ),
            figure=figure(MechanismFigureData(evidence.own, evidence.loaded, evidence.suite, OWN[0], 1e-3 * OFTEN)),
            caption="(a) Error of the joint velocities, by estimator. (b) The last link is 30 % heavier than believed: "
            "without and with the disturbance, each with omega = 30 and tuned, and its rivals, tuned. (c) The two-link "
            "arm: error over time. (d) dm_control's suite: how many times below the best Butterworth filter the "
            "observer is, red: above it; below each, with the disturbance, tuned.",
            claims=claims(evidence),
        )  # fmt: skip


@dataclass(frozen=True)
class MechanismResults:
    """Results from which the claims are evaluated."""

    own: Mapping[str, Mapping[str, EstimatorComparison]]  # by mechanism and estimator
    loaded: Mapping[str, Mapping[str, EstimatorComparison]]
    suite: Mapping[str, Mapping[str, EstimatorComparison]]
    cost: Mapping[str, float]  # [us]

    def ratio(self, name: str, estimator: str = OBSERVER) -> float:
        """Ratio of the errors of the best Butterworth filter and of the observer, or of another estimator."""
        comparisons = self.own.get(name) or self.suite[name]
        return comparisons[BUTTERWORTH].error / comparisons[estimator].error

    def gain(self, name: str) -> float:
        """Ratio of the observer's errors without and with the disturbance, where the model errs."""
        return self.loaded[name][OBSERVER].error / self.loaded[name][DISTURBED].error

    def tuned_gain(self, name: str) -> float:
        """Ratio of the errors without and with the disturbance, both tuned."""
        return self.loaded[name][TUNED].error / self.loaded[name][DISTURBED_TUNED].error

    def fallen(self) -> list[EstimatorComparison]:
        """The runs over the suite that the observer did not do throughout."""
        return [
            comparisons[each] for comparisons in self.suite.values() for each in INTRINSIC if not comparisons[each].ran
        ]


def claims(e: MechanismResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    helped, with_disturbance = (
        {name: e.ratio(name, by) for name in e.suite if e.ratio(name, by) >= HELPS}
        for by in (OBSERVER, DISTURBED_TUNED)
    )
    others = ", ".join(f"{name} {number(e.ratio(name))}" for name in e.suite if name not in helped)
    helped_too = ", ".join(f"{name} {number(ratio)}" for name, ratio in with_disturbance.items())
    return [
        Claim(
            "riemannian.mechanisms", "target", "Encoders give joint velocities better by the observer.", "D.1, D.6",
            f"exact model: at least {LEAST['two-link']:g} times below the best Butterworth for two joints, "
            f"{LEAST['seven-joint']:g} for seven",
            ", ".join(f"{name} {e.ratio(name):.0f} times ({_error_text(e, name)})" for name in LEAST if name in e.own),
            all(e.ratio(name) >= least for name, least in LEAST.items() if name in e.own),
        ),
        Claim(
            "riemannian.model-error", "target", "A transported disturbance makes up for an error of the model.", "D.6",
            f"last link 30 % heavier, omega = {OMEGA:g} with and without it: at least {GAINED['two-link']:g} and "
            f"{GAINED['seven-joint']:g} times",
            "; ".join(
                f"{name} {e.gain(name):.1f} times, {e.loaded[name][OBSERVER].error:.3f} to "
                f"{e.loaded[name][DISTURBED].error:.3f} rad/s; both tuned {number(e.tuned_gain(name))} times, "
                + ", ".join(f"{each.removeprefix('observer, ')} {_cell(e.loaded[name][each])}" for each in LOADED[2:])
                for name in GAINED
                if name in e.own
            ),
            all(e.gain(name) >= least for name, least in GAINED.items() if name in e.own),
        ),
        Claim(
            "riemannian.cost", "target", "An update is cheap.", "D.6",
            f"curvature included, at most {MOST['two-link']:g} us for two joints and {MOST['seven-joint']:g} for seven",
            ", ".join(f"{name} {cost:.0f} us" for name, cost in e.cost.items()),
            all(cost <= MOST[name] for name, cost in e.cost.items()),
        ),
        Claim(
            "riemannian.menagerie", "target", "It runs on mechanisms that were not made for it.", "D.6",
            f"at least {NEEDED} MJCF mechanisms, on all with a finite error and without a restart; and where it helps",
            f"{len(e.suite)} of dm_control's suite{_fallen(e)}; it helps on {len(helped)} ("
            f"{', '.join(f'{name} {number(ratio)}' for name, ratio in helped.items())} times); not on "
            f"{others or 'none'}; with a disturbance, tuned, on {len(with_disturbance)} ({helped_too})",
            len(e.suite) >= NEEDED and not e.fallen(),
        ),
        Claim(
            "D.prohibitive", "printed", "Distance and transport are prohibitive unless the space is simple.", "D.6",
            "no update in real time at 1 kHz on seven joints",
            f"by series in the mass matrix at most {max(e.cost.values()):.0f} us",
            max(e.cost.values()) > 1000.0,
        ),
    ]  # fmt: skip


def number(ratio: float) -> str:
    """Write a ratio with two digits, without an exponent."""
    return f"{ratio:.0f}" if ratio >= 10.0 else f"{ratio:.2g}"


def _fallen(e: MechanismResults) -> str:
    """Text on the runs that were not done throughout, and on refused readings."""
    runs = [
        f"{c.mechanism} ({c.estimator}: {c.raised or f'error {c.error:.2g}, {c.restarts} restarts, {c.lost} lost'})"
        for c in e.fallen()
    ]
    refused = sum(comparisons[each].refused for comparisons in e.suite.values() for each in INTRINSIC)
    return f", not throughout on {', '.join(runs)}" if runs else f", throughout on all, {refused} readings refused"


def _error_text(e: MechanismResults, name: str) -> str:
    comparisons = e.own[name]
    tuned = ", ".join(
        f"{each.removeprefix('observer, ')} {comparisons[each].error:.2g}" for each in (TUNED, HIGH_GAIN, EKF)
    )
    return f"{comparisons[OBSERVER].error:.2g} against {comparisons[BUTTERWORTH].error:.2g} rad/s; {tuned}"


def _table(title: str, found: Mapping[str, Mapping[str, EstimatorComparison]]) -> Table:
    names: Sequence[str] = list(next(iter(found.values())))
    rows = []
    for mechanism, comparisons in found.items():
        cells = [_cell(comparisons[name]) for name in names]
        rows.append((mechanism, f"{comparisons[names[0]].peak:.1f}", *cells))
    return Table(f"{title}: error [rad/s, m/s]", ("mechanism", "peak", *names), rows)


def _cell(c: EstimatorComparison) -> str:
    if c.raised:
        return c.raised
    swept = "" if np.isnan(c.setting) else f" ({c.setting:g}{', at the edge' if c.at_edge else ''})"
    return f"{c.error:.2g}{swept}"


def _loaded(e: MechanismResults) -> Table:
    rows = [
        (name, *(_cell(comparisons[each]) for each in LOADED), f"{e.gain(name):.1f}", number(e.tuned_gain(name)))
        for name, comparisons in e.loaded.items()
    ]
    head = ("mechanism", *LOADED, "times less", "both tuned")
    return Table("The last link 30 % heavier than believed", head, rows)
