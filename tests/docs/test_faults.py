"""Everything that a fault can do is on the page on guarantees."""

from __future__ import annotations

import dataclasses

import pytest

from mathnavi.sim.scenarios.fault_fields import SafeFlightFaults
from mathnavi.sim.scenarios.fleet_fields import Clocks, Radio
from mathnavi.sim.scenarios.flight_fields import FlightBeaconFields, FlightNoise
from mathnavi.sim.scenarios.information import ChangeFields
from mathnavi.sim.scenarios.quadrotor_fields import QuadrotorMismatch
from tests.docs.test_site import DOCS

NO_FAULTS = {"clocks.settling", "beacons.places"}  # which the vehicles wait for, and which are no fault


@pytest.mark.parametrize(
    ("group", "fields"),
    [
        ("faults.", SafeFlightFaults),
        ("noise.", FlightNoise),
        ("beacons.", FlightBeaconFields),
        ("mismatch.", QuadrotorMismatch),
        ("radio.", Radio),
        ("clocks.", Clocks),
        ("", ChangeFields),
    ],
)
def test_every_fault_has_its_row(group: str, fields: type) -> None:
    page = (DOCS / "reference" / "guarantees.md").read_text(encoding="utf-8")
    names = [f"{group}{field.name}" for field in dataclasses.fields(fields)]
    assert [name for name in names if f"`{name}`" not in page and name not in NO_FAULTS] == []
