"""Noisy attitudes of a body in MuJoCo under torques: every estimator of its rates over the same readings.

Two questions: how large the error is once all have settled, and how long it takes from rest to the rate of the body.
What is called tuned is so for the first, by a sweep of one field on a run that is not reported.

The error is that of the thesis, and of every run's summary: |Delta v|, omega^ brought to the attitude of the body
before. What a user of the rates has, |omega^ - omega|, each in its own body's axes, is reported beside: the error of
the attitude adds |omega| times itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.sensors import POSITION
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.lagrangian import errors_of
from mathnavi.sim.metrics.tuning import RecordedCall, Tuning, recorded_calls, replayed, spread, tuned
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Band
from mathnavi.sim.scenarios.sphere_observer import VEHICLE, config_mission
from mathnavi.sim.studies.framework.study import median
from mathnavi.sim.sweep.trial import trial

TORQUES = {"planner.amplitude": (0.3, 0.2, 0.25), "planner.frequency": 2.0}  # [N m], [rad/s]
TUNED_ON = 1000  # the seed of the run for it
SETTLED_FROM = 1.0 / 3.0  # of a run, from when on errors count
THINNED = 5  # readings from one |Delta v|_g to the next
SPEED = 6.0  # [rad/s] of the body at the start
SPEEDS = (6.0, 25.0, 60.0)  # [rad/s] from which settling is timed
SETTLING = 2.0  # [s] for which it is, at most
GONE = 0.01  # of the error at the start

OBSERVER, TUNED = "observer", "observer, tuned"
HIGH_GAIN, HIGH_GAIN_TUNED, EKF, UKF = "high gain", "high gain, tuned", "EKF, tuned", "UKF, tuned"
DIFFERENCES, BUTTERWORTH = "differences", "Butterworth, tuned"
OMEGA = 10.0  # [1/s] of the observer of the target, and of high gain beside it
CUTOFFS = (0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 9.0, 12.0, 15.0, 20.0, 30.0, 50.0)  # [Hz]
BANDWIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 50.0)  # [1/s]
DENSITIES = (1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 1.0)  # [rad/s^1.5]

FIXED: Mapping[str, tuple[str, str, float]] = {
    OBSERVER: ("riemannian_observer", "bandwidth", OMEGA),
    HIGH_GAIN: ("high_gain", "bandwidth", OMEGA),
    "Butterworth 20 Hz": ("filtered_differences", "cutoff", 20.0),
    "Butterworth 5 Hz": ("filtered_differences", "cutoff", 5.0),
    DIFFERENCES: ("filtered_differences", "cutoff", 0.0),
}
"""plug-in, field and its value, as the target has them"""
SWEPT: Mapping[str, tuple[str, str, tuple[float, ...]]] = {
    UKF: ("lagrangian_ukf", "acceleration", DENSITIES),
    EKF: ("lagrangian_ekf", "acceleration", DENSITIES),
    TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    HIGH_GAIN_TUNED: ("high_gain", "bandwidth", BANDWIDTHS),
    BUTTERWORTH: ("filtered_differences", "cutoff", CUTOFFS),
}
"""plug-in, the field that is swept, and its values"""
SETTLED = (OBSERVER, TUNED, HIGH_GAIN, HIGH_GAIN_TUNED, EKF, UKF)  # those of which settling is timed
NAMES = (*SETTLED, BUTTERWORTH, "Butterworth 20 Hz", "Butterworth 5 Hz", DIFFERENCES)
_RATES = slice(4, 7)


@dataclass(frozen=True)
class Tumbling:
    """A run: attitudes at 1 kHz with .01 rad of noise about every axis, torques that do not depend on an estimate."""

    seed: int
    seconds: float
    speed: float = SPEED


@dataclass(frozen=True)
class TuningSweep:
    """An estimator to be tuned on a run of ``seconds`` [s], with so many values."""

    name: str
    seconds: float
    values: int


@dataclass(frozen=True)
class EstimatedRun:
    """A run, and the values of the fields with which the estimators follow it."""

    run: Tumbling
    settings: tuple[tuple[str, float], ...]


def recorded(run: Tumbling) -> tuple[LagrangianMission, list[RecordedCall]]:
    """Record a run as the mission and the calls of an estimator."""
    fields: dict[str, Any] = {
        "duration": run.seconds, "settled": 0.0, "speed": run.speed, "speed_max": max(30.0, 0.75 * run.speed), **TORQUES
    }  # fmt: skip
    flight = trial("sphere-observer", run.seed, estimator="filtered_differences", fields=fields)
    return config_mission(flight.config), recorded_calls(flight.build().run().recording, VEHICLE, POSITION)


def swept(sweep: TuningSweep) -> Tuning:
    """The errors of an estimator by the value of its field, on the run for it."""
    plugin_name, field, grid = SWEPT[sweep.name]
    plugin = load("estimators", plugin_name)
    mission, calls = _tuning_run(sweep.seconds)
    return tuned(
        plugin, plugin.Config(), mission, calls, field, spread(grid, sweep.values), _RATES, SETTLED_FROM * sweep.seconds
    )


def settings(tunings: Mapping[str, Tuning]) -> tuple[tuple[str, float], ...]:
    """The value of the field of every estimator."""
    own = {name: value for name, (_, _, value) in FIXED.items()} | {name: t.best for name, t in tunings.items()}
    return tuple((name, own[name]) for name in NAMES)


def errors(flight: EstimatedRun) -> dict[str, tuple[float, float]]:
    """|omega^ - omega| and, as a body rate, |Delta v|_g [rad/s] of every estimator, root mean squares once settled."""
    mission, calls = recorded(flight.run)
    first = round(SETTLED_FROM * len(calls))
    found = {}
    for name, value in flight.settings:
        estimator = _built(name, value, mission)
        x = [estimator.update(call.t, call.measurements, call.command).x for call in calls]
        pairs = list(zip(x, calls, strict=True))[first:]
        plain = [a[_RATES] - call.truth[_RATES] for a, call in pairs]
        carried = [errors_of(mission.system.manifold, call.truth, a)[1] for a, call in pairs[::THINNED]]
        found[name] = _length_rms(plain), _length_rms(carried)
    return found


def _length_rms(errors: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))


def settling(flight: EstimatedRun) -> dict[str, float]:
    """[s] from when on the error stays below 1 % of that at the start; NaN if it does not."""
    mission, calls = recorded(flight.run)
    found = {
        name: replayed(_built(name, value, mission), calls, _RATES).below_from(GONE * flight.run.speed)
        for name, value in flight.settings
        if name in SETTLED
    }
    return {name: np.nan if at is None else at for name, at in found.items()}


@cache
def _tuning_run(seconds: float) -> tuple[LagrangianMission, list[RecordedCall]]:
    return recorded(Tumbling(TUNED_ON, seconds))


def _built(name: str, value: float, mission: LagrangianMission) -> Any:
    plugin_name, field, _ = FIXED.get(name) or SWEPT[name]
    plugin = load("estimators", plugin_name)
    return plugin.build(plugin.Config(**{field: value}), mission)


@dataclass(frozen=True)
class NoiseResults:
    """Errors and settling times of every estimator over noisy runs."""

    tunings: Mapping[str, Tuning]
    errors: Mapping[str, Band]  # |Delta v| as a body rate [rad/s] by estimator
    plain: Mapping[str, Band]  # |omega^ - omega| [rad/s]
    settled: Mapping[str, Mapping[float, Sequence[float]]]  # [s] by estimator and speed, a value for each seed

    @staticmethod
    def from_runs(
        tunings: Mapping[str, Tuning],
        found: Sequence[Mapping[str, tuple[float, float]]],
        late: Mapping[float, Sequence[Mapping[str, float]]],
    ) -> NoiseResults:
        """Gather the errors of the runs, and the settling times by speed."""
        plain, carried = ({name: median(np.array([one[name][k] for one in found])) for name in NAMES} for k in (0, 1))
        settled = {name: {speed: [one[name] for one in group] for speed, group in late.items()} for name in SETTLED}
        return NoiseResults(tunings, carried, plain, settled)

    def times(self, name: str) -> float:
        """Ratio of another estimator's error and the observer's."""
        return self.errors[name].median / self.errors[OBSERVER].median

    def setting(self, name: str) -> str:
        """The value of the field, with its name where it is tuned."""
        if name in FIXED:
            return f"{FIXED[name][2]:g}"
        tuning = self.tunings[name]
        return f"{tuning.best:g}{', at the edge' if tuning.at_edge else ''}"


def noise_claim(noise: NoiseResults) -> Claim:
    """Evaluate the observer against differences; the text adds what a model and the noise's variance can do."""
    better = min((name for name in FIXED if "Butterworth" in name), key=lambda name: noise.errors[name].median)
    ratios = noise.times(DIFFERENCES), noise.times(better)
    rivals = ", ".join(
        f"{name.removesuffix(', tuned')} {noise.errors[name].median:.4f} ({1.0 / noise.times(name):.2g} times better)"
        for name in (EKF, UKF, HIGH_GAIN_TUNED, TUNED)
    )
    plain = noise.plain[DIFFERENCES].median / noise.plain[OBSERVER].median
    return Claim(
        "riemannian.noise", "target", "Noisy attitudes give the body rate better by the observer.", "D.1",
        "error at least 2500 times below that of differences, and 10 times below the better Butterworth filter's",
        f"{ratios[0]:.0f} times, and {ratios[1]:.0f} times below {better}: {noise.errors[OBSERVER].median:.4f} rad/s; "
        f"{noise.times(BUTTERWORTH):.0f} times below the best of a sweep of cutoffs ({noise.setting(BUTTERWORTH)} Hz); "
        f"with what the attitude's error adds, |omega^ - omega|, {noise.plain[OBSERVER].median:.4f} rad/s, "
        f"{plain:.0f} times below differences. Tuned on another run: {rivals}",
        ratios[0] >= 2500.0 and ratios[1] >= 10.0,
    )  # fmt: skip


