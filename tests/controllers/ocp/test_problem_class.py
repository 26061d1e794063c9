"""What may be stated beyond states and controls: each against an optimum known in closed form or otherwise stated."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array
from tests.controllers.ocp.statements import double_integrator


def transfer(vector: bool) -> OptimalControlProblem:
    """p'' = a in the plane, from rest at (0, 0) to rest at (1, 2) in a second with least ∫ |a|^2 / 2: J = 6 (1 + 4)."""
    ocp = OptimalControlProblem("transfer")
    ocp.duration(1.0)
    if vector:
        p, v = ocp.state("p", 2, upper=[1.5, 3.0], scale=[1.0, 2.0], guess=[0.5, 1.0]), ocp.state("v", 2)
        a = ocp.control("a", 2, lower=-100.0)
    else:
        fields = ((1.5, 1.0, 0.5), (3.0, 2.0, 1.0))
        p = ca.vertcat(*(ocp.state(f"p[{i}]", upper=u, scale=s, guess=g) for i, (u, s, g) in enumerate(fields)))
        v = ca.vertcat(ocp.state("v[0]"), ocp.state("v[1]"))
        a = ca.vertcat(ocp.control("a[0]", lower=-100.0), ocp.control("a[1]", lower=-100.0))
    ocp.minimise(running=ca.sumsqr(a) / 2)
    ocp.dynamics(p, v)
    ocp.dynamics(v, a)
    ocp.start(p, 0.0), ocp.start(v, [0.0, 0.0])
    ocp.end(p, [1.0, 2.0]), ocp.end(v, 0.0)
    return ocp


def test_a_vector_is_its_components() -> None:
    one, other = transfer(True).solve(9), transfer(False).solve(9)
    assert one.problem.states == other.problem.states == ("p[0]", "p[1]", "v[0]", "v[1]")
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.u, other.u)
    assert one.cost == pytest.approx(30.0)


def test_a_guess_and_a_constraint_of_a_vector_are_element_by_element() -> None:
    ocp = OptimalControlProblem("vector")
    x, u = ocp.state("x", 3, guess=[(0, 1, 2), (4, 5, 6)]), ocp.control("u", 3, guess=lambda t: [t, 2 * t, 3.0])
    ocp.duration(2.0)
    ocp.dynamics(x, u)
    ocp.constrain(x + u <= [1, 2, 3])
    problem = ocp.functions()
    assert problem.guess_states[[0, -1]].tolist() == [[0, 1, 2], [4, 5, 6]]
    np.testing.assert_allclose(problem.guess_controls[-1], [2.0, 4.0, 3.0])
    assert problem.path_bounds.upper.tolist() == [1, 2, 3]
    assert problem.path_names == ("((x[0]+u[0])<=1)", "((x[1]+u[1])<=2)", "((x[2]+u[2])<=3)")


# tables and functions of MX

SLOPE = np.linspace(-2.0, 2.0, 41)


def drag(kind: str) -> Callable[[ca.SX], ca.SX]:
    """x -> x^3 / 4 + x, exactly or from a table."""
    if kind == "exact":
        return lambda x: x**3 / 4 + x
    if kind == "function of MX":
        m = ca.MX.sym("m")
        return ca.Function("drag", [m], [m**3 / 4 + m])  # type: ignore[no-any-return]
    if kind == "opaque function of MX":
        m = ca.MX.sym("m")
        value = ca.solve(1 + ca.MX(1, 1), m**3 / 4 + m)
        return ca.Function("drag", [m], [value], {"never_inline": True})  # type: ignore[no-any-return]
    return ca.interpolant("drag", kind, [SLOPE], SLOPE**3 / 4 + SLOPE)  # type: ignore[no-any-return]


def braked(kind: str) -> OptimalControlProblem:
    ocp = OptimalControlProblem(f"braked, {kind}")
    x, u = ocp.state("x", guess=(1.5, 0.5)), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u - drag(kind)(x))
    ocp.start(x, 1.5)
    ocp.end(x, 1.0)
    return ocp


@pytest.mark.parametrize(
    ("kind", "tolerance"),
    [("bspline", 1e-9), ("linear", 5e-3), ("function of MX", 1e-12), ("opaque function of MX", 1e-9)],
)
def test_a_table_and_a_function_of_mx_stand_in_the_dynamics(kind: str, tolerance: float) -> None:
    exact, found = (braked(each).solve(11) for each in ("exact", kind))
    assert found.ok
    assert found.cost == pytest.approx(exact.cost, rel=tolerance)


def test_a_table_has_exact_derivatives() -> None:
    problem = braked("bspline").functions()
    x, u, t, p = problem.dynamics.sx_in()
    slope = ca.Function("slope", [x], [ca.jacobian(problem.dynamics(x, u, t, p), x)])
    assert float(slope(0.7)) == pytest.approx(-(0.75 * 0.49 + 1), abs=1e-9)


# |u| and the largest of several


def least_fuel(cost: Callable[[OptimalControlProblem, ca.SX], ca.SX]) -> OptimalControlProblem:
    """x'' = u, |u| <= 1, from 0 to 0.5 at rest in 2 s, least ∫ |u|: thrust, coast, brake, J = 2 (1 - √(1 - 0.5))."""
    ocp, x, v, u = double_integrator("least fuel", 1.0, guess=(0.0, 0.5))
    ocp.duration(2.0)
    ocp.minimise(running=cost(ocp, u))
    ocp.end(ca.vertcat(x, v), [0.5, 0.0])
    return ocp


@pytest.mark.parametrize(
    "cost", [lambda ocp, u: ocp.absolute(u), lambda ocp, u: ocp.largest(u, -u), lambda ocp, u: ocp.largest([u, -u])]
)
def test_a_kink_is_split(cost: Callable[[OptimalControlProblem, ca.SX], ca.SX]) -> None:
    found = hp(least_fuel(cost).functions())
    assert found.ok
    assert found.cost == pytest.approx(2.0 * (1.0 - math.sqrt(0.5)), rel=1e-6)


def test_a_kink_in_a_running_cost_is_announced() -> None:
    with pytest.warns(UserWarning, match=r"the running cost has a kink \(fabs\), .* absolute\(\) and largest"):
        least_fuel(lambda ocp, u: ca.fabs(u))
    with pytest.warns(UserWarning, match=r"a kink \(fmax\)"):
        least_fuel(lambda ocp, u: 2 * ca.fmax(u, 0))


# constants to be found, integrals, coupled ends, start times


def test_an_unknown_constant_is_found() -> None:
    """x' = m, x(0) = 0, x(T) = 3 in T = 2: m = 1.5."""
    ocp = OptimalControlProblem("slope")
    x, m = ocp.state("x"), ocp.unknown("m", lower=0.0, upper=5.0, guess=1.0)
    ocp.duration(2.0)
    ocp.minimise(terminal=m**2)
    ocp.dynamics(x, m)
    ocp.start(x, 0.0)
    ocp.end(x, 3.0)
    assert ocp.solve(5)["m"] == pytest.approx(1.5)


