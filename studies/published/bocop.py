"""Bocop's thirteen examples: those whose optima its own test compares (``bocop/test/examples.list.csv``).

Team Commands, Bocop 3, github.com/control-toolbox/bocop; an example is a ``problem.def`` (sizes, limits, guess) and a
``problem.cpp`` (equations). The list has three digits; an older one beside it, ``examples.list.csv.old``, has four.
"""

from __future__ import annotations

from mathnavi.studies.published.optimum import PublishedOptimum

LIST = "Bocop 3, bocop/test/examples.list.csv"

PUBLISHED: dict[str, PublishedOptimum] = {
    "Bocop: beam": PublishedOptimum("8.89e+00", LIST),
    "Bocop: bioreactor_1day_periodic": PublishedOptimum("-6.14e-01", LIST),
    "Bocop: fuller": PublishedOptimum("2.68e-01", LIST),
    "Bocop: jackson_basic": PublishedOptimum("-1.92e-01", LIST),
    "Bocop: goddard": PublishedOptimum("-6.30e-01", LIST),
    "Bocop: heat_dirichlet": PublishedOptimum("8.84e-02", LIST),
    "Bocop: heat_neumann": PublishedOptimum("1.73e-01", LIST),
    "Bocop: integrator_1D": PublishedOptimum("8.00e+01", LIST),
    "Bocop: integrator_2D": PublishedOptimum("6.00e+00", LIST),
    "Bocop: regulator_1D": PublishedOptimum("3.75e-01", LIST),
    "Bocop: regulator_2D": PublishedOptimum("3.77e-01", LIST),
    "Bocop: robbins": PublishedOptimum("1.94e+01", LIST),
    "Bocop: vanderpol": PublishedOptimum("1.05e+00", LIST),
}