def noise_tables(noise: NoiseResults) -> tuple[Table, Table]:
    """Errors once all have settled, and how long that takes."""
    rows = [
        (n, noise.setting(n), noise.errors[n].text(), f"{noise.times(n):.3g}", f"{noise.plain[n].median:.3g}")
        for n in NAMES
    ]
    setting = "omega [1/s], cutoff [Hz], q [rad/s^1.5]"
    head = ("estimator", setting, "error [rad/s]", "times the observer's", "|omega^ - omega| [rad/s]")
    speeds = tuple(next(iter(noise.settled.values())))
    times = [(name, *(_settled(noise.settled[name][speed]) for speed in speeds)) for name in SETTLED]
    return (
        Table("Body rates from noisy attitudes", head, rows),
        Table(
            "From rest to the body's rate: time until 1 % [s]", ("estimator", *(f"{v:g} rad/s" for v in speeds)), times
        ),
    )


def noise_rows(noise: NoiseResults) -> list[dict[str, Any]]:
    """Rows for the study's file."""
    rows: list[dict[str, Any]] = [
        {"what": "noise", "estimator": name, "rms_rad_s": band.median, "plain_rms_rad_s": noise.plain[name].median}
        for name, band in noise.errors.items()
    ]
    rows += [
        {"what": "tuning", "estimator": name, "setting": value, "rms_rad_s": error}
        for name, t in noise.tunings.items()
        for value, error in zip(t.grid, t.errors, strict=True)
    ]
    rows += [
        {"what": "settling", "estimator": name, "speed_rad_s": speed, "t_s": at}
        for name, by_speed in noise.settled.items()
        for speed, times in by_speed.items()
        for at in times
    ]
    return rows


def _settled(times: Sequence[float]) -> str:
    found = [t for t in times if np.isfinite(t)]
    if len(found) == len(times):
        return median(np.array(found)).text()
    many = f"{len(found)} of {len(times)} in the run"
    return many if not found else f"{many}, median {float(np.median(found)):.3g}"
