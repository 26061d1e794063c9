"""Monitors and smoothers name the numbers that they add to an estimate, by what a user calls a channel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from tests.estimators.beacons.drives import drive, mission

WALL = mn.wall_through([(0.0, 0.0), (4.0, -0.2), (4.6, 2.0), (2.4, 3.2), (0.2, 2.4)], order=8)
BEACONS = mn.FlightBeacons(((0.0, 0.0, 9.0), (900.0, 0.0, 5.0), (0.0, 900.0, 7.0), (900.0, 900.0, 60.0)))
ROOM, FLIGHT = (
    mn.RangingMission(WALL, (0.0, 1.5), period=0.05),
    mn.FlightMission(
        mn.HeightField(np.zeros((2, 2)), 1000.0),
        (400.0, 400.0, 90.0),
        (90.0, 50.0, 80.0),
        control_period=0.05,
        beacons=BEACONS,
    ),
)
STILL = np.arange(20) * 0.05
ROOM_LOG = mn.SensorLog(STILL, {"ranges": np.ones((20, 2)), "odometry": np.zeros((20, 2))})
FLIGHT_LOG = mn.SensorLog(
    STILL, {"beacon_ranges": np.tile([np.linalg.norm(np.array(p) - FLIGHT.start) for p in BEACONS.places], (20, 1))}
)
FOUR = [f"beacon {i}" for i in range(4)]


@pytest.mark.parametrize(
    ("method", "given", "log", "channels"),
    [
        ("beacon_bank", mission(), drive(count=40).log, FOUR),
        (mn.smoother("beacon_bank"), mission(), drive(count=120).log, FOUR),
        ("feasible_set_bank", ROOM, ROOM_LOG, ["ray 0", "ray 1", "odometry"]),
        ("kalman", FLIGHT, FLIGHT_LOG, FOUR),
    ],
)
def test_each_number_has_a_name(method: Any, given: Any, log: mn.SensorLog, channels: list[str]) -> None:
    found = mn.estimate(method, given, log, trust_units=True)
    assert list(found.figures["left_out"]) == channels
    for figure, names in found.figures.items():
        if figure in found.extra:
            assert found.extra[figure].shape == (len(log.t), len(names))
    if method == "beacon_bank":
        assert found.figures["protection"] == ("protection, position [m]", "protection, heading [rad]")
        assert "scale error of ranges [-]" in found.figures["scales"]
