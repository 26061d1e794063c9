"""Bocop's thirteen examples: those whose optima its own test compares (``bocop/test/examples.list.csv``).

Team Commands, Bocop 3, github.com/control-toolbox/bocop; an example is a ``problem.def`` (sizes, limits, guess) and a
``problem.cpp`` (equations). The list has three digits; an older one next to it, ``examples.list.csv.old``, has four.
"""

from __future__ import annotations

from mathnavi.studies.published.bocop_mechanics import (
    beam,
    fuller,
    goddard,
    integrator_1d,
    integrator_2d,
    regulator_1d,
    regulator_2d,
    robbins,
    vanderpol,
)
from mathnavi.studies.published.bocop_processes import (
    bioreactor_1day_periodic,
    heat_dirichlet,
    heat_neumann,
    jackson_basic,
)
from mathnavi.studies.published.optimum import PublishedOptimum

LIST = "Bocop 3, bocop/test/examples.list.csv"
RICCATI = "bang arc by matrix exponential and singular arc by a Riccati equation, DOP853 and Radau IIA"
EULER = "the printed value is that of implicit Euler with 1000 steps, which the file asks for"

PUBLISHED: dict[str, PublishedOptimum] = {
    "Bocop: beam": PublishedOptimum(
        "8.89e+00", LIST, beam, independent=8.8888888889, evidence="closed form: 8 / (9 L), L = 0.1"
    ),
    "Bocop: bioreactor_1day_periodic": PublishedOptimum(
        "-6.14e-01",
        LIST,
        bioreactor_1day_periodic,
        independent=-0.61413472602,
        evidence="Radau IIA, 34 x 6 and 54 x 7, and Gauss-Legendre, 34 x 5, on an arc without dilution at either end",
        singular=True,
    ),
    "Bocop: fuller": PublishedOptimum(
        "2.68e-01",
        LIST,
        fuller,
        independent=0.26839383057,
        evidence="closed form: the geometric series of the arcs between x = -ζ v |v|, ζ^2 = (√33 - 1) / 24",
        singular=True,
    ),
    "Bocop: jackson_basic": PublishedOptimum(
        "-1.92e-01",
        LIST,
        jackson_basic,
        independent=-0.19181435633,
        evidence="Radau IIA, 14 x 7, and Gauss-Legendre, 14 x 6 and 21 x 5, on three arcs",
        singular=True,
    ),
    "Bocop: goddard": PublishedOptimum(
        "-6.30e-01",
        LIST,
        goddard,
        independent=-0.62973889547,
        evidence="three arcs flown by DOP853; Radau IIA, 18 x 7, and Gauss-Legendre, 18 x 6, agree to 4e-11",
        note="an older list prints -6.341e-01, of another limit of the drag; no arc is singular at this one",
    ),
    "Bocop: heat_dirichlet": PublishedOptimum(
        "8.84e-02", LIST, heat_dirichlet, independent=0.091760025158, evidence=RICCATI, singular=True, note=EULER
    ),
    "Bocop: heat_neumann": PublishedOptimum(
        "1.73e-01", LIST, heat_neumann, independent=0.17879095234, evidence=RICCATI, singular=True, note=EULER
    ),
    "Bocop: integrator_1D": PublishedOptimum(
        "8.00e+01", LIST, integrator_1d, independent=80.0, evidence="closed form: (2 T + 10)^2 / T at T = 5"
    ),
    "Bocop: integrator_2D": PublishedOptimum(
        "6.00e+00",
        LIST,
        integrator_2d,
        independent=6.0,
        evidence="closed form: u = 6 - 12 t",
        note="the collection's double integrator, energy, one metre aside",
    ),
    "Bocop: regulator_1D": PublishedOptimum(
        "3.75e-01", LIST, regulator_1d, independent=0.375, evidence="closed form: 1/3 + 1/24", singular=True
    ),
    "Bocop: regulator_2D": PublishedOptimum(
        "3.77e-01",
        LIST,
        regulator_2d,
        independent=0.37699193029,
        evidence="closed form up to a root: u = -1, then x = a cosh(5 - t)",
        singular=True,
        note="half of the collection's singular regulator",
    ),
    "Bocop: robbins": PublishedOptimum(
        "1.94e+01",
        LIST,
        robbins,
        independent=19.431781953,
        evidence="exact pieces of degree six between touch points, up to seven of them",
    ),
    "Bocop: vanderpol": PublishedOptimum(
        "1.05e+00",
        LIST,
        vanderpol,
        independent=1.0478069082,
        evidence="Radau IIA, 12 x 7, and Gauss-Legendre, 18 x 5",
    ),
}