@pytest.mark.parametrize("how", ["limit", "comparison", "named"])
def test_an_integral_is_limited(how: str) -> None:
    """The longest way x(1) of x' = u with ∫ u^2 <= 4 is 2, at u = 2."""
    ocp = OptimalControlProblem("longest way")
    x, u = ocp.state("x"), ocp.control("u", guess=1.0)
    ocp.duration(1.0)
    ocp.minimise(terminal=-x)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    if how == "comparison":
        ocp.end_constraint(ocp.integral(u**2) <= 4)
    else:
        ocp.integral(u**2, upper=4, name="effort" if how == "named" else "")
    found = ocp.solve(9)
    name = "effort" if how == "named" else "integral 1"
    assert found["x"][-1] == pytest.approx(2.0)
    assert found[name][-1] == pytest.approx(4.0)
    index = found.problem.states.index(name)
    np.testing.assert_allclose(found.problem.guess_states[[0, -1], index], [0.0, 1.0])  # along the guess u = 1


def test_ends_are_coupled() -> None:
    """x' = u + cos t over 2 π, periodic, least ∫ u^2 + x^2: u = -1/2 cos t, x = 1/2 sin t, J = π / 2."""
    ocp = OptimalControlProblem("periodic")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(2.0 * math.pi)
    ocp.minimise(running=u**2 + x**2)
    ocp.dynamics(x, u + ca.cos(ocp.t))
    ocp.periodic(x)
    found = ocp.solve(41)
    assert found["x"][0] == pytest.approx(found["x"][-1], abs=1e-9)
    assert found.cost == pytest.approx(math.pi / 2, rel=1e-5)


