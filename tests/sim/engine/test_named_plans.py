"""A plan in the numbers of an estimate is drawn where these are a position by their names, and are one."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.sim.engine.scene_record import _named_plans

T = np.linspace(0.0, 4.0, 9)
PATH = np.column_stack([T, 2.0 * T, np.full_like(T, 0.1)])  # (n, 3) [m]
NAMES = ("heading [rad]", "east [m]", "north [m]")


def drawn(names: tuple[str, ...], true: np.ndarray) -> dict[str, np.ndarray]:
    arrays = {
        "t": T,
        "truth.estimands": true,
        "plan.t": np.array([0.0, 1.0]),
        "plan.x": np.array([[0.3, 0.0, 0.0], [0.3, 4.0, 8.0]]),
        "plan.offsets": np.array([0, 2]),
        "plan.adopted": np.array([0.0]),
    }
    return _named_plans("rover", arrays, SignalNames(estimands=names), T, PATH)


def test_a_plan_is_where_its_names_say_at_the_height_of_the_vehicle() -> None:
    found = drawn(NAMES, np.column_stack([np.zeros_like(T), PATH[:, :2]]))
    np.testing.assert_allclose(found["plan.rover.pos"], [[0.0, 0.0, 0.1], [4.0, 8.0, 0.1]], atol=1e-6)


@pytest.mark.parametrize(
    ("names", "shift"),
    [
        (NAMES, 50.0),  # from another origin
        (("heading [rad]", "east [km]", "north [km]"), 0.0),
        (("heading [rad]", "speed [m]", "north [m]"), 0.0),
    ],
)
def test_numbers_that_are_no_position_are_not_drawn(names: tuple[str, ...], shift: float) -> None:
    assert not drawn(names, np.column_stack([np.zeros_like(T), PATH[:, :2] + shift]))
