"""``safe-flight`` through MuJoCo, over small mountains: it arrives, it clears the ground, whatever fails."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.fault_fields import AerialFaults
from mathnavi.sim.scenarios.flight_fields import FlightNoise, SafeFlightConfig
from mathnavi.sim.scenarios.safe_flight import SafeFlight
from tests import flight

H_MIN = 50.0  # [m]
NEAR = flight.above(flight.mountains(), (4500.0, 1500.0), 150.0)  # a target on the start's side of the ridge


@pytest.fixture(scope="session")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> str:
    return flight.save(flight.mountains(), tmp_path_factory.mktemp("terrain") / "mountains.npz")


def config(terrain: str, **fields: Any) -> SafeFlightConfig:
    ground = flight.mountains()
    ends = {"start": flight.above(ground, flight.START, 150.0), "target": flight.above(ground, flight.TARGET, 150.0)}
    return SafeFlightConfig(**{"terrain": terrain, **ends, **fields})


def flown(
    terrain: str,
    seed: int = 0,
    controller: str = "flight",
    estimator: str = "full_state",
    seconds: float = math.inf,
    **fields: Any,
) -> RunData:
    """A mission, or its first seconds."""
    parts = (
        PluginSpec.with_fields(load("controllers", controller)),
        PluginSpec.with_fields(load("estimators", estimator)),
    )
    built = SafeFlight.build(config(terrain, **fields), seed, *parts)
    return replace(built, duration=min(seconds, built.duration)).run()


def kinds(outcome: RunData) -> Counter[str]:
    return Counter(event.kind for event in outcome.recording.events)


def assert_safe(outcome: RunData) -> None:
    summary = outcome.summary
    assert summary["ground_contacts"] == 0
    assert summary["min_clearance_m"] >= H_MIN
    assert summary["arrived"]
    assert summary["arrival_time_s"] <= summary["deadline_s"]
    assert outcome.success


@pytest.fixture(scope="module")
def plain(terrain: str) -> RunData:
    """A flight without faults."""
    return flown(terrain)


def test_it_arrives_and_clears_the_ground(plain: RunData) -> None:
    assert_safe(plain)
    summary = plain.summary
    assert summary["fallback_steps"] == summary["tracking_breaches"] == summary["missed_passes"] == 0
    assert summary["planner_share"] > 0.99
    assert summary["path_length_m"] <= 1.15 * summary["straight_line_m"]
    assert summary["speed_max_m_s"] <= 300.0
    assert summary["tracking_error_max_m"] <= summary["tracking_bound_m"]


def test_what_was_flown_is_the_plans_that_were_adopted(plain: RunData) -> None:
    arrays = plain.arrays
    adopted = arrays["plan.adopted"]
    np.testing.assert_allclose(arrays["plan.t"][arrays["plan.offsets"][:-1]], adopted, atol=1e-9)
    starts = arrays["plan.x"][arrays["plan.offsets"][:-1]]
    steps = np.searchsorted(arrays["t"], adopted - 0.5 * TICK)
    np.testing.assert_allclose(arrays["truth.x"][steps], starts, atol=0.1)


def test_the_clearance_is_that_of_the_flown_path(plain: RunData) -> None:
    x = plain.arrays["truth.x"]
    height = x[:, 2] - flight.mountains().height(x[:, 0], x[:, 1])
    least = plain.summary["min_clearance_m"]
    assert least - 1e-2 <= height.min() <= least + 1.0


def test_the_same_seed_gives_the_same_log_bit_for_bit(terrain: str) -> None:
    fields: dict[str, Any] = {
        "target": NEAR,
        "noise": FlightNoise(position=3.0),
        "faults": AerialFaults(solver_failure_rate=0.3, late_plan_rate=0.2, gust_rms=1.0, dropout_rate=0.1),
    }
    one, same = (flown(terrain, 4, **fields) for _ in range(2))
    other = flown(terrain, 5, seconds=15.0, **fields)
    assert one.arrays.keys() == same.arrays.keys()
    for name, array in one.arrays.items():
        np.testing.assert_array_equal(array, same.arrays[name], err_msg=name)
    assert one.recording.events == same.recording.events
    first = len(other.arrays["truth.x"])
    assert not np.array_equal(one.arrays["truth.x"][:first], other.arrays["truth.x"])


@pytest.mark.parametrize(
    ("faults", "share"),
    [
        (AerialFaults(late_plan_rate=1.0), 0.3),  # the optimised part of the first plan, which is spared
        (AerialFaults(solver_failure_rate=1.0), 0.3),
    ],
)
def test_a_planner_that_is_never_heard_is_noticed(terrain: str, faults: AerialFaults, share: float) -> None:
    outcome = flown(terrain, faults=faults)
    assert_safe(outcome)
    assert outcome.summary["planner_share"] <= share


def test_late_and_corrupted_plans_do_not_matter(terrain: str) -> None:
    outcome = flown(terrain, faults=AerialFaults(late_plan_rate=0.5, corrupted_plan_rate=0.5))
    assert_safe(outcome)
    assert outcome.summary["late_plans"] > 0
    assert kinds(outcome)["not-finite"] > 0


def test_gusts_and_position_fixes_are_survived(terrain: str) -> None:
    outcome = flown(
        terrain, estimator="kalman", noise=FlightNoise(position=5.0), faults=AerialFaults(gust_rms=1.5, gust_limit=4.0)
    )
    assert_safe(outcome)
    assert outcome.summary["tracking_error_max_m"] > 1.0
    if outcome.summary["tracking_breaches"] == 0:
        assert outcome.summary["tracking_error_max_m"] <= outcome.summary["tracking_bound_m"]


def test_lost_readings_are_survived(terrain: str) -> None:
    outcome = flown(
        terrain,
        estimator="kalman",
        noise=FlightNoise(position=3.0),
        faults=AerialFaults(dropout_rate=0.5, gust_rms=0.5),
    )
    assert outcome.summary["ground_contacts"] == 0
    assert outcome.summary["min_clearance_m"] >= H_MIN
    assert outcome.summary["arrived"]
    missing = np.isnan(outcome.arrays["measurement.acceleration"]).any(axis=1)
    assert missing.mean() == pytest.approx(0.5, abs=0.05)


def test_a_radar_that_pops_up_reaches_the_planner_as_a_message(terrain: str, plain: RunData) -> None:
    radar = (6500.0, 6500.0, 2000.0, 8.0)
    outcome = flown(terrain, radar=(radar,), radar_time=12.0)
    assert_safe(outcome)
    (event,) = [event for event in outcome.recording.events if event.kind == "message"]
    assert 12.0 <= event.t <= 12.0 + 5.0 / 3.0
    before = int(np.searchsorted(outcome.arrays["t"], 12.0))
    np.testing.assert_array_equal(outcome.arrays["truth.x"][:before], plain.arrays["truth.x"][:before])
    assert not np.array_equal(outcome.arrays["truth.x"][-600:], plain.arrays["truth.x"][-600:])


def test_a_radar_known_from_the_start_bends_the_path(terrain: str, plain: RunData) -> None:
    radar = (6500.0, 6500.0, 2000.0, 8.0)
    outcome = flown(terrain, radar=(radar,))
    assert_safe(outcome)
    assert "message" not in kinds(outcome)
    assert outcome.summary["path_length_m"] > plain.summary["path_length_m"]


@dataclass(frozen=True)
class StrangerConfig:
    """Fields of a stranger's planner."""

    speed: float = 150.0


