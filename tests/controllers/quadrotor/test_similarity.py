"""The same problem in other units."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.quadrotor.similarity import Similarity, SimilarPlanner
from mathnavi.interfaces.signals import Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.terrain.visibility import Radar
from tests.flight import assert_well_formed
from tests.quadrotor import flight_mission, hills, turning

factors = st.floats(0.1, 100.0)


class Recorder:
    """A planner that keeps what it was asked and answers with the plan it was given."""

    period = 5.0 / 3.0

    def __init__(self, answer: Plan) -> None:
        self.answer = answer
        self.asked: list[PlanRequest] = []

    def plan(self, request: PlanRequest) -> Plan:
        self.asked.append(request)
        return self.answer


@settings(max_examples=20, deadline=None)
@given(length=factors, time=factors, seed=st.integers(0, 1000))
def test_a_plan_magnified_is_a_plan_and_shrunk_again_the_same(length: float, time: float, seed: int) -> None:
    similarity, plan = Similarity(length, time), turning(np.random.default_rng(seed), 4.0, 10.0)
    magnified = similarity.plan(plan)
    duration = np.diff(magnified.t)[:, None]
    scale = np.abs(magnified.x).max()
    np.testing.assert_allclose(flow(magnified.x[:-1], magnified.u, duration), magnified.x[1:], atol=1e-9 * scale)
    back = similarity.inverse().plan(magnified)
    for one, other in zip((back.t, back.x, back.u), (plan.t, plan.x, plan.u), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-9)


def test_a_mission_becomes_one_at_the_speed_of_the_thesis() -> None:
    mission = flight_mission(hills(), (40.0, 50.0), (350.0, 340.0))
    similarity = Similarity.for_mission(mission)
    magnified = similarity.mission(mission)
    assert magnified.speed_max == pytest.approx(300.0)
    assert Recorder.period / similarity.time == pytest.approx(0.5)
    times = magnified.speed_max / magnified.acceleration_max, mission.speed_max / mission.acceleration_max
    assert times[0] == pytest.approx(similarity.time * times[1])
    p = np.array(mission.target[:2])
    assert magnified.terrain.height(*(p * similarity.length)) == pytest.approx(
        similarity.length * float(mission.terrain.height(*p))
    )


def test_a_request_is_magnified_and_the_answer_shrunk() -> None:
    similarity = Similarity(50.0, 2.0)
    plan = turning(np.random.default_rng(0), 4.0, 10.0)
    inner = Recorder(dataclasses.replace(similarity.plan(plan), ready=3.0))
    planner = SimilarPlanner(inner, similarity)
    ground = hills()
    messages = (
        Message(1.0, "tower", "radars", (Radar(10.0, 20.0, 30.0, 4.0),)),
        Message(1.0, "tower", "target", [10, 20.0, 30.0]),
        Message(1.0, "tower", "terrain", ground),
        Message(1.0, "fleet", "arrival time", 70.0),
        Message(1.0, "stranger", "radars", ("nonsense",)),
        Message(1.0, "stranger", "weather", "fair"),
    )
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    answer = planner.plan(PlanRequest(1.5, 2.0, Estimate(1.5, x), plan, messages))
    asked = inner.asked[0]
    assert (asked.t, asked.t_start) == (3.0, 4.0)
    np.testing.assert_allclose(asked.estimate.x, [50.0, 100.0, 150.0, 100.0, 125.0, 150.0])
    radars, target, terrain, arrival, *strange = asked.messages
    assert radars.payload == (Radar(500.0, 1000.0, 1500.0, 4.0),)
    assert target.payload == (500.0, 1000.0, 1500.0)
    assert terrain.payload.spacing == 50.0 * ground.spacing
    np.testing.assert_array_equal(terrain.payload.z, 50.0 * ground.z)
    assert arrival.payload == 140.0
    assert [each.payload for each in strange] == [("nonsense",), "fair"]
    assert asked.current is not None
    assert answer.ready == 1.5
    assert planner.period == inner.period / 2.0
    assert_well_formed(dataclasses.replace(answer, t=plan.t))
    assert answer.t_start == 2.0


def test_a_failure_stays_one() -> None:
    planner = SimilarPlanner(Recorder(Plan.failure(Status.INFEASIBLE, "no way")), Similarity(50.0, 2.0))
    answer = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, np.zeros(6)), None))
    assert (answer.status, answer.message) == (Status.INFEASIBLE, "no way")


@pytest.mark.parametrize("fields", [(0.0, 1.0), (1.0, -1.0), (np.inf, 1.0)])
def test_factors_that_cannot_be_are_refused(fields: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"(length|time) = .*; allowed"):
        Similarity(*fields)
