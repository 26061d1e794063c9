"""The inertia of the KKT matrix tells a minimum from a saddle, and finds the way down."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting, Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.verification.cost_bound import cost_size
from mathnavi.controllers.ocp.verification.second_order import SecondOrder, metric, second_order
from tests.controllers.ocp.verification.statements import concave, conjugate, singular

SCHEMES: tuple[Scheme, ...] = (RadauIIA(3), HermiteSimpson(), Trapezoid(), MultipleShooting(), Euler())


def judged(solution: Solution) -> SecondOrder:
    assert solution.solved_programme is not None
    return second_order(solution.solved_programme, cost_size(solution))


def on_mesh(problem: OptimalControlProblem, nodes: int = 13, scheme: Scheme = SCHEMES[0]) -> Solution:
    return solve(problem.functions(), nodes, scheme=scheme)


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)
def test_a_maximum_is_no_minimum_by_any_scheme(scheme: Scheme) -> None:
    found = judged(on_mesh(concave(), scheme=scheme))
    assert found.decided
    assert found.curvature == pytest.approx(-2.0, rel=0.05)  # of -∫ u², whose fastest direction hardly moves x


def test_a_curvature_does_not_change_with_the_mesh() -> None:
    coarse, fine = (judged(on_mesh(conjugate(4.0), nodes)).curvature for nodes in (9, 33))
    assert coarse < 0.0
    assert coarse == pytest.approx(fine, rel=1e-2)


@pytest.mark.parametrize(("duration", "minimum"), [(3.1, True), (3.15, False)])
def test_a_conjugate_point_is_found_to_one_percent(duration: float, minimum: bool) -> None:
    found = judged(on_mesh(conjugate(duration)))
    assert found.decided
    assert (found.direction is None) is minimum


@pytest.mark.parametrize(("sign", "minimum"), [(1.0, True), (-1.0, False)])
def test_a_singular_arc_has_the_sign_of_kelley(sign: float, minimum: bool) -> None:
    found = judged(on_mesh(singular(sign)))
    assert (found.direction is None) is minimum


@pytest.mark.parametrize("name", ["double integrator, time", "lunar landing", "Bryson-Denham", "maximum range"])
def test_a_minimum_passes(name: str) -> None:
    found = judged(hp(PROBLEMS[name].problem()))
    assert found.decided
    assert found.direction is None


def test_the_least_eigenvalue_is_that_of_the_reduced_hessian() -> None:
    solution = on_mesh(conjugate(4.0), 6)
    solved = solution.solved_programme
    assert solved is not None
    functions = solved.programme.assembly.derivatives("ipopt")
    H = functions["nlp_hess_l"](solved.x, solved.known, 1.0, solved.multipliers[1]).full()
    A = functions["nlp_jac_g"](solved.x, solved.known)[1].full()
    root = 1.0 / np.sqrt(metric(solved))
    Z = null_space(A * root)
    least = np.linalg.eigvalsh(Z.T @ ((H + np.triu(H, 1).T) * root * root[:, None]) @ Z)[0]
    assert judged(solution).curvature == pytest.approx(least, rel=1e-6)