class Stranger:
    """Flies straight to the target, mountains or not, and is sometimes lucky."""

    Config = StrangerConfig

    @staticmethod
    def build(config: StrangerConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        return Straight(config, mission), FlightController.build(FlightConfig(), mission)[1]


class Straight:
    period = 2.0

    def __init__(self, config: StrangerConfig, mission: FlightMission) -> None:
        self._speed, self._target = config.speed, np.array(mission.target)

    def plan(self, request: PlanRequest) -> Plan:
        """From rest to rest along the straight line; only from a start at rest."""
        if request.estimate.x[3:].any():
            raise RuntimeError("can only start from rest")
        here = request.estimate.x[:3]
        way = self._target - here
        half = float(np.linalg.norm(way)) / self._speed
        u = way / half**2
        states = [here, np.zeros(3), here + 0.5 * way, half * u, self._target, np.zeros(3)]
        x: Array = np.concatenate(states).reshape(3, 6)
        return Plan(request.t_start + half * np.arange(3.0), x, np.array([u, -u]), np.zeros(2, np.int64))


class Raising:
    """A plug-in whose planner never answers."""

    Config = StrangerConfig

    @staticmethod
    def build(config: StrangerConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        return AlwaysRaises(), FlightController.build(FlightConfig(), mission)[1]


class AlwaysRaises:
    period = 1.0

    def plan(self, request: PlanRequest) -> Plan:
        raise NotImplementedError("not today")


def test_a_strangers_planner_flies_certified(terrain: str) -> None:
    outcome = flown(terrain, controller=f"{__name__}:Stranger")
    assert_safe(outcome)
    counts = kinds(outcome)
    assert counts["fallback-plan"] == 1  # the ridge is in its way
    assert counts["raised"] > 10
    easy = flown(terrain, controller=f"{__name__}:Stranger", target=NEAR)
    assert_safe(easy)
    assert "fallback-plan" not in kinds(easy)


def test_a_planner_that_always_raises_arrives_by_the_stored_plan(terrain: str) -> None:
    outcome = flown(terrain, controller=f"{__name__}:Raising")
    assert_safe(outcome)
    assert outcome.summary["plans_adopted"] == 1
    assert kinds(outcome)["raised"] == outcome.summary["replans"] - 1


def test_the_planner_as_printed_flies_without_a_certificate(terrain: str) -> None:
    outcome = flown(terrain, controller="as_printed", seconds=15.0, target=NEAR)
    assert outcome.summary["guarantee_lost"] is None  # there was none
    assert outcome.summary["plans_adopted"] > 1
    assert outcome.summary["tracking_error_max_m"] <= outcome.summary["tracking_bound_m"]
    assert not {"wrong-start", "deadline", "bounds"} & kinds(outcome).keys()


def test_a_folder_holds_what_it_takes_to_fly_again(plain: RunData, terrain: str, tmp_path: Path) -> None:
    plain.write(tmp_path)
    recorded = json.loads((tmp_path / "config.json").read_text())
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert recorded["scenario"] == "safe-flight"
    assert recorded["terrain"]["path"] == terrain
    assert recorded["terrain"]["digest"] == load_terrain(terrain).digest
    assert summary["arrived"] is True
    with np.load(tmp_path / "log.npz") as log:
        np.testing.assert_array_equal(log["truth.x"], plain.arrays["truth.x"])


@pytest.mark.parametrize("place", ["start", "target"])
@pytest.mark.parametrize(
    ("height", "message"),
    [(-10.0, "under ground"), (49.0, "below the least clearance"), (math.nan, "finite")],
)
def test_an_end_that_cannot_be_is_refused_by_name(terrain: str, place: str, height: float, message: str) -> None:
    with pytest.raises(ValueError, match=rf"{place} = .*{message}"):
        SafeFlight.build(config(terrain, **{place: flight.above(flight.mountains(), (5000.0, 5000.0), height)}), 0)


@pytest.mark.parametrize("place", ["start", "target"])
def test_an_end_off_the_map_is_refused_by_name(terrain: str, place: str) -> None:
    with pytest.raises(ValueError, match=rf"{place} = .*off the map"):
        SafeFlight.build(config(terrain, **{place: (-1.0, 100.0, 900.0)}), 0)


def test_ends_that_are_not_given_are_drawn_far_apart_and_certified(terrain: str) -> None:
    closed_loop = SafeFlight.build(SafeFlightConfig(terrain=terrain), 3)
    mission = closed_loop.config["mission"]
    start, target = np.array(mission["start"]), np.array(mission["target"])
    assert np.linalg.norm((target - start)[:2]) >= 0.8 * flight.SIDE
    for x, y, z in (start, target):
        assert z >= flight.mountains().height(x, y) + H_MIN


@pytest.mark.parametrize(
    ("group", "field", "value"),
    [
        (AerialFaults, "solver_failure_rate", 1.5),
        (AerialFaults, "position_jump", math.inf),
        (FlightNoise, "position_rate", 0.0),
        (SafeFlightConfig, "deadline_factor", 0.5),
        (SafeFlightConfig, "radar_until", 0.0),
        (SafeFlightConfig, "radar_velocity", (math.inf, 0.0)),
        (SafeFlightConfig, "target_path", ((0.0, 1.0, 2.0, 3.0),)),
        (SafeFlightConfig, "target_path", ((9.0, 1.0, 2.0, 3.0), (9.0, 1.0, 2.0, 3.0))),
        (SafeFlightConfig, "target_path", ((9.0, 1.0, math.nan, 3.0),)),
        (SafeFlightConfig, "target_path", ((1e8, 1.0, 2.0, 3.0),)),
        (SafeFlightConfig, "uncharted_time", 5.0),
        (SafeFlightConfig, "radar_velocity", (5.0, 0.0)),
        (SafeFlightConfig, "radar_until", 5.0),
    ],
)
def test_a_field_out_of_range_is_refused_by_name(group: type[Any], field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*allowed"):
        group(**{field: value})


def test_a_deadline_that_was_lost_is_not_kept_because_the_target_might_move(terrain: str) -> None:
    """A target that never moves promises nothing new."""
    rough: dict[str, Any] = {"faults": AerialFaults(position_jump=150.0), "deadline_factor": 1.0}
    plain = flown(terrain, seconds=40.0, **rough)
    resting = flown(terrain, seconds=40.0, **rough, target_path=((1.0, *flight.mission().target),))
    assert "deadline-lost" in [event.kind for event in plain.recording.events]
    assert resting.summary["deadline_s"] == pytest.approx(plain.summary["deadline_s"])


def test_plans_that_never_take_over_lose_the_arrival_at_a_target_that_moves(terrain: str) -> None:
    x, y, z = flight.above(flight.mountains(), (9000.0, 10_500.0), 150.0)
    late = AerialFaults(late_plan_rate=1.0, late_plan_latency=3.0)
    path = ((10.0, *flight.mission().target), (10.5, x, y, z))
    outcome = flown(terrain, seconds=40.0, deadline_factor=1.0, faults=late, target_path=path)
    kinds = [event.kind for event in outcome.recording.events]
    assert kinds.count("arrival-lost") == 1
    assert "deadline-moved" not in kinds
    assert outcome.summary["min_clearance_m"] >= H_MIN


def test_a_target_that_rests_before_it_moves_is_recorded_so(terrain: str) -> None:
    there = (9000.0, 10_500.0, 2000.0)
    built = SafeFlight.build(config(terrain, target_path=((20.0, *flight.mission().target), (30.0, *there))), 0)
    path = np.array(built.config["mission"]["target_path"])
    before = path[path[:, 0] <= 20.0]
    assert len(before) > 1
    np.testing.assert_allclose(before[:, 1:3], [flight.TARGET] * len(before))
    assert path[-1, 0] == 30.0


def test_a_vehicle_thrown_into_the_ground_is_not_reported_above_it(terrain: str) -> None:
    outcome = flown(terrain, faults=AerialFaults(position_jump=1500.0))
    x = outcome.recording.truths["vehicle"]
    lowest = float(np.nanmin(x[:, 2] - flight.mountains().height(x[:, 0], x[:, 1])))
    assert lowest < 0.0
    assert outcome.summary["min_clearance_m"] <= lowest
    assert not outcome.success


@pytest.mark.parametrize("rate", [60.0, 10.0])
def test_failing_solvers_do_not_matter_and_the_bound_is_kept_at_every_control_rate(terrain: str, rate: float) -> None:
    outcome = flown(terrain, control_rate=rate, faults=AerialFaults(solver_failure_rate=0.9))
    assert_safe(outcome)
    assert outcome.summary["solver_failures"] > 0.45 * outcome.summary["replans"]
    assert outcome.summary["tracking_breaches"] == 0
    assert 0.0 < outcome.summary["tracking_error_max_m"] <= outcome.summary["tracking_bound_m"]


def test_changes_in_flight_are_communicated_and_taken_into_account(terrain: str) -> None:
    """A radar that drives and is switched off, a target that moves, and a hill that the map did not show."""
    x, y, z = flight.above(flight.mountains(), (9000.0, 10_500.0), 150.0)
    outcome = flown(
        terrain,
        radar=((6000.0, 7000.0, 1500.0, 5.0),), radar_time=5.0, radar_until=20.0, radar_velocity=(50.0, 0.0),
        target_path=((20.0, *flight.TARGET, 900.0), (28.0, x, y, z)),
        uncharted=((5500.0, 5500.0, 1500.0, 900.0),), uncharted_time=3.0,
    )  # fmt: skip
    assert_safe(outcome)
    messages = [(e.t, e.message.split()[0]) for e in outcome.recording.events if e.kind == "message"]
    radars = [t for t, topic in messages if topic == "radars"]
    assert [t for t, topic in messages if topic == "terrain"] == [pytest.approx(3.0, abs=5.0 / 3.0)]
    assert len(radars) == 4  # on, twice elsewhere, off
    assert radars[0] >= 5.0
    assert radars[-1] == pytest.approx(20.0, abs=5.0 / 3.0)
    assert [t for t, topic in messages if topic == "target"][-1] == pytest.approx(28.0, abs=5.0 / 3.0)
    assert math.dist(outcome.recording.truths["vehicle"][-1, :3].tolist(), (x, y, z)) <= 50.0
    assert outcome.summary["min_clearance_m"] >= H_MIN
    assert outcome.config["terrain"]["digest"] != flight.mountains().digest


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"target_path": ((10.0, -5.0, 0.0, 900.0),)}, "target_path: place at 10 s = .*off the map"),
        ({"target_path": ((10.0, 6000.0, 6000.0, 100.0),)}, "target_path: place at 10 s = .*under ground"),
        ({"uncharted": ((20_000.0, 0.0, 100.0, 100.0),)}, "uncharted: hill: .* is not on the terrain"),
        ({"uncharted": ((*flight.TARGET, 900.0, 500.0),)}, "target = .*under ground"),
        ({"uncharted": ((*flight.START, 900.0, 500.0),)}, "start = .*under ground"),
    ],
)
def test_changes_that_cannot_be_are_refused_by_name(terrain: str, fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SafeFlight.build(config(terrain, **fields), 0)


# ---- filtered commands


class Diving:
    """A controller that is no controller: its tracker dives, with breaks at which it raises."""

    @dataclass(frozen=True)
    class Config:
        """Nothing to configure."""

    certifier = None

    @staticmethod
    def build(config: Config, mission: FlightMission) -> tuple[Planner, Tracker]:
        planner, tracker = FlightController.build(FlightConfig(), mission)
        proper = tracker.command

        def command(t: float, estimate: Any, plan: Plan) -> Array:
            if t > 20.0:
                return proper(t, estimate, plan)
            if int(t) % 4 == 3:
                raise RuntimeError("no command")
            return np.array([10.0, 5.0, -30.0])

        tracker.command = command  # type: ignore[method-assign]
        return planner, tracker


def test_behind_the_filter_any_controller_keeps_the_bounds_and_one_that_recovers_arrives(terrain: str) -> None:
    fields = {"target": NEAR, "deadline_factor": 3.0}
    bare = SafeFlight.build(config(terrain, **fields), 1, PluginSpec.with_fields(Diving)).run()
    assert bare.summary["ground_contacts"] > 0
    run = SafeFlight.build(config(terrain, **fields, filter=True), 1, PluginSpec.with_fields(Diving)).run()
    assert run.success
    assert run.summary["ground_contacts"] == run.summary["guarantee_lost"] == 0
    assert run.summary["min_clearance_m"] >= H_MIN
    assert run.summary["filtered_share"] > 0.1
    assert run.summary["filter_margin_min_m"] >= 0.0
    assert Counter(event.kind for event in run.events)["command-unusable"] > 0


def test_the_filter_leaves_the_commands_of_our_own_planner_alone(terrain: str) -> None:
    run = SafeFlight.build(config(terrain, target=NEAR, filter=True), 1).run()
    assert run.success
    assert run.summary["filtered_share"] == 0.0
