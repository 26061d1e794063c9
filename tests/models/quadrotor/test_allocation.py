"""From wanted force and moments to thrusts within bounds, and what is kept where they are not enough."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.allocation import allocated
from mathnavi.models.quadrotor.dynamics import NOMINAL

A, INVERSE, MOST = NOMINAL.allocation, np.linalg.inv(NOMINAL.allocation), NOMINAL.thrust_max

within = st.tuples(*[st.floats(0.0, MOST)] * 4).map(np.array)
wanted = st.tuples(st.floats(-60.0, 90.0), *[st.floats(-6.0, 6.0)] * 2, st.floats(-2.0, 2.0)).map(np.array)


@given(thrusts=within)
def test_what_the_rotors_can_do_is_done(thrusts: Array) -> None:
    np.testing.assert_allclose(allocated(A @ thrusts, INVERSE, MOST), thrusts, rtol=0.0, atol=1e-9)


@given(wrench=wanted)
def test_no_rotor_leaves_its_bounds(wrench: Array) -> None:
    thrusts = allocated(wrench, INVERSE, MOST)
    assert ((thrusts >= 0.0) & (thrusts <= MOST)).all()


@given(wrench=wanted)
def test_the_moments_that_tilt_keep_their_direction_and_come_first(wrench: Array) -> None:
    got = A @ allocated(wrench, INVERSE, MOST)
    # At best the rotors give so much in this direction, whatever else is wanted.
    alone = INVERSE[:, 1:3] @ wrench[1:3]
    apart = np.ptp(alone)
    share = min(1.0, MOST / apart) if apart > 1e-9 else 1.0
    np.testing.assert_allclose(got[1:3], share * wrench[1:3], rtol=0.0, atol=1e-9)


@given(wrench=wanted)
def test_the_nose_turns_the_way_it_should_and_no_further(wrench: Array) -> None:
    got = A @ allocated(wrench, INVERSE, MOST)
    assert -1e-9 <= got[3] * np.sign(wrench[3]) <= abs(wrench[3]) + 1e-9


@given(wrench=wanted)
def test_thrust_is_not_given_up_for_the_nose(wrench: Array) -> None:
    thrust, without = ((A @ allocated(wrench * [1.0, 1.0, 1.0, nose], INVERSE, MOST))[0] for nose in (1.0, 0.0))
    assert abs(thrust - wrench[0]) <= abs(without - wrench[0]) + 1e-9


def test_a_rotor_cannot_pull() -> None:
    np.testing.assert_array_equal(allocated(np.array([-20.0, 0.0, 0.0, 0.0]), INVERSE, MOST), np.zeros(4))


def test_the_senses_are_those_of_the_field() -> None:
    """Thrust at the left raises the left side, thrust ahead the nose; a counter-clockwise rotor turns the hull back."""
    front_left = A @ np.array([1.0, 0.0, 0.0, 0.0])
    assert front_left[1] > 0.0 > front_left[2]
    assert front_left[3] < 0.0
