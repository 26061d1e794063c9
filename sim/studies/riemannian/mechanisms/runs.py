"""Runs of the study ``mechanisms``: one recorded flight of a mechanism, and every estimator over the same readings.

What is called tuned, and every baseline, is so by a stated sweep of one field, on a run of its own; the observer's
omega is given. What is reported is of another run, with another frequency; encoders have no noise, only steps.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.sensors import POSITION
from mathnavi.sim.metrics.tuning import RecordedCall, recorded_calls, replayed, spread, tuned
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.scenarios.arm_velocity import VEHICLE, ArmVelocityConfig, believed
from mathnavi.sim.sweep.trial import trial

BITS, OMEGA = 14, 30.0
BEGIN = 1.0  # [s] from when on errors count
OFTEN = 10  # calls between what is kept of an error over time
LOAD = 1.3  # times the mass of the last link, where the model errs
CUTOFFS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0, 80.0, 120.0, 180.0, 250.0)  # [Hz]
DENSITIES = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # [rad/s^1.5]
OWN = ("two-link", "seven-joint", "cart-pendulum")
SUITE = (
    "acrobot", "ball_in_cup", "cartpole", "cheetah", "finger", "hopper", "pendulum", "reacher", "walker",
)  # fmt: skip
OBSERVER, TUNED = "observer", "observer, tuned"
DISTURBED, DISTURBED_TUNED = "observer, disturbance", "observer, disturbance, tuned"
BUTTERWORTH, HIGH_GAIN, EKF, UKF = "Butterworth", "high gain", "EKF", "UKF"
MOMENTUM = "momentum observer"
BANDWIDTHS = (
    0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 80.0, 120.0, 200.0, 300.0, 500.0, 1000.0,
)  # fmt: skip  # [1/s]

SWEPT: Mapping[str, tuple[str, str, tuple[float, ...]]] = {
    TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    DISTURBED_TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    BUTTERWORTH: ("filtered_differences", "cutoff", CUTOFFS),
    HIGH_GAIN: ("high_gain", "bandwidth", BANDWIDTHS),
    MOMENTUM: ("momentum_observer", "bandwidth", BANDWIDTHS),
    EKF: ("lagrangian_ekf", "acceleration", DENSITIES),
    UKF: ("lagrangian_ukf", "acceleration", DENSITIES[::2]),  # a decade apart, for what it costs
}
"""plug-in, the field that is swept, and its values"""


@dataclass(frozen=True)
class MechanismMotion:
    """A mechanism and how it is moved."""

    mechanism: str  # as the scenario calls it
    frequency: float  # [rad/s]
    seconds: float  # of the run
    load: float = 1.0
    tracked: bool = True  # joints to and fro; else every actuator is given a sine
    seed: int = 0
    amplitude: float = 1.0  # of the sine, where every actuator is given one


@cache
def recorded(motion: MechanismMotion) -> tuple[LagrangianMission, list[RecordedCall]]:
    """Record a flight with the observer in the loop, as the mission and the calls of an estimator."""
    fields: dict[str, Any] = {
        "mechanism": motion.mechanism, "load": motion.load, "duration": motion.seconds, "settled": 0.0,
        "reading.resolution": BITS, "estimator.bandwidth": OMEGA, "planner.frequency": motion.frequency,
    }  # fmt: skip
    controller = "joint_tracking"
    if not motion.tracked:
        controller = "input_signal"
        inputs = len(believed(ArmVelocityConfig(mechanism=motion.mechanism)).system.inputs)
        fields["planner.amplitude"] = (motion.amplitude,) * inputs
    flight = trial("arm-velocity", motion.seed, controller=controller, fields=fields)
    return believed(flight.config), recorded_calls(flight.build().run().recording, VEHICLE, POSITION)


@dataclass(frozen=True)
class EstimatorComparison:
    """An estimator over one motion."""

    mechanism: str
    estimator: str
    error: float  # [rad/s, m/s] root mean square of |qvel^ - qvel|; nan where it raised
    setting: float  # of the field that was swept; nan
    at_edge: bool  # of the sweep
    peak: float  # [rad/s, m/s] the largest joint speed
    restarts: int  # of the estimator
    refused: int  # readings
    lost: int  # estimates that it says are lost
    raised: str = ""  # what it did instead of an estimate
    over_time: Sequence[float] = field(default=(), repr=False)  # |qvel^ - qvel|, every ``OFTEN`` calls, where asked for

    @property
    def ran(self) -> bool:
        """Tell whether it ran all the time, with a finite error, and without starting anew."""
        return not self.raised and bool(np.isfinite(self.error)) and not (self.restarts or self.lost)


@dataclass(frozen=True)
class ComparisonCase:
    """A mechanism, and the estimators to run over it."""

    tuning: MechanismMotion
    motion: MechanismMotion
    estimators: tuple[str, ...]
    values: int  # of a sweep, at most
    shown: bool = False  # whether errors over time are kept


def compared(job: ComparisonCase) -> list[EstimatorComparison]:
    """Run every estimator over the same readings; an exception becomes part of the result."""
    return [_comparison(name, job) for name in job.estimators]


def _comparison(name: str, job: ComparisonCase) -> EstimatorComparison:
    try:
        mission, calls = recorded(job.motion)
        rates = slice(mission.system.manifold.size, None)
        peak = float(np.abs([call.truth[rates] for call in calls]).max())
        plugin, config, setting, at_edge = _tuned(name, job)
        ran = replayed(plugin.build(config, mission), calls, rates)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError, mujoco.FatalError) as error:
        message = f"{type(error).__name__}: {error}"
        return EstimatorComparison(job.motion.mechanism, name, np.nan, np.nan, False, np.nan, 0, 0, 0, message)
    over_time = ran.error[::OFTEN].tolist() if job.shown else ()
    return EstimatorComparison(
        job.motion.mechanism, name, ran.rms(BEGIN), setting, at_edge, peak, ran.restarts, ran.refused, ran.lost,
        over_time=over_time,
    )  # fmt: skip


def _tuned(name: str, job: ComparisonCase) -> tuple[Any, Any, float, bool]:
    """A plug-in, its configuration, the value of the swept field, and whether that is at the edge of the sweep."""
    if name not in SWEPT:
        plugin = load("estimators", "riemannian_observer")
        return plugin, plugin.Config(bandwidth=OMEGA, disturbance=name == DISTURBED), float("nan"), False
    called, swept, grid = SWEPT[name]
    plugin = load("estimators", called)
    config = plugin.Config(disturbance=True) if name == DISTURBED_TUNED else plugin.Config()
    values = spread(grid, job.values)
    if len(values) == 1:  # there is nothing to choose from
        return plugin, replace(config, **{swept: values[0]}), values[0], True
    mission, calls = recorded(job.tuning)
    rates = slice(mission.system.manifold.size, None)
    found = tuned(plugin, config, mission, calls, swept, values, rates, BEGIN)
    return plugin, replace(config, **{swept: found.best}), found.best, found.at_edge


def update_cost(motion: MechanismMotion) -> list[MeasuredTime]:
    """[us] of CPU time of one update of the observer, medians over blocks of a hundred, curvature included."""
    mission, calls = recorded(motion)
    plugin = load("estimators", "riemannian_observer")
    estimator = plugin.build(plugin.Config(bandwidth=OMEGA), mission)
    times: list[float] = []
    for call in calls:
        began = time.thread_time_ns()
        estimator.update(call.t, call.measurements, call.command)
        times.append(1e-3 * (time.thread_time_ns() - began))
    blocks: Sequence[Any] = np.array_split(np.array(times[100:]), max(1, (len(times) - 100) // 100))
    return [MeasuredTime(np.median(block)) for block in blocks]
