"""What is certified is the vehicle with its extent: a ball that touches no ground and no wall, and stays on the map."""

from __future__ import annotations

import dataclasses
from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import mathnavi as mn
from mathnavi.controllers.flight.certificate import Certificate, TrackingBound
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.quadrotor.similarity import Similarity
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.signals import Plan
from mathnavi.models.aerial.dynamics import HULL_RADIUS, state_at
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig
from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
from mathnavi.sim.scenarios.flight_parts import check_above_ground
from tests import flight

EXACT = TrackingBound(0.0, 0.0, 0.0, 0.0)
WALL, HEIGHT = 30, 300.0  # [m] where it stands on a grid of 1 m, and how high it is


@cache
def walled(north: bool = True) -> HeightField:
    """A plain with a vertical wall, as far as a grid of 1 m has one, from south to north or from west to east."""
    z = np.zeros((41, 61))
    z[:, WALL] = HEIGHT
    return HeightField(z if north else z.T, 1.0)


@cache
def world(ground: HeightField) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = build_model(ground, ("vehicle",), 40.0)
    return model, mujoco.MjData(model)


def along(x: float, height: float, clearance_min: float, ground: HeightField) -> tuple[FlightMission, Plan]:
    """From south to north beside the wall, at an easting [m] and a height [m]."""
    start, target = (x, 5.0, height), (x, 35.0, height)
    mission = FlightMission(ground, start, target, clearance_min, arrival_radius=5.0)
    arcs = ArcList.begin(0.0, flight.at_rest(start))
    arcs.add(np.array([0.0, 3.0, 0.0]), np.sqrt(10.0), FlightPhase.CRUISE)
    arcs.add(np.array([0.0, -3.0, 0.0]), np.sqrt(10.0), FlightPhase.CRUISE)
    arcs.rest()
    return mission, arcs.plan(0.0, 0.0)


def contacts(ground: HeightField, plan: Plan, reach: float = HULL_RADIUS, samples: int = 25) -> int:
    """Contacts of MuJoCo's hull, as large as ``reach`` [m], with the ground on the way of a plan."""
    (model, data), count = world(ground), 0
    model.geom("vehicle/hull").size[0] = model.geom_rbound[model.geom("vehicle/hull").id] = reach
    for t in np.linspace(plan.t[0], plan.t_end, samples):
        data.qpos[:] = state_at(plan, float(t))[:3]
        mujoco.mj_forward(model, data)
        count += int(data.ncon)
    return count


def test_the_hull_that_is_certified_is_that_of_the_model() -> None:
    model = build_model(walled(), ("vehicle",), 40.0)
    assert model.geom("vehicle/hull").size[0] == HULL_RADIUS
    assert [geom for geom in range(model.ngeom) if model.geom_contype[geom]] == [
        model.geom("terrain").id,
        model.geom("vehicle/hull").id,
    ]


def test_a_centre_that_is_high_above_the_ground_below_it_may_still_touch_a_wall() -> None:
    ground = walled()
    mission, plan = along(WALL - 1.2, 60.0, 50.0, ground)
    assert contacts(ground, plan) > 0
    point = dataclasses.replace(mission, reach=0.0)
    assert Certificate.for_mission(point, EXACT).check(plan) is None  # of a mere point it would be safe
    refusal = Certificate.for_mission(mission, EXACT).check(plan)
    assert refusal is not None
    assert refusal.status is FlightStatus.LOW_CLEARANCE
    assert not mn.certify(plan, ground)
    with pytest.raises(MissionError, match=r"start = .* is below the least clearance"):
        check_above_ground("start", mission.start, mission)