def test_the_start_of_a_state_stands_in_an_end_constraint() -> None:
    """x' = u, x(1) = 2 x(0) + 1, least ∫ u^2 + x(0)^2: u = x(0) + 1, so x(0) = -1/2."""
    ocp = OptimalControlProblem("coupled")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2, terminal=ocp.initial(x) ** 2)
    ocp.dynamics(x, u)
    ocp.end_constraint(x == 2 * ocp.initial(x) + 1)
    found = ocp.solve(5)
    assert found["x"][0] == pytest.approx(-0.5)
    assert found["x(0)"] == pytest.approx(-0.5)


def test_time_is_counted_from_a_start_time_that_is_stated() -> None:
    ocp = OptimalControlProblem("late")
    x = ocp.state("x", guess=lambda t: t)
    ocp.start_time(5.0)
    ocp.duration(1.0)
    ocp.dynamics(x, 2 * ocp.t)
    ocp.start(x, 0.0)
    found = ocp.solve(5)
    assert found["x"][-1] == pytest.approx(36.0 - 25.0)
    assert found.problem.guess_states[-1, 0] == 1.0


def test_a_start_time_is_found() -> None:
    """x' = cos t over a second gains most, 2 sin(1/2), from t0 = -1/2."""
    ocp = OptimalControlProblem("when to start")
    x = ocp.state("x")
    t_0 = ocp.free_start_time(guess=0.2, lower=-2.0, upper=2.0)
    ocp.duration(1.0)
    ocp.minimise(terminal=-x)
    ocp.dynamics(x, ca.cos(ocp.t))
    ocp.start(x, 0.0)
    ocp.end_constraint(t_0 >= -1.5)
    found = ocp.solve(9)
    assert found["t0"] == pytest.approx(-0.5, abs=1e-6)
    assert found.cost == pytest.approx(-2.0 * math.sin(0.5), rel=1e-7)


# guesses and scales


def guessed() -> tuple[OptimalControlProblem, ca.SX, ca.SX]:
    ocp = OptimalControlProblem("guess")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(2.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u - x)
    ocp.start(x, 1.0)
    return ocp, x, u


def guess_at(problem: ProblemFunctions, times: Array) -> Array:
    return np.interp(times / problem.guess_duration, problem.guess_times, problem.guess_states[:, 0])


def test_a_guess_has_values_at_times_or_is_a_function() -> None:
    times = np.linspace(0.0, 2.0, 7)
    ocp, x, _ = guessed()
    ocp.guess(x, [0.0, 1.0, 4.0], times=[0.0, 0.5, 1.0])
    np.testing.assert_allclose(guess_at(ocp.functions(), times), np.interp(times, [0.0, 0.5, 1.0], [0.0, 1.0, 4.0]))
    ocp.guess(x, 3.0)
    assert guess_at(ocp.functions(), times) == pytest.approx(3.0)
    ocp.guess(x, math.exp)
    np.testing.assert_allclose(guess_at(ocp.functions(), times), np.exp(times), rtol=1e-4)


def test_a_guess_is_simulated() -> None:
    times = np.linspace(0.0, 2.0, 7)
    ocp, _, u = guessed()
    ocp.guess(u, 2.0)
    ocp.guess_by_simulation()
    np.testing.assert_allclose(guess_at(ocp.functions(), times), 2.0 - np.exp(-times), atol=1e-3)
    ocp.guess_by_simulation({"x": 5.0})
    np.testing.assert_allclose(guess_at(ocp.functions(), times), 2.0 + 3.0 * np.exp(-times), atol=1e-3)


