"""Attitude tracking without a gyro, from any start: the observer (D.6) and intrinsic tracking close the loop.

It is compared with an error-free gyro and the same noisy attitudes, and with the true state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.lagrangian import SETTLED, angles_to_reference
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Band, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.scenarios.attitude_tracking import VEHICLE
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult, median

TRUE, STATE, JUDGED = "true rate", "true state", "omega = 20"
BANDWIDTHS = {"omega = 5": 5.0, "omega = 10": 10.0, JUDGED: 20.0, "omega = 40": 40.0}
COLOURS = {
    TRUE: "#6b7a8c", STATE: "#b3bcc7", JUDGED: "#0d5fa8",
    "omega = 5": "#e07b00", "omega = 10": "#0f9472", "omega = 40": "#c2183b",
}  # fmt: skip
SPEED, NOISE = 3.0, 0.005  # [rad/s] of the body at the start, [rad] of attitudes about every axis
CONVERGE, SLOWER = 0.99, 1.3
OFTEN = 0.02  # [s] between what is kept of a run


@configuration
class AttitudeConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 300
    """number of starts with the omega that the target compares, and with the true rate"""
    others: Count = 50
    """number of starts with each other omega, and with the true state"""
    seconds: Count = 8
    """duration of a run [s]"""


class AttitudeStudy:
    """Attitude tracking from measured attitudes alone, from any start (output feedback on S^3)."""

    Config = AttitudeConfig
    quick = AttitudeConfig(seeds=6, others=1)
    title = "Attitude tracking without a gyro"
    on_terrain = False

    @staticmethod
    def run(config: AttitudeConfig, setup: Setup) -> StudyResult:
        counts = {
            TRUE: config.seeds,
            STATE: config.others,
            **dict.fromkeys(BANDWIDTHS, config.others),
            JUDGED: config.seeds,
        }
        flown = setup.fly_groups(
            {name: [flight(name, seed, float(config.seconds)) for seed in range(n)] for name, n in counts.items()}
        )
        times = {name: _times(group, float(config.seconds)) for name, group in flown.items()}
        bands = {name: median(group) for name, group in times.items()}
        return StudyResult(
            summary=(
                f"A body in MuJoCo, its attitude uniform among all, tumbling with {SPEED:g} rad/s about an axis that "
                "is drawn, is to follow a reference that turns to and fro about three axes. Attitudes at 500 Hz with "
                f"{1e3 * NOISE:g} mrad of noise about every axis; no gyro. Intrinsic tracking, k_p = 9, k_d = 6. "
                "True rate: the same noisy attitudes, as they are read, and the body's rate without error; true state: "
                "nor is there noise on the attitude. "
                f"Settled: from when on the body is within {SETTLED:g} rad of the reference.",
            ),
            rows=[
                {"loop": name, "seed": record.seed, "settled_at_s": record.summary["settled_at_s"],
                 "attitude_rms_rad": record.summary["attitude_rms_rad"], "velocity_rms": record.summary["velocity_rms"]}
                for name, group in flown.items() for record in group
            ],
            tables=(_table(times, bands, float(config.seconds)),),
            figure=_figure(flown, times, float(config.seconds)),
            caption="(a) Angle to the reference: medians, and from the least to the largest of the runs. (b) Share of "
            "runs that have settled, by time.",
            claims=[_claim(times, bands, float(config.seconds))],
        )  # fmt: skip


def flight(name: str, seed: int, seconds: float) -> Trial:
    """Return the trial of one run; start and noise depend on the seed only, not on the estimator."""
    fields: dict[str, Any] = {
        "duration": seconds, "settled": min(5.0, 0.6 * seconds), "speed": SPEED, "reading.noise": NOISE,
    }  # fmt: skip
    measure = f"{__name__}:angles"
    if name in (TRUE, STATE):
        estimator = "full_state" if name == STATE else f"{__name__}:TrueRate"
        return trial("attitude-tracking", seed, estimator=estimator, fields=fields, measure=measure)
    fields["estimator.bandwidth"] = BANDWIDTHS[name]
    return trial("attitude-tracking", seed, fields=fields, measure=measure)


@dataclass(frozen=True)
class TrueRateConfig:
    """Configuration without fields."""


class TrueRate:
    """Estimator that returns the measured, noisy attitude and the true body rate, as of an error-free gyro."""

    Config = TrueRateConfig

    def __init__(self, mission: LagrangianMission) -> None:
        self.period = mission.period
        self._x, self._size = mission.start_state, mission.system.manifold.size
        self._read = False

    @staticmethod
    def build(config: TrueRateConfig, mission: LagrangianMission) -> TrueRate:
        return TrueRate(mission)

    @staticmethod
    def sensors(config: TrueRateConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        return mission.sensor, mission.full_state_sensor(None)

    @staticmethod
    def quality(config: TrueRateConfig, mission: LagrangianMission) -> None:
        """Return None: the estimates have no certified bound."""

    @staticmethod
    def properties(config: TrueRateConfig) -> ObserverProperties:
        """Return the entries of Table 2.1."""
        return ObserverProperties(
            Domain.GLOBAL, Rate.FINITE_TIME, InputDependence.UNIFORM, Domain.LOCAL, Domain.GLOBAL,
            note="the rate is measured, not observed",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        x = self._x.copy()
        for reading in measurements:
            own = slice(0, self._size) if reading.name == POSITION else slice(self._size, None)
            x[own] = reading.value[own]
            self._read = True
        self._x = x
        return Estimate(t, x.copy(), None, Status.OK if self._read else Status.INITIALISING)


def angles(outcome: RunData) -> dict[str, Any]:
    """A measure: angles [rad] to the reference, every ``OFTEN`` s; None before there is a reference."""
    angle = angles_to_reference(outcome.recording, VEHICLE, Attitude())
    t = outcome.recording.t
    every = max(1, round(OFTEN / float(t[1] - t[0])))
    return {"angles_rad": [float(a) if np.isfinite(a) else None for a in angle[::every]]}


def _times(records: Sequence[Record], seconds: float) -> Array:
    """Return settling times (n,) [s] of runs; the duration for a run that does not settle."""
    found = [r.summary["settled_at_s"] for r in records]
    return np.array([seconds if t is None else t for t in found])


def _claim(times: Mapping[str, Array], bands: Mapping[str, Band], seconds: float) -> Claim:
    settled = rate(int((times[JUDGED] < seconds).sum()), len(times[JUDGED]))
    ratio = bands[JUDGED].median / bands[TRUE].median
    names = [name for name in BANDWIDTHS if name != JUDGED]
    others = ", ".join(f"{name} {(times[name] < seconds).mean():.0%} {bands[name].median:.2f} s" for name in names)
    return Claim(
        "riemannian.attitude", "target", "A body is brought to a reference from anywhere without a gyro.",
        "D.6, further research",
        f"uniform starts: at least {CONVERGE:.0%} converge, settling at most {SLOWER:g} times as late as with the true "
        "rate",
        f"{settled.text()}; median {bands[JUDGED].median:.2f} s against {bands[TRUE].median:.2f} s, {ratio:.2f} times "
        f"(true state {bands[STATE].median:.2f} s); "
        f"{others}",
        settled.value >= CONVERGE and ratio <= SLOWER,
    )  # fmt: skip


def _table(times: Mapping[str, Array], bands: Mapping[str, Band], seconds: float) -> Table:
    rows = [
        (name, f"{int((t < seconds).sum())} of {len(t)}", bands[name].text(), f"{t.max():.2f}",
         f"{bands[name].median / bands[TRUE].median:.2f}")
        for name, t in times.items()
    ]  # fmt: skip
    return Table("Settling", ("rate from", "settled", "median [s]", "latest [s]", "times that of the true rate"), rows)


def _figure(flown: Mapping[str, Sequence[Record]], times: Mapping[str, Array], seconds: float) -> Figure:
    with styled_figure((12.0, 4.6)) as page:
        first, second = page.subplots(1, 2)
        first.set_title("(a) angle to the reference")
        for name in (TRUE, JUDGED):
            rows = [[np.nan if a is None else a for a in r.summary["angles_rad"]] for r in flown[name]]
            angle = np.array(rows)[:, 1:]
            t = OFTEN * np.arange(1, angle.shape[1] + 1)
            first.fill_between(t, angle.min(axis=0), angle.max(axis=0), color=COLOURS[name], alpha=0.15, lw=0.0)
            first.plot(t, np.median(angle, axis=0), color=COLOURS[name], lw=2.0, label=name)
        first.axhline(SETTLED, color=INK, lw=0.9, ls=(0, (4, 3)))
        first.set(yscale="log", xlim=(0.0, seconds), xlabel="time [s]", ylabel="[rad]")
        first.legend(loc="upper right")
        second.set_title("(b) settled")
        for name, own in times.items():
            order = np.sort(own)
            shares, width = np.linspace(1.0 / len(order), 1.0, len(order)), 2.4 if name in (TRUE, JUDGED) else 1.3
            second.step([0.0, *order], [0.0, *shares], where="post", color=COLOURS[name], lw=width, label=name)
        second.set(xlim=(0.0, min(seconds, 1.2 * max(float(own.max()) for own in times.values()))), ylim=(0.0, 1.02),
                   xlabel="time [s]")  # fmt: skip
        second.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        second.legend(loc="center left")
    return page
