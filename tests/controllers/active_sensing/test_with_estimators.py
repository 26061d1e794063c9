"""With real estimators that have yet to find the pose, noise and no MuJoCo: the robot keeps off the wall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.field.curve import BEAN, EGG, Curve
from mathnavi.models.unicycle.entity import RADIUS
from mathnavi.models.unicycle.kernels import sinc, wrapped
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from mathnavi.sim.plugin.registry import load
from tests.controllers.active_sensing.robots import FIELD, Believing, built, fly, mission

NOISE = {"ranging": RangeQuality(0.05), "odometry": OdometryQuality((0.05, 0.05), 0.02)}


def estimating(name: str, curve: Curve, rng: np.random.Generator) -> Believing:
    """Estimates of a plug-in from noisy readings, its start unknown."""
    task = mission(curve, **NOISE)
    plugin = load("estimators", name)
    estimator = plugin.build(plugin.Config(), task)
    last: list[Array] = []

    def believing(t: float, truth: Array) -> Estimate:
        rho, _ = curve.ranges(truth, task.alpha)
        readings = [Measurement("ranges", t, rho * (1.0 + 0.05 * rng.standard_normal(len(rho))))]
        u = np.zeros(2)
        if last:
            turn = wrapped(float(truth[2] - last[-1][2]))
            step, direction = truth[:2] - last[-1][:2], last[-1][2] + 0.5 * turn
            chord = step @ [math.cos(direction), math.sin(direction)]
            u = np.array([chord / sinc(0.5 * turn), turn]) / task.period
            readings.append(Measurement("odometry", t, 1.02 * u + 0.05 * rng.standard_normal(2)))
        last[:] = [truth]
        estimate: Estimate = estimator.update(t, tuple(readings), u)
        return estimate

    return believing


@pytest.mark.parametrize(
    ("curve", "name", "mode", "seed"),
    [
        # What touched the wall when an estimate was believed to be as sure as it said.
        (BEAN, "range_observer", "active", 4),
        (BEAN, "range_observer", "active", 5),
        (BEAN, "range_ekf", "active", 0),
        (BEAN, "range_ekf", "active", 3),
        (EGG, "feasible_set_bank", "active", 4),
        (FIELD, "range_observer", "random", 1),
        (FIELD, "feasible_set_bank", "active", 1),
    ],
)
def test_estimates_on_their_way_to_the_truth_do_not_lead_to_the_wall(
    curve: Curve, name: str, mode: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    task = mission(curve, **NOISE)
    start = task.curve.draw(rng, task.margin)
    flight = fly(built(task, mode=mode, seed=1 + seed), task, start, 7.0, estimating(name, curve, rng))
    assert np.isfinite(np.array(flight.truth)).all()
    assert flight.clearance(curve) > RADIUS
