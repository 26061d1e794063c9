"""A fleet arrives at one time, keeps apart and off the ground, whatever becomes of plans and messages."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from mathnavi.models.aerial.dynamics import HULL_RADIUS
from mathnavi.sim.metrics.fleet import arrival_times, least_separation
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.fault_fields import AerialFaults
from mathnavi.sim.scenarios.fleet_fields import Clocks, Radio, SimultaneousArrivalConfig
from mathnavi.sim.scenarios.simultaneous_arrival import SimultaneousArrival
from mathnavi.studies.fleet.arrival import swapping
from tests import flight


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> str:
    return flight.save(flight.mountains(), tmp_path_factory.mktemp("map") / "mountains.npz")


def config(terrain: str, **fields: Any) -> SimultaneousArrivalConfig:
    """A small fleet over a small map."""
    small = {"vehicles": 3, "slot_spacing": 800.0, "separation": 150.0, "drawn_distance": (0.2, 0.35)}
    return SimultaneousArrivalConfig(**{"terrain": terrain, **small, **fields})


def flown(terrain: str, seed: int = 0, **fields: Any) -> RunData:
    return SimultaneousArrival.build(config(terrain, **fields), seed).run()


def begun(terrain: str, seconds: float, **fields: Any) -> RunData:
    """The first seconds of a mission."""
    return dataclasses.replace(SimultaneousArrival.build(config(terrain, **fields), 0), duration=seconds).run()


@pytest.mark.parametrize("graph", ["line", "random"])
def test_they_arrive_at_one_time_and_keep_apart(terrain: str, graph: str) -> None:
    outcome = flown(terrain, graph=graph)
    assert outcome.success, outcome.summary
    assert outcome.summary["arrived_vehicles"] == 3
    assert outcome.summary["spread_s"] <= 5.0 / 3.0
    assert outcome.summary["separation_min_m"] >= 150.0
    assert outcome.summary["min_clearance_m"] >= 50.0


def test_the_average_asks_some_for_more_than_they_can_and_costs_no_safety(terrain: str) -> None:
    """Half the fleet would have to be faster than the least time that (A.12) gives."""
    outcome = flown(terrain, consensus="laplacian")
    assert outcome.summary["arrived"]
    assert outcome.summary["spread_s"] > 5.0 / 3.0
    assert outcome.summary["ground_contacts"] == 0
    assert outcome.summary["separation_min_m"] >= 150.0


@pytest.mark.parametrize("radio", [Radio(loss=1.0), Radio(range=1.0)])
def test_who_hears_nobody_flies_its_stored_plan_and_arrives_with_the_others(terrain: str, radio: Radio) -> None:
    outcome = flown(terrain, radio=radio, drawn_distance=(0.25, 0.5))
    assert outcome.success, outcome.summary
    assert outcome.summary["plans_adopted"] == 3  # the stored ones
    assert outcome.summary["arrivals_deferred"] == 3
    silent = [event.t for event in outcome.recording.events if event.kind == "separation-silent"]
    assert len(silent) == 3
    assert max(silent) < 2.0  # announced when it is known


def test_vehicles_that_swap_places_do_not_lock(terrain: str) -> None:
    outcome = flown(**{**swapping(terrain, 6, 3500.0, 600.0), "slot_spacing": 400.0})
    assert outcome.success, outcome.summary
    assert outcome.summary["proposals_refused"] > 0
    assert outcome.summary["separation_min_m"] >= 150.0


def test_lost_messages_and_failing_solvers_cost_no_safety(terrain: str) -> None:
    outcome = flown(
        terrain, vehicles=4, faults=AerialFaults(solver_failure_rate=0.3, late_plan_rate=0.1),
        radio=Radio(delay=(0.0, 0.3), loss=0.2, duplication=0.2, partition=(20.0, 40.0)),
    )  # fmt: skip
    assert outcome.summary["ground_contacts"] == 0
    assert outcome.summary["min_clearance_m"] >= 50.0
    assert outcome.summary["separation_min_m"] >= 150.0
    assert outcome.summary["arrived"]


def test_a_fleet_is_kept_apart_by_the_delay_check(terrain: str) -> None:
    outcome = flown(terrain, separation_rule="delay_check", delay_check=0.5, radio=Radio(delay=(0.0, 0.3)))
    assert outcome.summary["arrived"], outcome.summary
    assert outcome.summary["separation_min_m"] >= 150.0
    assert outcome.summary["guarantee_lost"] == 0
    assert outcome.summary["plans_adopted"] > 3  # others than the stored ones


def test_the_same_seed_is_the_same_log(terrain: str) -> None:
    fields: dict[str, Any] = {"radio": Radio(loss=0.2), "faults": AerialFaults(solver_failure_rate=0.2)}
    one, other = (begun(terrain, 12.0, **fields) for _ in range(2))
    assert one.summary["plans_adopted"] > 3  # others than the stored ones
    assert one.arrays.keys() == other.arrays.keys()
    assert all(one.arrays[name].tobytes() == other.arrays[name].tobytes() for name in one.arrays)
    assert {name.partition(".")[0] for name in one.arrays if "." in name} == {"vehicle_1", "vehicle_2", "vehicle_3"}


def test_arrivals_and_separation_are_those_of_the_log(terrain: str) -> None:
    built = SimultaneousArrival.build(config(terrain), 2)
    outcome = built.run()
    expected = outcome.config["mission"]["vehicles"]
    t, truths = outcome.recording.t, outcome.recording.truths
    for name, place in expected.items():
        distance = np.linalg.norm(truths[name][:, :3] - np.array(place["target"]), axis=1)
        assert np.array(place["start"]) == pytest.approx(truths[name][0, :3])
        assert distance.min() <= 50.0
        first = float(t[np.flatnonzero(distance <= 50.0)[0]])
        assert outcome.summary["first_arrival_s"] <= first <= outcome.summary["arrival_time_s"] + 1.0 / 60.0
    pairs = [("vehicle_1", "vehicle_2"), ("vehicle_1", "vehicle_3"), ("vehicle_2", "vehicle_3")]
    sampled = min(float(np.linalg.norm(truths[a][:, :3] - truths[b][:, :3], axis=1).min()) for a, b in pairs)
    assert sampled - 10.0 <= outcome.summary["separation_min_m"] <= sampled
    assert least_separation(outcome.recording, list(expected))[0] == outcome.summary["separation_min_m"]


def test_a_fleet_with_given_starts_starts_there(terrain: str) -> None:
    drawn = SimultaneousArrival.build(config(terrain), 1).config
    starts = tuple(tuple(each["start"]) for each in drawn["mission"]["vehicles"].values())
    ring = [each["target"] for each in drawn["mission"]["vehicles"].values()]
    middle = tuple(np.mean(ring, axis=0)[:2])
    height = float(flight.mountains().height(*middle))
    expected = config(terrain, start=starts, target=(*middle, height + 300.0))
    assert SimultaneousArrival.build(expected, 7).config["fields"]["start"] == [list(start) for start in starts]


def test_a_start_that_is_drawn_too_low_is_drawn_again(terrain: str) -> None:
    """The ground rises across the hull, so that a start just above h_min of the ground below its centre is too low."""
    built = SimultaneousArrival.build(config(terrain, vehicles=2, drawn_heights=(0.0, 1.0)), 2)
    ground = flight.mountains().inflated(HULL_RADIUS, 0.0)
    for place in built.config["mission"]["vehicles"].values():
        x, y, z = place["start"]
        assert z >= float(ground.height(x, y)) + 50.0


def test_new_information_is_sent_to_all(terrain: str) -> None:
    """A radar that drives and goes, and a hill that the map does not show; and with a graph of one's own."""
    outcome = flown(
        terrain, name=("north", "east", "south"), edge=(("north", "east", 1.0), ("east", "south", 0.5)),
        radar=((6000.0, 7000.0, 1500.0, 5.0),), radar_time=5.0, radar_until=20.0, radar_velocity=(50.0, 0.0),
        uncharted=((6500.0, 5000.0, 900.0, 500.0),), uncharted_time=10.0,
    )  # fmt: skip
    assert outcome.success, outcome.summary
    for name in ("north", "east", "south"):
        expected = [e.message.split()[0] for e in outcome.recording.events if e.kind == "message" and e.agent == name]
        assert expected.count("radars") == 4
        assert expected.count("terrain") == 1