@given(
    x=st.floats(0.0, 60.0),
    height=st.floats(0.0, 320.0),
    reach=st.floats(0.05, 6.0),
    over=st.floats(1e-3, 20.0),
    error=st.floats(0.0, 1.0),
    north=st.booleans(),
)
@settings(max_examples=60, deadline=None)
@example(x=WALL - 1.2, height=60.0, reach=0.5, over=49.5, error=0.0, north=True)
@example(x=0.2, height=60.0, reach=0.5, over=1.0, error=0.0, north=True)
@example(x=5.0, height=1.0, reach=0.9, over=0.01, error=0.0, north=False)
def test_a_certified_body_touches_nothing_whatever_its_size(
    x: float, height: float, reach: float, over: float, error: float, north: bool
) -> None:
    ground = walled()
    mission, plan = along(x, height, reach + over, ground)
    if not north:  # the same map and the same way with east and north exchanged: taller than wide
        ground = walled(north=False)
        swapped = plan.x[:, [1, 0, 2, 4, 3, 5]], plan.u[:, [1, 0, 2]]
        plan = dataclasses.replace(plan, x=swapped[0], u=swapped[1])
        start, target = tuple(plan.x[0, :3].tolist()), tuple(plan.x[-1, :3].tolist())
        mission = dataclasses.replace(mission, terrain=ground, start=start, target=target)
    mission = dataclasses.replace(mission, reach=reach)
    if Certificate.for_mission(mission, TrackingBound(error, error, 0.0, 0.0)).check(plan) is not None:
        return
    for offset in error * np.array([[1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [0.0, 1.0, -1.0], [0.0, -1.0, -1.0]]):
        displaced = dataclasses.replace(plan, x=plan.x + np.concatenate([offset, np.zeros(3)]))
        assert contacts(ground, displaced, reach, 5) == 0
        for axis, side in enumerate((ground.width, ground.depth)):
            assert displaced.x[:, axis].min() >= reach - 1e-9
            assert displaced.x[:, axis].max() <= side - reach + 1e-9


def test_far_from_the_wall_the_body_costs_nothing() -> None:
    mission, plan = along(10.0, 60.0, 50.0, walled())
    assert Certificate.for_mission(mission, EXACT).check(plan) is None


def test_a_least_clearance_below_the_hull_is_refused_with_both_numbers() -> None:
    mission, _ = along(10.0, 60.0, 0.3, walled())
    with pytest.raises(FieldError, match=r"clearance_min = 0\.3 m; allowed: >= 0\.5 m"):
        Certificate.for_mission(mission, EXACT)
    with pytest.raises(MissionError, match=r"clearance_min = 0\.3; allowed: >= reach = 0\.5"):
        mn.certify(along(10.0, 60.0, 0.3, walled())[1], walled(), clearance_min=0.3)
    for config in (SafeFlightConfig, SimultaneousArrivalConfig):
        with pytest.raises(FieldError, match=r"clearance_min = 0\.3; allowed: >= 0\.5 m"):
            config(clearance_min=0.3)
    with pytest.raises(FieldError, match=r"separation = 0\.9; allowed: >= 1 m"):
        SimultaneousArrivalConfig(separation=0.9)


@pytest.mark.parametrize("x", [0.4, 59.7])
def test_an_end_from_which_the_body_leaves_the_map_is_refused(x: float) -> None:
    mission, _ = along(x, 60.0, 50.0, walled())
    with pytest.raises(MissionError, match=r"start = .* m from the edge of the map; allowed: >= 0\.5 m"):
        check_above_ground("start", mission.start, mission)


def test_a_body_whose_reach_is_in_the_terrain_still_keeps_from_the_edge() -> None:
    mission, plan = along(0.3, 60.0, 0.0, walled())
    raised = dataclasses.replace(mission, reach=0.335, reach_in_terrain=True)
    refusal = Certificate.for_mission(raised, EXACT).check(plan)
    assert refusal is not None
    assert refusal.status is FlightStatus.OFF_MAP


def test_a_magnified_mission_has_a_magnified_body() -> None:
    mission, _ = along(10.0, 60.0, 50.0, walled())
    similarity = Similarity.for_mission(mission)
    assert similarity.mission(mission).reach == pytest.approx(similarity.length * mission.reach)
