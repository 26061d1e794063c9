"""The planner arrives over real mountains, keeps what it promises, and answers what turns out otherwise."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from ridgeline.controller import Roadmap, RoadmapConfig

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.interfaces.signals import Estimate, Message, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.knowledge import RADARS
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.library import load_terrain
from mathnavi.models.terrain.visibility import Radar
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.flight_parts import drawn_point
from mathnavi.sim.scenarios.safe_flight import SafeFlight

WAY = (12_000.0, 14_000.0, 2924.0), (63_000.0, 62_000.0, 5258.0)  # over the Tian Shan
BANDWIDTH = RoadmapConfig().bandwidth


def mission(**fields: object) -> FlightMission:
    return dataclasses.replace(FlightMission(load_terrain("tian_shan"), *WAY), **fields)


def asked(planner: object, x: np.ndarray, t: float = 0.0, current: Plan | None = None, *news: Message) -> Plan:
    start = t if current is None else t + planner.period
    return planner.plan(PlanRequest(t, start, Estimate(t, x), current, news))


def first_plan(wanted: FlightMission) -> tuple[object, Plan]:
    planner, _ = Roadmap.build(RoadmapConfig(), wanted)
    return planner, asked(planner, wanted.start_state)


def seconds_seen(plan: Plan, wanted: FlightMission, radar: Radar) -> int:
    t = np.arange(plan.t_start, plan.t_end)
    return int(radar.exposed(wanted.terrain, state_at(plan, t)[:, :3]).sum())


@pytest.mark.parametrize(("terrain", "separation"), [("jacksboro", (0.3, 0.5)), ("tian_shan", (0.3, 0.4))])
def test_a_mission_drawn_from_a_seed_arrives_in_time(terrain: str, separation: tuple[float, float]) -> None:
    config = SafeFlight.Config(terrain, drawn_separation=separation)
    outcome = SafeFlight.build(config, seed=1, controller=PluginSpec.with_fields(Roadmap)).run()
    assert outcome.success
    assert outcome.summary["plans_rejected"] == outcome.summary["solver_failures"] == 0


@pytest.mark.parametrize("terrain", ["jacksboro", "tian_shan"])
def test_first_plans_between_places_near_the_ground_are_certified_and_hardly_longer_than_a_straight_line(
    terrain: str,
) -> None:
    rng, longer = np.random.default_rng(2), []
    for _ in range(3):
        drawn = FlightMission(load_terrain(terrain), *WAY)
        ends = [drawn_point(drawn, (0.5, 50.0), rng) for _ in range(2)]
        drawn = dataclasses.replace(drawn, start=ends[0], target=ends[1])
        _, plan = first_plan(drawn)
        assert plan.ok, plan.message
        assert Certificate.for_mission(drawn, tracking_bound(BANDWIDTH, drawn)).check(plan) is None
        longer.append(plan.t_end / (math.dist(*ends) / drawn.speed_max + drawn.speed_max / drawn.acceleration_max))
    assert max(longer) < 1.3


def test_a_radar_known_from_the_start_is_flown_around() -> None:
    radar = Radar(36_000.0, 39_000.0, 10_000.0, 10.0)
    _, straight = first_plan(mission())
    _, around = first_plan(mission(radars=(radar,)))
    assert seconds_seen(around, mission(), radar) < 0.2 * seconds_seen(straight, mission(), radar)


def test_without_news_the_plan_stays_and_with_news_it_is_left_where_it_is_flown() -> None:
    planner, current = first_plan(mission())
    t = 40.0
    stays = asked(planner, state_at(current, t), t, current)
    np.testing.assert_array_equal(stays.x[1:], current.x[-len(stays.x) + 1 :])
    radar = Radar(36_000.0, 39_000.0, 10_000.0, 10.0)
    turns = asked(planner, state_at(current, t), t, current, Message(t, "radar warning", RADARS, (radar,)))
    assert turns.ok, turns.message
    np.testing.assert_allclose(turns.x[0], state_at(current, t + planner.period), atol=1e-6)
    assert np.linalg.norm(turns.x[0, 3:]) > 200.0  # in full flight
    assert seconds_seen(turns, mission(), radar) < 0.2 * seconds_seen(stays, mission(), radar)


def test_where_no_way_leads_on_it_says_so() -> None:
    planner, _ = Roadmap.build(RoadmapConfig(), mission())
    below = mission().start_state - [0.0, 0.0, 1000.0, 0.0, 0.0, 0.0]
    plan = asked(planner, below)
    assert not plan.ok
    assert "no way leads from" in plan.message


@pytest.mark.parametrize("field", ["columns", "layers", "period", "bandwidth"])
def test_a_field_out_of_range_is_refused_by_its_name(field: str) -> None:
    with pytest.raises(ValueError, match=rf"{field} = 0.*allowed"):
        RoadmapConfig(**{field: 0})