def test_without_a_clock_in_common_they_agree_on_one_and_then_arrive_at_one_time(terrain: str) -> None:
    clocks = Clocks(offset=10.0, drift=1e-4, error=0.1, settling=3.0)
    outcome = flown(terrain, clocks=clocks, radio=Radio(delay=(0.0, 0.2), loss=0.2))
    assert outcome.success, outcome.summary
    assert outcome.summary["clocks_apart"] == 0
    kinds = [event.kind for event in outcome.recording.events]
    assert "coordinator-raised" not in kinds
    silent = [event.t for event in outcome.recording.events if event.kind == "not-admitted"]
    assert min(silent) < 3.0  # nobody asks for room until the clocks agree
    assert outcome.summary["plans_adopted"] > outcome.summary["replans"] / 3


def test_clocks_that_are_trusted_too_soon_are_on_record(terrain: str) -> None:
    outcome = begun(terrain, 12.0, clocks=Clocks(offset=10.0, error=0.1, settling=0.0))
    assert outcome.summary["clocks_apart"] > 0


def test_who_cannot_come_so_late_is_an_outlier_and_comes_back(terrain: str) -> None:
    outcome = flown(terrain, consensus="laplacian", consensus_with=("delta=0.05",))
    kinds = [event.kind for event in outcome.recording.events]
    who = [event.agent for event in outcome.recording.events if event.kind == "outlier"]
    assert set(who) <= {"vehicle_1", "vehicle_2", "vehicle_3"}
    assert outcome.summary["outliers"] == len(who) > 0
    assert kinds.index("outlier") < kinds.index("outlier-returns")
    assert outcome.summary["ground_contacts"] == 0


