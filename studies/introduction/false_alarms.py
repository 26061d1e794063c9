"""False alarms: how often does an estimator say that it is not OK where all is as declared?

Every scenario with a sensor that has noise is flown by default, with each estimator that fits it. An estimator
begins when it is OK for the first time; from ``SETTLED`` later on, a status other than OK is an alarm. Nothing happens
that was not declared, so an alarm is false, but for one about an estimate that was wrong: that, between ``SETTLED``
before the alarm and its end, had an error above three of its deviations for more than a second, as a filter that
linearises about a start too far off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.fields import instance
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.interfaces.stretches import stretches
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.flight import episodes
from mathnavi.sim.metrics.sure_and_wrong import DEVIATIONS, LASTING, lasting
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult

FIRST_SEED = 7000  # no threshold was chosen on these
SETTLED = 3.0  # [s] after an estimator is OK for the first time
MOST = 0.01  # of the time

_KNOWN = {"start_known": True}
_QUADRUPED = {"mechanism": "quadruped"}
_FIXES = {"noise.position": 0.5}  # [m]
_PLACES = [
    (9000.0, 13000.0, 900.0), (13000.0, 9500.0, 420.0), (12500.0, 15500.0, 1500.0), (16500.0, 12500.0, 600.0),
    (12500.0, 12500.0, 1700.0), (11000.0, 11500.0, 450.0),
]  # fmt: skip
_AMONG_BEACONS = {
    "terrain": "jacksboro", "start": (11000.0, 11000.0, 900.0), "target": (13300.0, 12600.0, 900.0), "speed_max": 100.0,
    "beacons.places": _PLACES, "estimator.fixes": False,
}  # fmt: skip
_LANDMARKS = {"beacons.places": [(2.5, 0.8), (-2.5, 0.9), (0.3, -1.2)]}
FIGURES = "not_ok_share", "alarm_share", "alarms", "begun_s"
VELOCITY = (
    "riemannian_observer", "high_gain", "lagrangian_ekf", "lagrangian_ukf", "momentum_observer", "filtered_differences",
)  # fmt: skip


class Flown(NamedTuple):
    """A scenario as flown, with one estimator."""

    scenario: str
    estimator: str
    fields: Mapping[str, Any] = MappingProxyType({})
    controller: str | None = None  # None for the scenario's own


def _textbook(estimator: str, system: str) -> Flown:
    return Flown("textbook-observer", estimator, {"noise": 0.01, "system": system})


CASES = {
    **{f"flight: {name}": Flown("safe-flight", name) for name in ("kalman", "moving_horizon")},
    "flight among beacons: kalman": Flown("safe-flight", "kalman", _AMONG_BEACONS),
    "fleet: kalman": Flown("simultaneous-arrival", "kalman"),
    "quadrotor: inertial_iekf": Flown("quadrotor-canyon", "inertial_iekf", _FIXES),
    "missile: missile_kalman": Flown("missile-guidance", "missile_kalman"),
    **{f"ranging: {name}": Flown("range-localisation", name) for name in ("feasible_set_bank", "range_certified")},
    **{
        f"ranging: {name}": Flown("range-localisation", name, _KNOWN)
        for name in ("range_ekf", "range_iekf", "range_ukf", "range_particle", "moving_horizon", "range_observer")
    },
    **{
        f"beacons: {name}": Flown("range-localisation", name, _LANDMARKS)
        for name in ("beacon_bank", "beacon_certified")
    },
    **{f"arm: {name}": Flown("arm-velocity", name) for name in VELOCITY},
    "servo-six: riemannian_observer": Flown("arm-velocity", "riemannian_observer", {"mechanism": "servo-six"}),
    "quadruped: floating_base_iekf": Flown("arm-velocity", "floating_base_iekf", _QUADRUPED, "input_signal"),
    **{f"sphere: {name}": Flown("sphere-observer", name) for name in VELOCITY if name != "momentum_observer"},
    **{f"attitude: {name}": Flown("attitude-tracking", name) for name in ("attitude_iekf", "riemannian_observer")},
    "textbook: textbook_ekf": _textbook("textbook_ekf", "example-2-2"),
    "textbook: example_2_2": _textbook("example_2_2", "example-2-2"),
    "textbook: output_injection": _textbook("output_injection", "krener-isidori"),
    "textbook: kazantzis_kravaris": _textbook("kazantzis_kravaris", "kazantzis-kravaris"),
}
"""scenarios with the estimators that fit them, by name"""


@configuration
class FalseAlarmsConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 5
    """number of runs of each case"""
    cases: Count = len(CASES)
    """number of cases, in the order of the table"""


class FalseAlarms:
    """Estimators whose sensors are as declared, in every scenario."""

    Config = FalseAlarmsConfig
    quick = FalseAlarmsConfig(seeds=1, cases=6)
    title = "False alarms: estimators are OK where all is as declared"
    on_terrain = False

    @staticmethod
    def run(config: FalseAlarmsConfig, setup: Setup) -> StudyResult:
        chosen = dict(list(CASES.items())[: config.cases])
        runs = {
            (name, seed): trial(
                flown.scenario, seed, flown.controller, flown.estimator, flown.fields, f"{__name__}:alarms"
            )
            for name, flown in chosen.items()
            for seed in range(FIRST_SEED, FIRST_SEED + config.seeds)
        }
        rows = [
            {"case": name, "seed": seed, **{key: record.summary[key] for key in FIGURES}}
            for (name, seed), record in setup.fly_each(runs).items()
        ]
        of = {name: [row for row in rows if row["case"] == name] for name in chosen}
        shares, not_ok = ({name: share(of[name], key) for name in chosen} for key in ("alarm_share", "not_ok_share"))
        alarmed = {name: [row for row in of[name] if row["alarm_share"] != 0.0] for name in chosen}
        return StudyResult(
            summary=(
                f"{config.seeds} runs of each scenario with noise, as it is by default, by each estimator that fits "
                f"it. An alarm is a status other than OK from {SETTLED:g} s after the first OK on. It is false if the "
                f"estimate is right from {SETTLED:g} s before until its end, beyond {DEVIATIONS:g} of its deviations "
                f"for no more than {LASTING:g} s.",
            ),
            rows=rows,
            tables=(Table(
                "Time in alarm",
                ("scenario and estimator", "false [%]", "not OK [%]", "runs with a false alarm", "never OK"),
                [(name, f"{100.0 * shares[name]:.2f}", f"{100.0 * not_ok[name]:.2f}",
                  f"{len(alarmed[name])} of {config.seeds}",
                  sum(row["begun_s"] is None for row in of[name])) for name in chosen],
            ),),
            figure=figure(shares),
            caption="Share of the time in false alarm, by scenario and estimator; dotted, the most that is allowed.",
            claims=[claim(shares)],
        )  # fmt: skip


def share(rows: Sequence[dict[str, Any]], key: str) -> float:
    """Mean of a share of the time; a run that is never OK is one long alarm."""
    return float(np.mean([1.0 if row[key] is None else row[key] for row in rows]))


def claim(shares: dict[str, float]) -> Claim:
    """Evaluate the claim of the study."""
    above = [f"{name}: {value:.1%}" for name, value in shares.items() if value > MOST]
    worst = max(shares, key=shares.__getitem__)
    return Claim(
        "false-alarms.scenarios", "target", "Estimators are OK where all is as declared, in every scenario.", "C.4",
        f"not OK, but for an estimate that is wrong: <= {MOST:.0%} of the time of each estimator in each scenario, "
        f"from {SETTLED:g} s after it begins",
        f"{len(shares) - len(above)} of {len(shares)}; largest {shares[worst]:.2%}, {worst}"
        + f". Beyond: {'; '.join(above)}" * bool(above),
        not above,
    )  # fmt: skip


def figure(shares: dict[str, float]) -> Figure:
    """Draw the share of each case."""
    with styled_figure((8.0, 0.6 + 0.26 * len(shares)), ConstrainedLayoutEngine()) as drawn:
        axes = drawn.subplots()
        axes.plot([100.0 * value for value in shares.values()], range(len(shares)), "o", color="#0d5fa8", ms=5.0)
        axes.set_yticks(range(len(shares)), list(shares))
        axes.invert_yaxis()
        axes.axvline(100.0 * MOST, color=INK, lw=1.0, ls=":")
        axes.set_xscale("symlog", linthresh=1.0)
        axes.set_xticks([0.0, 0.5, 1.0, 10.0, 100.0], ["0", "0.5", "1", "10", "100"])
        axes.set(xlim=(-0.05, 110.0), xlabel="time in false alarm [%]")
    return drawn


def alarms(outcome: RunData) -> dict[str, Any]:
    """A measure: the shares of its time that an estimator is in alarm and in a false one, over all agents, and how
    many false alarms begin.

    ``begun_s`` is when the last agent's estimator is OK for the first time; the shares are then None if one never is.
    """
    agents = {name: agent for name, agent in outcome.recording.agents.items() if agent.estimates}
    found = [settled(agent.estimates, wrong(outcome, name)) for name, agent in agents.items()]
    begun = [each.begun for each in found]
    if not found or any(math.isnan(begin) for begin in begun):
        return {"begun_s": None, "not_ok_share": None, "alarm_share": None, "alarms": 0}
    count = sum(episodes(each.false) for each in found)
    shares = [float(every.mean()) if len(every) else 0.0 for every in map(np.concatenate, zip(*(
        (each.alarm, each.false) for each in found
    ), strict=True))]  # fmt: skip
    return {"begun_s": max(begun), "not_ok_share": shares[0], "alarm_share": shares[1], "alarms": count}


def wrong(outcome: RunData, agent: str) -> Flags:
    """True (n,) for the estimates of an agent that have an error above three of their deviations for more than a
    second; False for all where the scenario does not compare them with its truth, or they have no deviations of the
    same components.
    """
    recording = outcome.recording
    estimates = recording.agents[agent].estimates
    none = np.zeros(len(estimates), np.bool_)
    scenario = load("scenarios", outcome.config["scenario"])
    if not hasattr(scenario, "errors"):
        return none
    truth = recording.truths[agent][np.searchsorted(recording.t, [each.t - 1e-9 for each in estimates])]
    config = instance(scenario.Config, outcome.config["fields"], "fields")
    errors = scenario.errors(config, np.array([each.x for each in estimates]), truth)
    error = np.column_stack(list(errors.values()))
    deviations = [_deviation(each) for each in estimates]
    if any(each is None or len(each) != error.shape[1] for each in deviations):
        return none
    t, far = np.array([each.t for each in estimates]), (np.abs(error) > DEVIATIONS * np.array(deviations)).any(axis=1)
    return lasting(t, np.asarray(far, np.bool_))


def _deviation(estimate: Estimate) -> Array | None:
    if estimate.covariance is not None:
        return np.sqrt(np.diag(estimate.covariance))
    return estimate.extra.get("deviation")


class Settled(NamedTuple):
    """The time at which an estimator begins, and its alarms later than ``SETTLED`` after that."""

    begun: float  # [s]; NaN if it never does
    alarm: Flags  # (n,)
    false: Flags  # (n,)


def settled(estimates: Sequence[Estimate], wrong: Flags) -> Settled:
    """The alarms of ``estimates``, of which some are ``wrong`` (n,)."""
    t, ok = np.array([each.t for each in estimates]), np.array([each.status is Status.OK for each in estimates])
    if not ok.any():
        return Settled(math.nan, np.zeros(0, np.bool_), np.zeros(0, np.bool_))
    false = ~ok
    for first, last in stretches(~ok):
        if wrong[np.searchsorted(t, t[first] - SETTLED) : last].any():
            false[first:last] = False
    begin = float(t[ok.argmax()])
    later = t >= begin + SETTLED
    return Settled(begin, ~ok[later], false[later])
