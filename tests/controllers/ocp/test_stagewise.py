"""Derivatives assembled stage by stage are those of the whole programme, whatever the scheme and the nodes."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.distribution import Equidistributed, Fixed, NodeDistribution
from mathnavi.controllers.ocp.nlp import Programme, programme
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.controllers.ocp.transcriptions.collocation import LegendreGaussLobatto, RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.signals import Array


def constrained() -> ProblemFunctions:
    """Everything a problem may have: parameters, path constraints, time, nonlinear ends and a terminal cost."""
    ocp = OptimalControlProblem("constrained")
    x, v, u = ocp.state("x", lower=-2.0), ocp.state("v", scale=3.0), ocp.control("u", upper=1.0)
    k = ocp.parameter("k", 0.7)
    T = ocp.free_duration(guess=2.0, lower=0.1)
    ocp.minimise(running=u**2 * (1 + ocp.t) + ca.sin(x), terminal=x**2 * T)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u - k * ca.sin(x) * v)
    ocp.constrain(x * v + u**2, upper=4.0)
    ocp.start_constraint(x**2 + v**2, lower=1.0, upper=2.0)
    ocp.end_constraint(x * v * T + k, lower=0.0, upper=1.0)
    return ocp.functions()


CASES: list[tuple[ProblemFunctions, Scheme, NodeDistribution, int]] = [
    (constrained(), Euler(), Fixed(), 2),
    (constrained(), MultipleShooting(2), Fixed(), 5),
    (constrained(), MultipleShooting(1), Equidistributed(), 4),
    (constrained(), HermiteSimpson(), Fixed(), 4),
    (constrained(), HermiteSimpson(), Equidistributed(), 3),
    (constrained(), LegendreGaussLobatto(3), Fixed(), 3),
    (constrained(), RadauIIA(3), Fixed(), 3),
    (missile("SM2"), MultipleShooting(1), Fixed(), 4),
]


def somewhere(nlp: Programme) -> tuple[Array, Array, Array]:
    """Unknowns, parameters and multipliers."""
    rng = np.random.default_rng(7)
    return 0.5 + rng.random(nlp.x.numel()), 0.5 + rng.random(nlp.p.numel()), rng.standard_normal(len(nlp.lower))


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0].name}-{case[1].name}-{case[3]}")
def test_they_are_the_derivatives_of_the_programme(
    case: tuple[ProblemFunctions, Scheme, NodeDistribution, int], solver: str
) -> None:
    nlp = programme(*case)
    x, p, lam = somewhere(nlp)
    f, g, mu = nlp.assembly.f, nlp.assembly.g, ca.MX.sym("mu", len(nlp.lower))
    lagrangian = 1.5 * f + ca.dot(mu, g)
    wanted = ca.Function(
        "wanted",
        [nlp.x, nlp.p, mu],
        [
            ca.gradient(f, nlp.x),
            ca.jacobian(g, nlp.x),
            ca.hessian(lagrangian, nlp.x)[0],
            ca.gradient(lagrangian, nlp.x),
        ],
    )(x, p, lam)
    gradient, jacobian, hessian, slope = (np.array(value) for value in wanted)
    made: dict[str, Any] = nlp.assembly.derivatives(solver)
    first = made["nlp_grad_f"](x, p)
    np.testing.assert_allclose(np.array(first[-1] if solver == "ipopt" else first), gradient, atol=1e-11)
    np.testing.assert_allclose(np.array(made["nlp_jac_g"](x, p)[1]), jacobian, atol=1e-11)
    second = made["nlp_hess_l"](x, p, 1.5, lam)
    if solver == "ipopt":
        np.testing.assert_allclose(np.array(second), np.triu(hessian), atol=1e-10)
    else:
        np.testing.assert_allclose(np.array(second[0]), slope, atol=1e-10)
        np.testing.assert_allclose(np.array(second[1]), hessian, atol=1e-10)
