"""Regions of convergence are determined by running an estimator, modulo the symmetry of the wall."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.observability.region import ConvergenceCriterion, converges, exact_run, region_of_convergence
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.unicycle.mission import RangingMission
from tests.estimators.observability.fields import ELLIPSE
from tests.ranging import driven, eight

MISSION = RangingMission(ELLIPSE, (-1.0, 1.0))
DEVIATION = (0.5, 0.5, 0.5)
WITHIN = ConvergenceCriterion(position=0.3, heading=0.2, last=0.25)
START = np.array([0.4, 0.1, 0.3])


@dataclass(frozen=True)
class NoConfig:
    pass


class DeadReckoning:
    """Follows the odometry from the start that it is given: it converges if that is near enough, and never corrects."""

    Config = NoConfig

    def __init__(self, mission: RangingMission) -> None:
        self.period, self._mission, self._x, self._t = mission.period, mission, mission.start_pose, 0.0

    @staticmethod
    def build(config: Any, mission: RangingMission) -> DeadReckoning:
        return DeadReckoning(mission)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        for reading in measurements:
            if reading.name == "odometry":
                self._x = self._mission.flow(self._x, reading.value, t - self._t)
        self._t = t
        return Estimate(t, self._x)


def test_a_run_is_what_a_robot_sees_that_drives() -> None:
    run, steps = exact_run(MISSION, START, eight, 1.0), list(driven(MISSION, START, 1.0))
    assert len(run.t) == len(steps) == 101
    for k, step in enumerate(steps):
        assert run.t[k] == pytest.approx(step.t)
        np.testing.assert_allclose(run.truth[k], step.truth, atol=1e-12)
        np.testing.assert_allclose(run.commands[k], step.command, atol=1e-12)
        assert [reading.name for reading in run.readings[k]] == [reading.name for reading in step.measurements]
        for ours, theirs in zip(run.readings[k], step.measurements, strict=True):
            np.testing.assert_allclose(ours.value, theirs.value, atol=1e-12)


def test_the_region_of_dead_reckoning_is_what_counts_as_converged() -> None:
    run = exact_run(MISSION, START, eight, 2.0)
    offsets = np.array([[0, 0, 0], [0.29, 0, 0], [0.31, 0, 0], [0, -0.2, 0], [0, 0, 0.3], [0, 0, -0.05], [1, 0, 0]])
    converged = region_of_convergence(DeadReckoning, NoConfig(), run, START + offsets, DEVIATION, WITHIN)
    assert converged.tolist() == [True, True, False, True, False, True, False]


def test_to_follow_an_indistinguishable_state_is_to_converge() -> None:
    run = exact_run(MISSION, START, eight, 1.0)
    assert region_of_convergence(DeadReckoning, NoConfig(), run, ELLIPSE.images(START), DEVIATION, WITHIN).all()


def test_an_estimator_is_given_its_start_and_the_deviation() -> None:
    starts = []

    class Listens(DeadReckoning):
        @staticmethod
        def build(config: Any, mission: RangingMission) -> DeadReckoning:
            starts.append(mission.start)
            return DeadReckoning(mission)

    region_of_convergence(Listens, NoConfig(), exact_run(MISSION, START, eight, 0.1), START[None], DEVIATION, WITHIN)
    (start,) = starts
    assert start is not None
    assert (start.pose, start.deviation) == (tuple(START), DEVIATION)


def test_only_the_last_part_counts() -> None:
    class Jumps:
        period = MISSION.period

        def __init__(self, until: float) -> None:
            self._until = until

        def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
            error = 0.0 if t >= self._until else 1.0
            return Estimate(t, run.truth[round(t / MISSION.period)] + error)

    run = exact_run(MISSION, START, eight, 2.0)
    assert converges(Jumps(until=1.5), run, WITHIN)
    assert not converges(Jumps(until=1.6), run, WITHIN)
    assert not converges(Jumps(until=math.inf), run, WITHIN)


def test_a_run_out_of_the_field_is_refused() -> None:
    with pytest.raises(ValueError, match="the run leaves the field"):
        exact_run(MISSION, START, lambda t: (3.0, 0.0), 3.0)
