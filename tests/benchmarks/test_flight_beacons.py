"""The benchmark of flights by ranges: its flights arrive, and its row sums them up."""

from __future__ import annotations

from benchmarks.flight_beacons import FAULTY, BeaconFlight, by_beacons, flown, summed


def test_a_flight_with_a_beacon_that_is_off_arrives_and_leaves_it_out() -> None:
    run = flown(by_beacons(6, "offset"), 1)
    assert run.arrived
    assert run.left_out == (FAULTY,)
    assert run.sure_and_wrong <= 0.005
    assert 1.0 < run.nees < 6.0


def test_a_row_is_over_all_flights() -> None:
    flights = [BeaconFlight(True, 1.0, 2.0, 1.0, 0.0, ()), BeaconFlight(False, 3.0, 4.0, 0.5, 0.1, (1, 2))]
    assert summed(flights) == ["1 of 2", "1.41 m", "3.00", "75.0 %", "5.00 %", "none; 1, 2"]
