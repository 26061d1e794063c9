"""What an update of each range estimator costs: thread CPU time on one thread, over one and the same readings.

The compiled ones are loops over the kernels that the plug-ins call, without the plug-ins' Python: the bank as it is
flown, the bank if no hypothesis were ever dropped, a single filter of it, and a particle filter that propagates, weighs,
and, when N_eff is below N / 2, resamples and roughens.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from estimators.ranging.extended import RangeEkf
from estimators.ranging.feasible_set_bank import FeasibleSetBank, FeasibleSetBankConfig
from estimators.ranging.model import STATES, RangeModel, chi_square_gate
from estimators.ranging.particle import RangeParticle, RangeParticleConfig
from estimators.ranging.unscented import RangeUkf
from models.field.curve import ellipse
from models.unicycle.mission import OdometryQuality, RangeQuality, RangingMission
from models.unicycle.patterns import figure_eight
from sim.signals import Array, Measurement

FIELD = ellipse(3.763, math.sqrt(2.0))
START = (1.0, 0.2, 0.5 * math.pi)  # from where the figure of eight stays within the field

BANK, ALL_ALIVE, EKF, PARTICLES = "bank", "bank, none dropped", "one filter of it", "1000 particles"
PLUGINS = {
    "feasible_set_bank": FeasibleSetBank,
    "range_ekf": RangeEkf,
    "range_ukf": RangeUkf,
    "range_particle": RangeParticle,
}


@dataclass(frozen=True, eq=False)
class Readings:
    """What a robot reads that drives a figure of eight."""

    mission: RangingMission
    ranges: Array  # (n, l) [m]
    inputs: Array  # (n, 2) [m/s, rad/s] over the periods that end with them


def read(sensors: tuple[float, ...], seconds: float, rng: np.random.Generator) -> Readings:
    """With sensors at angles [deg], ranges 5 % off, and odometry .05 off per reading and 2 % always."""
    mission = RangingMission(
        FIELD,
        tuple(math.radians(angle) for angle in sensors),
        RangeQuality(0.05),
        OdometryQuality((0.05, 0.05), 0.02),
    )
    x, u, ranges, inputs = np.array(START), np.zeros(2), [], []
    for k in range(round(seconds / mission.period)):
        rho, _ = FIELD.ranges(x, mission.alpha)
        ranges.append(rho * (1.0 + mission.ranging.relative * rng.standard_normal(len(rho))))
        inputs.append((1.0 + mission.odometry.bias) * u + mission.odometry.noise * rng.standard_normal(2))
        u = np.array(figure_eight((k + 0.5) * mission.period, 0.5, 8.0))
        x = mission.flow(x, u, mission.period)
    return Readings(mission, np.array(ranges), np.array(inputs))


def costs(readings: Readings, repetitions: int) -> Mapping[str, Array]:
    """(R,) [us] an update, by name: each once in each of R rounds, after a round that compiles."""
    works: dict[str, Callable[[], Any]] = {
        ALL_ALIVE: partial(_bank, readings, FeasibleSetBankConfig().hypotheses, -math.inf, 0.0),
        BANK: partial(_bank, readings, FeasibleSetBankConfig().hypotheses, FeasibleSetBankConfig().lowest, 1.0),
        EKF: partial(_bank, readings, 1, -math.inf, 0.0),
        PARTICLES: partial(_particles, readings),
        **{name: partial(_plugin, readings, plugin) for name, plugin in PLUGINS.items()},
    }
    taken: dict[str, list[float]] = {name: [] for name in works}
    for repetition in range(repetitions + 1):
        for name, work in works.items():
            began = time.thread_time()
            updates = work()
            if repetition:
                taken[name].append(1e6 * (time.thread_time() - began) / updates)
    return {name: np.array(figures) for name, figures in taken.items()}


def _plugin(readings: Readings, plugin: Any) -> int:
    estimator, period = plugin.build(plugin.Config(), readings.mission), readings.mission.period
    for k, (rho, u) in enumerate(zip(readings.ranges, readings.inputs, strict=True)):
        t = k * period
        estimator.update(t, (Measurement("ranges", t, rho), Measurement("odometry", t, u)), u)
    return len(readings.ranges)


def _bank(readings: Readings, count: int, lowest: float, twin: float) -> int:
    """So many of the bank's own first hypotheses over all readings but those that made them."""
    config, model, mission = FeasibleSetBankConfig(), RangeModel(readings.mission), readings.mission
    bank, n = FeasibleSetBank(config, mission), config.readings
    for k in range(n):
        t = k * mission.period
        made = bank.update(t, (Measurement("ranges", t, readings.ranges[k]),), readings.inputs[k])
    poses = made.extra["hypotheses"][np.isfinite(made.extra["scores"])][:count]
    x, P = np.zeros((len(poses), STATES)), np.tile(model.covariance(config.deviation), (len(poses), 1, 1))
    x[:, :3] = poses
    settings = (chi_square_gate(config.gate), config.forgetting, lowest, twin)
    symmetry = (mission.curve.symmetry, *mission.curve.centre)
    _bank_updates(
        x, P, readings.ranges[n:], readings.inputs[n:], model.W, *model.wall, model.angles, model.relative,
        model.absolute, *settings, *symmetry, mission.period,
    )  # fmt: skip
    return len(readings.ranges) - n


def _particles(readings: Readings) -> int:
    config, model, rng = RangeParticleConfig(), RangeModel(readings.mission), np.random.default_rng(0)
    x = model.particles(config.particles, rng)
    _particle_updates(
        x, readings.ranges, readings.inputs, np.sqrt(model.W), *model.wall, model.angles, model.relative,
        model.absolute, chi_square_gate(config.gate), config.roughening, readings.mission.period, rng,
    )  # fmt: skip
    return len(readings.ranges)