def _above(x: float, y: float, height: float = 200.0) -> tuple[float, float, float]:
    return flight.above(flight.mountains(), (x, y), height)


MIDDLE = {"target": _above(6_000.0, 6_000.0)}
NEAR = (_above(1_000.0, 1_000.0), _above(1_080.0, 1_000.0), _above(9_000.0, 2_000.0))
BAD: list[tuple[dict[str, Any], str]] = [
    ({"vehicles": 1}, r"vehicles = 1; allowed: a whole number from 2 to 256"),
    ({"start": NEAR[:2] + NEAR[1:2]}, r"start of vehicle_1 and of vehicle_2 are .* m apart"),
    ({"slot_spacing": 10.0}, r"separation = 150\.0; allowed: <= slot_spacing = 10\.0"),
    ({"start": (_above(1e3, 1e3),)}, r"start = 1 points; allowed: 3, one for each vehicle"),
    ({"graph": "star"}, r"graph = 'star'; allowed: line, ring, complete, random"),
    (
        {"consensus": "clock"},
        r"consensus = 'clock': .* allowed: laplacian, maximum, or another that declares within_starts",
    ),
    ({"consensus": "vote"}, r"consensus: 'vote' is not known; allowed: "),
    ({"start": NEAR, **MIDDLE}, r"start of vehicle_1 and of vehicle_2 are .* m apart; allowed: >= 150 m"),
    ({"start": (_above(1e3, 1e3, 10.0), *NEAR[1:]), **MIDDLE}, r"start of vehicle_1 = .* is below the least"),
    ({"target": _above(100.0, 100.0), "start": (NEAR[0], NEAR[2], _above(5e3, 9e3))}, r"lie off the map"),
    ({"faults": AerialFaults(position_jump=5.0)}, r"position_jump = 5\.0; allowed in a fleet: 0"),
    ({"slot_spacing": 150.0}, r"slot_spacing = 150\.0; allowed: >= 150\."),
    ({"name": ("a", "b")}, r"name = \('a', 'b'\); allowed: 3, one for each vehicle"),
    ({"name": ("a", "b", "a")}, r"name: names = .*; allowed: each once, and not a again"),
    ({"name": ("a", "b", "c/d")}, r"name = 'c/d'; allowed: letters"),
    (
        {"name": ("a", "b", "c"), "edge": (("a", "b", 1.0),)},
        r"edge: the graph is not connected: no way from a to c",
    ),
    ({"name": ("a", "b", "c"), "edge": (("a", "b", -1.0),)}, r"-1\.0; allowed: a finite value >= 0"),
    ({"name": ("a", "b", "c"), "edge": (("a", "a", 1.0),)}, r"no self-loop"),
    ({"name": ("a", "b", "c"), "edge": (("a", "d", 1.0),)}, r"'d'"),
    ({"name": ("a", "b", "c"), "edge": (("a", "b", 1.0), ("b", "a", 2.0))}, r"each pair of vehicles once"),
    ({"clocks": Clocks(offset=10.0, error=2.0)}, r"slot_spacing = 800\.0; allowed: >= 1350"),
    ({"separation_rule": "delay_check", "delay_check": 1.5}, r"delay_check = 1\.5; allowed: <= 1\.4"),
    ({"consensus_with": ("period",)}, r"consensus_with = 'period'; allowed: FIELD=VALUE"),
    ({"consensus_with": ("=3",)}, r"consensus_with = '=3'; allowed: FIELD=VALUE"),
    ({"consensus_with": ("period=3",)}, r"consensus_with = 'period=3'; allowed: any field but the period"),
    ({"consensus_with": ("scaling=3",)}, r"consensus_with: scaling is not a field; allowed: period"),
    ({"consensus": "laplacian", "consensus_with": ("scaling=-3",)}, r"consensus_with: scaling = -3\.0; allowed"),
    (
        {"vehicles": 256},
        r"slot_spacing = 800\.0: the ring of 256 slots is .* does not fit the map.* allowed: fewer vehicles$",
    ),
    ({"target": (300.0, 300.0, 4_000.0)}, r"target = \(300.*: slots on a ring of \d+ m about it lie off the map"),
    ({"start": ((-5.0, 0.0, 9e3), (1e3, 1e3, 9e3), (3e3, 3e3, 9e3))}, r"start of vehicle_1 = .* is off the map"),
    ({"uncharted": ((6_000.0, 6_000.0, math.nan, 900.0),)}, r"uncharted: hill: radius = nan"),
    ({"uncharted": ((-6_000.0, 6_000.0, 9.0, 900.0),)}, r"uncharted: hill: .* is not on the terrain"),
    ({"uncharted": ((6_000.0, 6_000.0, 2_000.0, 900.0),), **MIDDLE}, r"target of vehicle_. = .*under ground"),
]


