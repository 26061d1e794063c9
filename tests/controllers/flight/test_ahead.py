"""What is compiled before a flight is what the flight then calls."""

from __future__ import annotations

from mathnavi.controllers.flight.ahead import KERNELS
from mathnavi.controllers.flight.certificate import _extent
from mathnavi.sim.interfaces.compiled import any_missing
from tests.kernels import flight


def test_a_flight_compiles_none_of_it_again() -> None:
    flight()
    assert not any_missing(KERNELS)
    assert all(arguments in kernel.signatures for kernel, arguments in KERNELS)
    assert len(_extent.signatures) == 1  # whether the plan's arrays are read-only changes nothing