def test_a_simulation_that_diverges_says_when() -> None:
    ocp = OptimalControlProblem("blowing up")
    x = ocp.state("x")
    ocp.duration(2.0)
    ocp.dynamics(x, x**2)
    ocp.start(x, 1.0)
    ocp.guess_by_simulation()
    with pytest.raises(ProblemError, match=r"blowing up: the simulation for the guess diverges after t = 1 s"):
        ocp.solve(5)


def test_a_guess_is_taken_from_a_solution_of_another_problem_by_name() -> None:
    ocp, _, _ = guessed()
    earlier = ocp.solve(9)
    other = OptimalControlProblem("other")
    w, x, u = other.state("w", guess=7.0), other.state("x"), other.control("u")
    other.free_duration(guess=1.0)
    other.minimise(running=u**2 + w**2)
    other.dynamics(ca.vertcat(w, x), ca.vertcat(u, u - x))
    other.guess_from(earlier)
    problem = other.functions()
    assert problem.guess_duration == 2.0
    assert problem.guess_states[:, 0] == pytest.approx(7.0)
    np.testing.assert_allclose(
        np.interp(earlier.t / 2.0, problem.guess_times, problem.guess_states[:, 1]), earlier["x"]
    )


def test_scales_are_automatic_where_none_is_stated() -> None:
    ocp = OptimalControlProblem("scales")
    x, y, z = ocp.state("x", guess=(0, -300)), ocp.state("y", scale=7.0, guess=1e3), ocp.state("z", lower=-50.0)
    u, w = ocp.control("u", lower=-20.0, upper=10.0), ocp.control("w")
    ocp.free_duration(guess=4.0)
    ocp.dynamics(ca.vertcat(x, y, z), ca.vertcat(u, u, w))
    ocp.end(z, 80.0)
    ocp.end_constraint(x <= ocp.initial(x) + 1)
    assert ocp.scaling() == {"x": 300.0, "y": 7.0, "z": 80.0, "x(0)": 300.0, "u": 20.0, "w": 1.0, "T": 4.0}
    np.testing.assert_array_equal(ocp.functions().state_scale, [300.0, 7.0, 80.0, 300.0])


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e5])
def test_the_unit_of_a_state_does_not_matter(unit: float) -> None:
    ocp = OptimalControlProblem("braking")
    x, v = ocp.state("x", guess=(0.0, 50.0 * unit)), ocp.state("v", guess=(30.0 * unit, 0.0))
    u = ocp.control("u", lower=-9.0 * unit, upper=9.0 * unit)
    T = ocp.free_duration(guess=5.0, lower=1.0, upper=60.0)
    ocp.minimise(terminal=T)
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
    ocp.start(ca.vertcat(x, v), [0.0, 30.0 * unit])
    ocp.end(ca.vertcat(x, v), [50.0 * unit, 0.0])
    found = solve(ocp.functions(), 9)
    assert found.duration == pytest.approx(30.0 / 9.0, rel=1e-6)


def test_parameters_and_unknowns_may_be_vectors() -> None:
    ocp = OptimalControlProblem("vectors")
    x, c = ocp.state("x", 2), ocp.unknown("c", 2, guess=[1.0, 2.0])
    w = ocp.parameter("w", [3.0, 4.0])
    ocp.duration(1.0)
    ocp.minimise(terminal=ca.sumsqr(c))
    ocp.dynamics(x, c)
    ocp.start(x, 0.0)
    ocp.end(x, w)
    assert ocp.functions().parameters == ("w[0]", "w[1]")
    assert ocp.solve(5).cost == pytest.approx(25.0)
    assert ocp.solve(5, parameters={"w": [1.0, 0.0]}).cost == pytest.approx(1.0)
    assert ocp.solve(5, parameters={"w[0]": 0.0}).cost == pytest.approx(16.0)
    with pytest.raises(ProblemError, match=r"parameter w = 1.0; allowed: 2 numbers"):
        ocp.solve(5, parameters={"w": 1.0})


