"""False alarms: how often does an estimator say that it is not OK where all is as declared?

Every scenario with a sensor that has noise is flown by default, with each estimator that fits it. An estimator
begins when it is OK for the first time; from ``SETTLED`` later on, a status other than OK is an alarm, for nothing
happens that was not declared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Status
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
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
            {"case": name, "seed": seed, **{key: record.summary[key] for key in ("alarm_share", "alarms", "begun_s")}}
            for (name, seed), record in setup.fly_each(runs).items()
        ]
        shares = {name: share([row for row in rows if row["case"] == name]) for name in chosen}
        alarmed = {name: [row for row in rows if row["case"] == name and row["alarm_share"] != 0.0] for name in chosen}
        return StudyResult(
            summary=(
                f"{config.seeds} runs of each scenario with noise, as it is by default, by each estimator that fits "
                f"it. An alarm is a status other than OK from {SETTLED:g} s after the first OK on.",
            ),
            rows=rows,
            tables=(Table(
                "Time in alarm",
                ("scenario and estimator", "share of the time [%]", "runs with an alarm", "never OK"),
                [(name, f"{100.0 * shares[name]:.2f}", f"{len(alarmed[name])} of {config.seeds}",
                  sum(row["begun_s"] is None for row in rows if row["case"] == name)) for name in chosen],
            ),),
            figure=figure(shares),
            caption="Share of the time in alarm of each estimator in each scenario; dotted, the most that is allowed.",
            claims=[claim(shares)],
        )  # fmt: skip


def share(rows: Sequence[dict[str, Any]]) -> float:
    """Mean share of the time in alarm; a run that is never OK is one long alarm."""
    return float(np.mean([1.0 if row["alarm_share"] is None else row["alarm_share"] for row in rows]))


def claim(shares: dict[str, float]) -> Claim:
    """Evaluate the claim of the study."""
    above = [f"{name}: {value:.1%}" for name, value in shares.items() if value > MOST]
    worst = max(shares, key=shares.__getitem__)
    return Claim(
        "false-alarms.scenarios", "target", "Estimators are OK where all is as declared, in every scenario.", "C.4",
        f"not OK: <= {MOST:.0%} of the time of each estimator in each scenario, from {SETTLED:g} s after it begins",
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
        axes.set(xlim=(-0.05, 110.0), xlabel="time in alarm [%]")
    return drawn


def alarms(outcome: RunData) -> dict[str, Any]:
    """A measure: the share of its time that an estimator is in alarm, over all agents, and how many alarms begin.

    ``begun_s`` is when the last agent's estimator is OK for the first time; ``alarm_share`` is then None if one never
    is.
    """
    found = [settled(agent.estimates) for agent in outcome.recording.agents.values() if agent.estimates]
    begun = [begin for begin, _ in found]
    flags = [flag for _, flag in found]
    if not found or any(math.isnan(begin) for begin in begun):
        return {"begun_s": None, "alarm_share": None, "alarms": 0}
    count = sum(int((np.diff(np.concatenate([[0], flag.astype(int)])) > 0).sum()) for flag in flags)
    every = np.concatenate(flags)
    return {"begun_s": max(begun), "alarm_share": float(every.mean()) if len(every) else 0.0, "alarms": count}


def settled(estimates: Sequence[Any]) -> tuple[float, np.ndarray]:
    """Time [s] of the first estimate that is OK, NaN without one, and whether those are alarms that follow later than
    ``SETTLED`` after it.
    """
    t, ok = np.array([each.t for each in estimates]), np.array([each.status is Status.OK for each in estimates])
    if not ok.any():
        return math.nan, np.zeros(0, dtype=bool)
    begin = float(t[ok.argmax()])
    return begin, ~ok[t >= begin + SETTLED]
