"""What a controller declares is flown with, a start that is too low costs no planner, and a plain run no learner."""

from __future__ import annotations

from typing import Any

import pytest

from mathnavi.controllers.flight.as_printed import AsPrintedFlight
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.plugin import FlightController
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.protocols import Planner
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios import flight_assurance, flight_learning
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig
from mathnavi.sim.scenarios.flight_assurance import FirstPlans, FlightAssurance
from mathnavi.sim.scenarios.flight_fields import FlightNoise, SafeFlightConfig
from mathnavi.sim.scenarios.safe_flight import SafeFlight
from mathnavi.sim.scenarios.simultaneous_arrival import SimultaneousArrival


class Trusting(FlightController):
    """A controller with a certifier of its own, which takes every plan."""

    @staticmethod
    def certifier(planner: Planner, mission: FlightMission, tracker: Any) -> Planner:
        return planner


class Uncertified(FlightController):
    """A controller whose plans are flown as they come."""

    certifier = None


class Mistaken(FlightController):
    """A controller whose certifier is none."""

    certifier = False


def assembler(controller: Any = FlightController, **fields: Any) -> Assembler:
    config = SafeFlightConfig(terrain="jacksboro", **fields)
    return Assembler.for_scenario(SafeFlight, config, 0, PluginSpec.with_fields(controller), None)


def test_a_controller_declares_its_certifier_or_none_and_else_has_the_certificate() -> None:
    closed_loops = {
        controller: SafeFlight.build(SafeFlightConfig(terrain="jacksboro"), 0, PluginSpec.with_fields(controller))
        for controller in (FlightController, Trusting, AsPrintedFlight)
    }
    certified = {each: isinstance(loop.agents["vehicle"].planner, Certified) for each, loop in closed_loops.items()}
    assert certified == {FlightController: True, Trusting: False, AsPrintedFlight: False}
    flight: Any = None  # no part of what is declared
    guaranteed = {each: FlightAssurance.for_mission(assembler(each), flight).guaranteed for each in closed_loops}
    assert guaranteed == {FlightController: True, Trusting: True, AsPrintedFlight: False}
    assert FlightAssurance.for_mission(assembler(AsPrintedFlight, filter=True), flight).guaranteed


def test_a_certifier_that_is_none_is_refused_by_name() -> None:
    with pytest.raises(PluginError, match=r"Mistaken': certifier = False; allowed: None, or a function \(planner, mis"):
        FlightAssurance.for_mission(assembler(Mistaken), Any)  # type: ignore[arg-type]


def test_a_fleet_certifies_by_the_rule_of_a_single_flight() -> None:
    config = SimultaneousArrivalConfig(terrain="jacksboro", vehicles=2)
    certified = {
        controller: {
            isinstance(agent.planner, Certified)
            for agent in SimultaneousArrival.build(config, 0, PluginSpec.with_fields(controller)).agents.values()
        }
        for controller in (FlightController, Trusting)
    }
    assert certified == {FlightController: {True}, Trusting: {False}}
    for controller in (Uncertified, Mistaken):
        with pytest.raises(PluginError, match=rf"{controller.__name__}'.*: certifier = (None|False); allowed"):
            SimultaneousArrival.build(config, 0, PluginSpec.with_fields(controller))


def test_a_start_that_is_too_low_costs_no_planner_and_none_could_fly_from_it(monkeypatch: pytest.MonkeyPatch) -> None:
    low: list[Point] = []
    built = []
    judge, checked = flight_assurance._too_low, flight_assurance.checked_controller

    def judged(certificate: Any, start: Point) -> bool:
        refused = judge(certificate, start)
        low.extend([start] * refused)
        return refused

    def counted(*arguments: Any) -> Any:
        built.append(arguments[1])
        return checked(*arguments)

    monkeypatch.setattr(flight_assurance, "_too_low", judged)
    monkeypatch.setattr(flight_assurance, "checked_controller", counted)
    noise = FlightNoise(position=2.5)
    with pytest.raises(ValueError, match="none of 500 missions drawn"):
        SafeFlight.build(SafeFlightConfig(terrain="jacksboro", drawn_heights=(0.0, 0.5), noise=noise), 0)
    assert len(low) > 20
    assert len(built) < 5
    for start in low[:3]:
        mission = FlightMission(**{**vars(built[0]), "start": start})
        assert not FirstPlans(assembler(noise=noise)).plan(mission, mission).ok


def test_a_plain_run_makes_no_terms_for_a_learner(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(flight_learning.FlightTerms, "__init__", lambda *arguments, **named: made.append(arguments))
    closed_loop = SafeFlight.build(SafeFlightConfig(terrain="jacksboro"), 0)
    assert made == []
    assert closed_loop.task is not None
    assert closed_loop.task.learning is not None
    closed_loop.task.learning()
    assert len(made) == 1
