"""Random streams, faults and recorded missions: what every scenario has from the assembler."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.fields import plain
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array, Event
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.engine.faults import Disturbance
from mathnavi.sim.plugin.registry import load, names
from mathnavi.sim.records.missions import ChangingFlightRecord, FlightRecord, QuadrotorRecord, RadarRecord, read_mission
from mathnavi.sim.records.range_missions import RangingRecord
from mathnavi.sim.scenarios.assembler import Assembler, RandomStreams
from mathnavi.sim.scenarios.fault_fields import AerialFaults, Fault, LatePlans, RandomGusts, kinds
from mathnavi.sim.scenarios.missile_fields import MissileFaults, MissileGuidanceConfig, MissileGust, MissileNoise
from mathnavi.sim.scenarios.missile_guidance import MissileGuidance


def draws(rng: np.random.Generator) -> list[float]:
    drawn: list[float] = rng.random(4).tolist()
    return drawn


# ---- random streams


def test_listed_streams_are_the_children_of_the_seed_in_their_order() -> None:
    streams = RandomStreams(np.random.default_rng(7), ("one", "two"))
    one, two = np.random.default_rng(7).spawn(2)
    assert draws(streams["two"]) == draws(two)
    assert draws(streams["one"]) == draws(one)


def test_a_stream_that_is_not_listed_leaves_all_others_as_they_were() -> None:
    streams = RandomStreams(np.random.default_rng(7), ("one", "two"))
    new = draws(streams["new"])
    assert draws(streams["two"]) == draws(np.random.default_rng(7).spawn(2)[1])
    assert draws(streams.root.spawn(1)[0]) == draws(np.random.default_rng(7).spawn(3)[2])
    assert new == draws(RandomStreams(np.random.default_rng(7))["new"])
    others = RandomStreams(np.random.default_rng(7))["other"], RandomStreams(np.random.default_rng(8))["new"]
    assert new not in [draws(other) for other in others]


def test_vehicles_share_no_stream() -> None:
    one, two = RandomStreams(np.random.default_rng(7), ("dropouts",)).split("dropouts", 2)
    for name in ("dropouts", "new"):
        assert draws(one[name]) != draws(two[name])


# ---- faults


class Constant:
    """A force that never changes."""

    def __init__(self, force: float) -> None:
        self.force = np.array([force, 0.0, 0.0])

    def act(self, plant: Plant, ticks: int) -> Sequence[Event]:
        for name in plant.names:
            plant.apply_wrench(name, self.force)
        return ()


@dataclass(frozen=True)
class Wind(Fault):
    """A disturbance of a stranger: one class."""

    stream: ClassVar[str] = "wind"

    wind: float = 0.0
    """force per mass to the east [m/s^2]"""

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        return (Constant(mass * self.wind),) if self.wind else ()


@dataclass(frozen=True)
class WindyMissileFaults(Wind, MissileFaults):
    """Its entry."""


def test_a_new_disturbance_is_one_class_and_its_entry() -> None:
    fields: dict[str, Any] = {"faults": WindyMissileFaults(wind=3.0), "gust": MissileGuidanceConfig().gust}
    calm, windy = (MissileGuidance.build(MissileGuidanceConfig(**each), 0) for each in ({}, fields))
    for _ in range(5):
        calm.plant.step({})
        windy.plant.step({})
    moved: Array = windy.plant.state("missile") - calm.plant.state("missile")
    assert np.abs(moved).max() > 0.0


def test_faults_of_a_group_come_in_the_order_of_their_fields() -> None:
    assert [kind.__name__ for kind in kinds(AerialFaults())] == [
        "SolverFailures", "LatePlans", "CorruptedPlans", "Jumps", "RandomGusts", "LostReadings",
    ]  # fmt: skip
    assert list(kinds(RandomGusts())) == [RandomGusts]


def test_a_field_out_of_range_is_refused_whatever_the_group() -> None:
    with pytest.raises(FieldError, match=r"faults\.late_plan_rate = 2\.0"):
        LatePlans(late_plan_rate=2.0)
    with pytest.raises(FieldError, match=r"faults\.late_plan_latency = 1000000\.0"):
        AerialFaults(late_plan_latency=1e6)
    assert MissileFaults(late_plan_latency=1e6).late_plan_latency == 1e6  # as long as a missile's fields may be
    with pytest.raises(FieldError, match=r"^faults\.late_plan_latency = 1100000\.0; allowed: .* >= 0 and <= 1e\+06$"):
        WindyMissileFaults(late_plan_latency=1.1e6)


def test_a_fault_out_of_range_is_named_by_the_field_that_holds_it() -> None:
    with pytest.raises(FieldError, match=r"^noise\.dropout_rate = 2\.0; "):
        MissileNoise(dropout_rate=2.0)
    with pytest.raises(FieldError, match=r"^noise\.angle = -1\.0; "):
        MissileNoise(angle=-1.0)
    with pytest.raises(FieldError, match=r"^gust\.torque = \(0\.0, inf, 0\.0\); "):
        MissileGust(torque=(0.0, math.inf, 0.0))


def test_a_plant_without_disturbances_is_left_as_it_is() -> None:
    loop = MissileGuidance.build(MissileGuidanceConfig(), 0)
    parts = Assembler.for_scenario(MissileGuidance, MissileGuidanceConfig(), 0, None, None)
    assert parts.disturbed(loop.plant, 1.0, mass=1.0) is loop.plant


@pytest.mark.parametrize("scenario", names("scenarios"))
def test_a_scenario_says_its_name_its_drawing_and_its_streams(scenario: str) -> None:
    plugin = load("scenarios", scenario)
    parts = Assembler.for_scenario(plugin, plugin.Config(), 0, None, None)
    assert plugin.name == scenario
    assert plugin.drawing.startswith("mathnavi.renders.")
    assert len(set(getattr(plugin, "streams", ()))) == len(getattr(plugin, "streams", ()))
    assert parts.controller.plugin is load("controllers", plugin.controller)
    assert parts.estimator.plugin is load("estimators", plugin.estimator)


# ---- recorded missions

FLIGHT: dict[str, Any] = {
    "start": (1.0, 2.0, 3.0), "target": (4.0, 5.0, 6.0), "clearance_min": 50.0, "speed_max": 300.0,
    "acceleration_max": 40.0, "arrival_radius": 50.0, "tracking_bound": {"horizontal": 1.0}, "deadline_factor": 1.3,
}  # fmt: skip
RECORDS = (
    ChangingFlightRecord(
        **FLIGHT, radars=(RadarRecord(1.0, 2.0, 3.0, 4.0, time=5.0, until=9.0), RadarRecord(1.0, 2.0, 3.0, 4.0)),
        charted_at=3.0, target_path=((1.0, 2.0, 3.0, 4.0),),
    ),
    QuadrotorRecord(**FLIGHT, reach=0.3, thrust_max=9.0),
    RangingRecord(
        field="egg", coefficients=((0.0, 1.0, 2.0, 3.0),), angles=(0.1,), ranging=RangeQuality(0.1),
        odometry=OdometryQuality((0.1, 0.2)), known_start=KnownStart((0.0, 1.0, 2.0)), speed_max=1.0,
        turn_rate_max=2.0, margin=0.3, period=0.01, drive="differential", friction=1.0, outage=((1.0, 2.0),),
        mounting=((0.3, 0.0),),
    ),
)  # fmt: skip


def written(record: Any) -> dict[str, Any]:
    fields: dict[str, Any] = json.loads(json.dumps(plain(record)))
    return fields


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_a_mission_is_read_as_it_was_written(record: Any) -> None:
    assert read_mission(type(record), written(record)) == record


def test_a_mission_is_read_whatever_else_its_folder_says_of_it() -> None:
    fields: Mapping[str, Any] = written(RECORDS[0])
    assert read_mission(FlightRecord, fields) == FlightRecord(**FLIGHT)
    older = {name: fields[name] for name in fields if name not in ("target_path", "charted_at", "radars")}
    assert read_mission(ChangingFlightRecord, older) == ChangingFlightRecord(**FLIGHT)


def test_a_field_that_is_missing_or_of_another_type_is_named() -> None:
    fields = written(RECORDS[1])
    with pytest.raises(FieldError, match=r"mission\.reach = 'far'"):
        read_mission(QuadrotorRecord, {**fields, "reach": "far"})
    del fields["reach"]
    with pytest.raises(FieldError, match=r"mission\.reach is missing"):
        read_mission(QuadrotorRecord, fields)


def test_a_fault_that_acts_names_its_random_stream() -> None:
    with pytest.raises(TypeError, match="Silent has disturbances\\(\\) and no stream"):
        type("Silent", (Fault,), {"disturbances": lambda self, mass, period, rng: ()})


def test_forces_per_mass_act_on_the_true_mass() -> None:
    streams = RandomStreams(np.random.default_rng(0), ("gusts",))
    (gusts,) = RandomGusts(gust_rms=0.5).disturbances(200.0, 1.0, streams["gusts"])
    assert gusts._force._rms == pytest.approx(100.0)