def test_a_fleet_of_256_is_a_configuration() -> None:
    assert len(SimultaneousArrivalConfig(vehicles=256, slot_spacing=600.0).names) == 256


@pytest.mark.parametrize(("fields", "expected"), BAD, ids=[expected for _, expected in BAD])
def test_bad_input_names_the_culprit(terrain: str, fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        SimultaneousArrival.build(config(terrain, **fields), 0)


@pytest.mark.parametrize(
    ("made", "fields", "expected"),
    [
        (Radio, {"delay": (0.3, 0.1)}, r"radio\.delay = 0\.1"),
        (Radio, {"partition": (5.0, 1.0)}, r"radio\.partition = 1\.0"),
        (Clocks, {"offset": 50.0}, r"clocks\.offset = 50\.0"),
        (Clocks, {"offset": 1.0}, r"clocks\.error = 0\.0 with clocks\.offset = 1"),
    ],
)
def test_a_radio_and_clocks_that_cannot_be_are_refused(made: Any, fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        made(**fields)


def test_nobody_arrives_in_a_log_of_nothing(terrain: str) -> None:
    short = begun(terrain, 1.0)
    assert not short.success
    assert short.summary["spread_s"] is None
    assert "arrived" in short.summary["shortfall"]
    assert all(math.isnan(t) for t in arrival_times(short.recording, {}).values())
