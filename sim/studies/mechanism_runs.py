"""What the study ``mechanisms`` runs: one recorded flight of a mechanism, and every estimator over the same readings.

Baselines are tuned by a stated sweep of one field each, on a run of its own; the observer's omega is given. What is
reported is of another run, with another frequency.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from models.manifold.mission import LagrangianMission
from models.manifold.sensors import POSITION
from sim.plugins import load
from sim.scenarios.arm_velocity import VEHICLE, ArmVelocityConfig, believed
from sim.signals import Measurement
from sim.sweep.trial import trial
from sim.tuning import RecordedCall, recorded_error, tuned

BITS, OMEGA = 14, 30.0
BEGIN = 1.0  # [s] from when on errors count
LOAD = 1.3  # times the mass of the last link, where the model errs
CUTOFFS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0, 80.0, 120.0, 180.0, 250.0)  # [Hz]
DENSITIES = (0.00003, 0.0001, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # [rad/s^1.5]
OWN = ("two-link", "seven-joint", "cart-pendulum")
SUITE = (
    "acrobot", "ball_in_cup", "cartpole", "cheetah", "finger", "hopper", "pendulum", "reacher", "walker",
)  # fmt: skip
OBSERVER, TUNED = "observer", "observer, tuned"
DISTURBED, DISTURBED_TUNED = "observer, disturbance", "observer, disturbance, tuned"
BUTTERWORTH = "Butterworth"
BANDWIDTHS = (1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 80.0, 120.0, 200.0, 300.0, 500.0)  # [1/s]

SWEPT: Mapping[str, tuple[str, str, tuple[float, ...]]] = {
    TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    DISTURBED_TUNED: ("riemannian_observer", "bandwidth", BANDWIDTHS),
    BUTTERWORTH: ("filtered_differences", "cutoff", CUTOFFS),
    "high gain": ("high_gain", "bandwidth", BANDWIDTHS),
    "EKF": ("lagrangian_ekf", "acceleration", DENSITIES),
    "UKF": ("lagrangian_ukf", "acceleration", DENSITIES),
}
"""plug-in, the field that is swept, and its values"""


@dataclass(frozen=True)
class Motion:
    """A mechanism and how it is moved: all that a worker needs."""

    mechanism: str  # as the scenario calls it
    frequency: float  # [rad/s]
    seconds: float  # of the run
    load: float = 1.0
    tracked: bool = True  # joints to and fro; else every actuator is given a sine
    seed: int = 0


@cache
def recorded(motion: Motion) -> tuple[LagrangianMission, list[RecordedCall]]:
    """A flight of it with the observer in the loop, as calls of an estimator, and what that is told."""
    fields: dict[str, Any] = {
        "mechanism": motion.mechanism, "load": motion.load, "duration": motion.seconds, "settled": 0.0,
        "reading.resolution": BITS, "estimator.bandwidth": OMEGA, "planner.frequency": motion.frequency,
    }  # fmt: skip
    controller = "joint_tracking"
    if not motion.tracked:
        controller = "input_signal"
        inputs = len(believed(ArmVelocityConfig(mechanism=motion.mechanism)).system.inputs)
        fields["planner.amplitude"] = (1.0,) * inputs
    flight = trial("arm-velocity", motion.seed, controller=controller, fields=fields)
    recording = flight.build().run().recording
    agent, truth = recording.agents[VEHICLE], recording.truths[VEHICLE]
    calls = [
        RecordedCall(
            float(t),
            (Measurement(POSITION, float(t), agent.readings[POSITION][k]),),
            agent.commands[max(0, k - 1)],
            truth[k],
        )
        for k, t in enumerate(recording.t)
    ]
    return believed(flight.config), calls


@dataclass(frozen=True)
class Comparison:
    """An estimator over one motion."""

    mechanism: str
    estimator: str
    error: float  # [rad/s, m/s] root mean square of |qvel^ - qvel|
    setting: float  # of the field that was swept; nan
    at_edge: bool  # of the sweep
    peak: float  # [rad/s, m/s] the largest joint speed


@dataclass(frozen=True)
class Compared:
    """A mechanism, and the estimators to run over it."""

    tuning: Motion
    motion: Motion
    estimators: tuple[str, ...]
    values: int  # of a sweep, at most


def compared(job: Compared) -> list[Comparison]:
    """Every estimator over the same readings."""
    mission, calls = recorded(job.motion)
    rates = slice(mission.system.manifold.size, None)
    peak = float(np.abs([call.truth[rates] for call in calls]).max())
    found = []
    for name in job.estimators:
        plugin, config, setting, at_edge = _tuned(name, job)
        error = recorded_error(plugin.build(config, mission), calls, rates, BEGIN)
        found.append(Comparison(job.motion.mechanism, name, error, setting, at_edge, peak))
    return found


def _tuned(name: str, job: Compared) -> tuple[Any, Any, float, bool]:
    """A plug-in, its configuration, the value of the swept field, and whether that is at the edge of the sweep."""
    if name not in SWEPT:
        plugin = load("estimators", "riemannian_observer")
        return plugin, plugin.Config(bandwidth=OMEGA, disturbance=name == DISTURBED), float("nan"), False
    called, field, grid = SWEPT[name]
    plugin = load("estimators", called)
    config = plugin.Config(disturbance=True) if name == DISTURBED_TUNED else plugin.Config()
    mission, calls = recorded(job.tuning)
    grid = tuple(grid[k] for k in sorted({round(k) for k in np.linspace(0, len(grid) - 1, min(job.values, len(grid)))}))
    rates = slice(mission.system.manifold.size, None)
    found = tuned(plugin, config, mission, calls, field, grid, rates, BEGIN)
    return plugin, replace(config, **{field: found.best}), found.best, found.at_edge


def update_cost(motion: Motion) -> list[float]:
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
    return [float(np.median(block)) for block in blocks]


def error_series(job: Compared) -> dict[str, list[float]]:
    """|qvel^ - qvel| over time [s] of each estimator, every ten milliseconds, for the picture."""
    mission, calls = recorded(job.motion)
    rates = slice(mission.system.manifold.size, None)
    series: dict[str, list[float]] = {"t": [call.t for call in calls[::10]]}
    for name in job.estimators:
        plugin, config, _, _ = _tuned(name, job)
        estimator = plugin.build(config, mission)
        x = [estimator.update(call.t, call.measurements, call.command).x for call in calls]
        off = [float(np.linalg.norm(a[rates] - call.truth[rates])) for a, call in zip(x, calls, strict=True)]
        series[name] = off[::10]
    return series
