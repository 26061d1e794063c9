"""A solver's failure reaches the user as a status; unsolvable problems are refused before."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.backend import Options
from mathnavi.controllers.ocp.grid import uniform
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.low_order import HermiteSimpson, MultipleShooting
from tests.controllers.ocp.statements import integrator, transfer

SHOOTING = MultipleShooting(1)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_boundary_conditions_out_of_reach_are_a_status(backend: str) -> None:
    options = Options(backend=backend)  # type: ignore[arg-type]
    failed = solve(transfer(5.0, 1.0).functions(), 11, scheme=SHOOTING, options=options)
    assert failed.status in (SolverOutcome.INFEASIBLE, SolverOutcome.FAILED, SolverOutcome.LIMIT)
    assert not failed.solved
    assert failed.message


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_dynamics_that_are_not_finite_are_a_status(backend: str, capfd: pytest.CaptureFixture[str]) -> None:
    ocp = OptimalControlProblem("root of a negative number")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, ca.sqrt(x - 1.0) + u)
    ocp.start(x, 0.0)
    failed = solve(ocp.functions(), 11, scheme=SHOOTING, options=Options(backend=backend))  # type: ignore[arg-type]
    assert failed.status in (SolverOutcome.NOT_FINITE, SolverOutcome.FAILED)
    assert "casadi" not in failed.message
    assert "NaN" not in "".join(capfd.readouterr())


def test_a_parameter_that_is_not_finite_is_a_status() -> None:
    ocp = OptimalControlProblem("parameter")
    x, u = ocp.state("x"), ocp.control("u")
    k = ocp.parameter("k", 1.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, k * u)
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    problem = ocp.functions()
    assert solve(problem, 5, parameters=np.array([np.nan])).status is SolverOutcome.NOT_FINITE
    assert solve(problem, 5, parameters=problem.values(k=2.0)).cost == pytest.approx(0.25)
    with pytest.raises(ValueError, match=r"parameters: shape \(2,\)"):
        solve(problem, 5, parameters=np.array([1.0, 2.0]))


def test_a_warm_start_needs_fewer_iterations() -> None:
    cold = solve(missile("SM2"), 25)
    warm = solve(missile("SM2"), 25, guess=cold, options=Options(warm=True))
    assert warm.solved
    assert warm.iterations < cold.iterations


def test_a_grid_or_a_guess_of_another_size_is_refused() -> None:
    made = transcription(missile("SM2"), HermiteSimpson(), 11)
    with pytest.raises(ValueError, match="grid: 12 nodes; allowed: the 11"):
        made.solve(grid=uniform(12))
    with pytest.raises(ValueError, match="guess: a solution of transfer"):
        made.solve(guess=transfer(0.5).solve(11))


@pytest.mark.parametrize("wrong", [{"backend": "snopt"}, {"tolerance": 0.0}, {"tolerance": np.nan}, {"iterations": 0}])
def test_options_that_make_no_sense_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="allowed"):
        Options(**wrong)  # type: ignore[arg-type]


def test_more_equations_than_unknowns_are_a_status_and_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    ocp, x, u = integrator()
    ocp.duration(1.0)
    ocp.constrain(u == x)
    ocp.end(x, 2.0)
    assert ocp.solve(5).status is SolverOutcome.OVERDETERMINED
    assert capfd.readouterr() == ("", "")
