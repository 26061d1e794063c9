"""Tumour anti-angiogenesis: a limited dose of a drug that stops a tumour's vessels (Ledzewicz and Schättler, 2007).

    minimise p(T)   subject to   p' = -ξ p ln(p / q),   q' = q (b - μ - d p^(2/3) - G u),
                                 0 <= u <= 75,   ∫ u dt <= 15,   T <= 5,   (p, q)(0) = (p̄ / 2, p̄ / 4)

p is the tumour's volume, q what its vessels can carry [mm^3], t in days, p̄ = ((b - μ) / d)^(3/2) where both rest. The
optimum gives the drug as fast as it may and then nothing: p(T)* = 7571.6700. The 7571.6784 in the manuals of GPOPS-II
and SOS comes from a grid that does not resolve the switch.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

XI, B, D, G, MU = 0.084, 5.85, 0.00873, 0.15, 0.02  # ξ [1/day], b [1/day], d [1/(mm^2 day)], G, μ [1/day]
MOST_DOSE, MOST_DRUG = 75.0, 15.0


@cache
def tumour() -> ProblemFunctions:
    """Therapy to the smallest tumour p(T) [mm^3] within five days."""
    p_bar = ((B - MU) / D) ** 1.5  # [mm^3]
    ocp = OptimalControlProblem("tumour")

    p = ocp.state("p", lower=1.0, upper=p_bar, scale=1e4, guess=(p_bar / 2, p_bar / 2))
    q = ocp.state("q", lower=1.0, upper=p_bar, scale=1e4, guess=(p_bar / 4, p_bar / 4))
    given = ocp.state("given", upper=MOST_DRUG, scale=10.0, guess=(0.0, MOST_DRUG))  # ∫ u dt
    u = ocp.control("u", lower=0.0, upper=MOST_DOSE, scale=50.0, guess=(MOST_DOSE, MOST_DOSE))
    ocp.free_duration(guess=1.0, lower=0.1, upper=5.0)

    ocp.minimise(terminal=p)

    ocp.dynamics(p, -XI * p * ca.log(p / q))
    ocp.dynamics(q, q * (B - MU - D * p ** (2 / 3) - G * u))
    ocp.dynamics(given, u)

    ocp.start(p, p_bar / 2)
    ocp.start(q, p_bar / 4)
    ocp.start(given, 0.0)
    return ocp.functions()