def test_functions_are_compiled_anew_only_where_something_is_stated() -> None:
    ocp, x, u = guessed()
    problem = ocp.functions()
    assert ocp.functions() is problem
    values = np.array([1.0, 2.0])
    ocp.guess(u, values)
    values[:] = 5.0
    assert ocp.functions().guess_controls[-1, 0] == 2.0
    for say in (
        lambda: ocp.guess(x, 2.0),
        lambda: ocp.constrain(u <= 3.0),
        lambda: ocp.constrain(u + x <= 3.0),
        lambda: ocp.end_constraint(x >= 0.0),
        lambda: ocp.start_time(1.0),
        lambda: ocp.integral(u**2),
    ):
        before = ocp.functions()
        say()
        assert ocp.functions() is not before
        assert ocp.functions() is ocp.functions()
    level = 1.0
    ocp.guess(x, lambda t: level)
    assert ocp.functions().guess_states[0, 0] == 1.0
    level = 2.0
    assert ocp.functions().guess_states[0, 0] == 2.0


@pytest.mark.parametrize("free", [True, False])
def test_the_duration_may_stand_in_dynamics_cost_and_constraints(free: bool) -> None:
    ocp = OptimalControlProblem("T everywhere")
    x, u = ocp.state("x"), ocp.control("u")
    T = ocp.free_duration(guess=2.0, lower=1.0, upper=4.0) if free else ocp.duration(2.0)
    ocp.minimise(running=u**2 * ocp.duration, terminal=T)
    ocp.dynamics(x, u * T)
    ocp.constrain(u <= 9 * T)
    ocp.start(x, 0.0 * T)
    ocp.end(x, 1.0)
    found = ocp.solve(5)
    # u = 1 / T^2, so J = T^-2 + T.
    assert found.ok
    assert found.duration == pytest.approx(2.0 ** (1.0 / 3.0) if free else 2.0, abs=1e-6)
    assert found.cost == pytest.approx(found.duration**-2 + found.duration, abs=1e-8)
    assert found.replay is not None
    assert found.replay.miss < 1e-9


def test_the_duration_of_a_phase_and_its_own_time_may_stand_in_its_dynamics() -> None:
    problem = MultiPhaseProblem("clock")
    for name in "ab":
        phase = problem.phase(name)
        own, whole = phase.state(f"own {name}"), phase.state("whole")
        T = phase.free_duration(guess=1.0, lower=0.5, upper=2.0)
        phase.dynamics(own, phase.elapsed / T**2)
        phase.dynamics(whole, phase.t)
        phase.start(own, 0.0)
        phase.end_constraint(T == 1.0)
        if name == "a":
            phase.start(whole, 0.0)
            first = phase
    problem.link(first, phase)
    found = problem.solve(5)
    assert found["b"]["own b"][-1] == pytest.approx(0.5)
    assert found["b"]["whole"][-1] == pytest.approx(2.0)
    for each in "ab":
        assert found[each].replay.miss < 1e-9  # type: ignore[union-attr]


def test_fatrop_is_chosen_with_the_scheme_that_it_needs() -> None:
    ocp = OptimalControlProblem("pushed")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(ca.vertcat(x, v), [1.0, 0.0])
    found = ocp.solve(21, options=Options(backend="fatrop"))
    assert found.ok
    assert found.scheme.name == "multiple shooting"
    assert found.cost == pytest.approx(ocp.solve(21, scheme="multiple shooting").cost, abs=1e-6)
    assert ocp.solve(21, scheme="Gauss-Legendre", method="redistribute").scheme.name == "Gauss-Legendre of order 6"


def test_a_solve_without_a_replay_is_at_best_converged() -> None:
    ocp = OptimalControlProblem("pushed")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u)
    ocp.start(x, ocp.parameter("x0", 0.0))
    ocp.end(x, 1.0)
    full, plain = ocp.solve(5), ocp.solve(5, replay=False)
    assert full.status is SolverOutcome.OPTIMAL
    assert plain.status is SolverOutcome.CONVERGED
    assert plain.replay is None
    assert not plain.ok
    np.testing.assert_array_equal(plain.x, full.x)
    refused = r"replay = False with nodes = .*; allowed: a number of nodes"
    with pytest.raises(ProblemError, match=refused):
        ocp.solve(replay=False)
    with pytest.raises(ProblemError, match=refused):
        ocp.solve(5, method="refine", replay=False)
    with pytest.raises(ProblemError, match=r"verify = True with replay = False; allowed: replay = True, for what"):
        ocp.solve(5, replay=False, verify=True)
