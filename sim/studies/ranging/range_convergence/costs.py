"""Costs of an update of each range estimator: thread CPU time on one thread, over one and the same readings.

The compiled ones are loops over the kernels that the plug-ins call, without the plug-ins' Python: the bank as it is
flown, the bank if no hypothesis were ever dropped, a single filter of the bank, and 1000 particles: the kernels of the
particle filter with a number of particles that stays. The plug-in itself has as many as it needs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mathnavi.estimators.ranging.bank_kernels import Scoring, no_hypotheses
from mathnavi.estimators.ranging.extended import RangeEkf
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank, FeasibleSetBankConfig
from mathnavi.estimators.ranging.kalman_kernels import no_innovations
from mathnavi.estimators.ranging.model import RangeModel, chi_square_gate
from mathnavi.estimators.ranging.noise_kernels import WINDOW, declared_noise
from mathnavi.estimators.ranging.particle import RangeParticle, RangeParticleConfig
from mathnavi.estimators.ranging.particle_clusters import Cells
from mathnavi.estimators.ranging.unscented import RangeUkf
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array, Measurement
from mathnavi.sim.studies.ranging.observability_measures import STANDARD
from mathnavi.sim.studies.ranging.range_convergence.cost_kernels import (
    Quality,
    RecordedReadings,
    bank_updates,
    particle_updates,
)
from mathnavi.sim.studies.ranging.range_convergence.runs import declared_mission, noisy_run

START = (1.0, 0.2, 0.5 * math.pi)  # from where the figure of eight stays within the standard field

_PARTICLES = 1000
_MEMORY = 0.98  # of the misfit, which costs the same whatever it is

BANK_LOOP, ALL_ALIVE, EKF_LOOP, PARTICLE_LOOP = "bank", "bank, whole", "one EKF", "1000 particles"
PLUGINS = {
    "feasible_set_bank": FeasibleSetBank,
    "range_ekf": RangeEkf,
    "range_ukf": RangeUkf,
    "range_particle": RangeParticle,
}


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of a robot that drives a figure of eight."""

    mission: RangingMission
    ranges: Array  # (n, l) [m]
    inputs: Array  # (n, 2) [m/s, rad/s] over the periods that end with them


def read(sensors: str, seconds: float, rng: np.random.Generator) -> Readings:
    """Draw readings with a set of ``SENSORS``, by name, and the standard noise."""
    mission = declared_mission(STANDARD, sensors)
    readings = noisy_run(mission, np.array(START), seconds, rng).readings[1:]
    return Readings(mission, *(np.array([pair[k].value for pair in readings]) for k in (0, 1)))


def costs(readings: Readings, repetitions: int) -> Mapping[str, Array]:
    """(R,) [us] an update, by name: each once in each of R rounds, after a round that compiles."""
    config = FeasibleSetBankConfig()
    prepared: dict[str, Callable[[], Callable[[], int]]] = {
        ALL_ALIVE: partial(_bank, readings, config.hypotheses, -math.inf, 0.0),
        BANK_LOOP: partial(_bank, readings, config.hypotheses, config.lowest, 1.0),
        EKF_LOOP: partial(_bank, readings, 1, -math.inf, 0.0),
        PARTICLE_LOOP: partial(_particles, readings),
        **{name: partial(_plugin, readings, plugin) for name, plugin in PLUGINS.items()},
    }
    taken: dict[str, list[float]] = {name: [] for name in prepared}
    for repetition in range(repetitions + 1):
        for name, prepare in prepared.items():
            work = prepare()
            began = time.thread_time()
            updates = work()
            if repetition:
                taken[name].append(1e6 * (time.thread_time() - began) / updates)
    return {name: np.array(figures) for name, figures in taken.items()}


def _plugin(readings: Readings, plugin: Any) -> Callable[[], int]:
    """Prepare all updates of a plug-in, as the loop calls it."""
    estimator, period = plugin.build(plugin.Config(), readings.mission), readings.mission.period
    calls = [
        (k * period, (Measurement("ranges", k * period, rho), Measurement("odometry", k * period, u)), u)
        for k, (rho, u) in enumerate(zip(readings.ranges, readings.inputs, strict=True))
    ]

    def work() -> int:
        for t, measurements, command in calls:
            estimator.update(t, measurements, command)
        return len(calls)

    return work


def _bank(readings: Readings, count: int, lowest: float, twin: float) -> Callable[[], int]:
    """Updates of so many of the bank's own first hypotheses, over all readings but those that made them."""
    config, model, mission = FeasibleSetBankConfig(), RangeModel(readings.mission), readings.mission
    bank, n, period = FeasibleSetBank(config, mission), config.readings, mission.period
    for k in range(n):
        made = bank.update(k * period, (Measurement("ranges", k * period, readings.ranges[k]),), readings.inputs[k])
    poses = made.extra["hypotheses"][np.isfinite(made.extra["scores"])][:count]
    hypotheses = no_hypotheses(len(poses), mission.sensors, WINDOW)
    hypotheses.x[:, :3], hypotheses.P[:], hypotheses.score[:] = poses, model.covariance(config.deviation), 0.0
    run = RecordedReadings(readings.ranges[n:], readings.inputs[n:], period)
    noise, innovations = declared_noise(mission.ranging.outliers), no_innovations(mission.sensors)
    quality = Quality(model.W, model.sensors(chi_square_gate(config.gate)), noise, innovations)
    scoring = Scoring(config.forgetting, _MEMORY, lowest, twin)
    symmetry = (mission.curve.symmetry, *mission.curve.centre)
    return lambda: int(bank_updates(hypotheses, run, model.wall, quality, scoring, symmetry))


def _particles(readings: Readings) -> Callable[[], int]:
    """Updates of so many particles that start anywhere."""
    config, model, rng = RangeParticleConfig(), RangeModel(readings.mission), np.random.default_rng(0)
    x, z, u, period = model.particles(_PARTICLES, rng), readings.ranges, readings.inputs, readings.mission.period
    sensors = model.sensors(math.inf)._replace(outliers=config.outliers)
    cells = Cells(config.cell_position, round(2.0 * math.pi / config.cell_heading))
    return lambda: int(
        particle_updates(x, z, u, np.sqrt(model.W), model.scale, model.wall, sensors, cells, period, rng)
    )
