"""Bounds of controls that a path constraint implies are no part of the programme; all others are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from tests.controllers.ocp.statements import integrator


def thrust(stated: Callable[[OptimalControlProblem, ca.SX, ca.SX], Any], limit: float) -> OptimalControlProblem:
    ocp, x, _ = integrator()
    u = ocp.control("direction", 2, lower=-limit, upper=limit)
    ocp.duration(1.0)
    stated(ocp, x, u)
    return ocp


@pytest.mark.parametrize(
    ("stated", "limit", "dropped"),
    [
        (lambda ocp, x, u: ocp.constrain(ca.sumsqr(u) == 1), 1.0, [True, True]),
        (lambda ocp, x, u: ocp.constrain(ca.sumsqr(u) <= 1), 2.0, [True, True]),
        (lambda ocp, x, u: ocp.constrain(1 - u[0] ** 2 - 4 * u[1] ** 2 >= 0), 0.6, [False, True]),
        (lambda ocp, x, u: ocp.constrain(ca.sumsqr(u) <= 1), 0.9, [False, False]),
        (lambda ocp, x, u: ocp.constrain(ca.sumsqr(u) >= 1), 1.0, [False, False]),
        (lambda ocp, x, u: ocp.constrain(ca.sumsqr(u - 1) <= 1), 2.0, [False, False]),
        (lambda ocp, x, u: ocp.constrain(ca.sumsqr(u) <= x), 1.0, [False, False]),
        (lambda ocp, x, u: ocp.constrain(u[0] * u[1] <= 1), 1.0, [False, False]),
        (lambda ocp, x, u: ocp.constrain(ca.norm_1(u) <= 1), 1.0, [False, False]),
        (lambda ocp, x, u: ocp.constrain(u[0] + x <= 1), 1.0, [False, False]),
        (lambda ocp, x, u: None, 1.0, [False, False]),
    ],
)
def test_only_what_a_sum_of_squares_implies_is_dropped(
    stated: Callable[..., Any], limit: float, dropped: list[bool]
) -> None:
    found = thrust(stated, limit).functions().control_bounds
    assert np.isinf(found.upper[1:]).tolist() == dropped
    assert np.isinf(found.lower[1:]).tolist() == dropped


def test_a_direction_with_bounds_is_as_easy_as_one_without() -> None:
    """Constant thrust against gravity, in least time to a height and a speed: the linear tangent law."""

    def found(limit: float) -> Any:
        ocp = OptimalControlProblem("ascent")
        y, vx = (ocp.state(name, guess=(0.0, 1.0)) for name in ("y", "vx"))
        vy = ocp.state("vy", guess=0.5)
        u = ocp.control("u", 2, lower=-limit, upper=limit, guess=[(0.5, 0.8), (0.9, -0.3)])
        ocp.minimise(terminal=ocp.free_duration(guess=1.5, lower=0.1, upper=10.0))
        ocp.constrain(ca.sumsqr(u) == 1)
        ocp.dynamics(ca.vertcat(y, vx, vy), ca.vertcat(vy, 2 * u[0], 2 * u[1] - 1))
        ocp.start(ca.vertcat(y, vx, vy), 0.0)
        ocp.end(ca.vertcat(y, vx, vy), [1.0, 1.0, 0.0])
        return ocp.solve()

    bounded, free = found(1.0), found(np.inf)
    assert bounded.ok
    assert bounded.cost == pytest.approx(1.66289016, rel=1e-7)
    assert (bounded.nodes, bounded.cost) == (free.nodes, free.cost)
    assert bounded.nodes < 40
