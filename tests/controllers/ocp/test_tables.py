"""What an interpreter shows of problems and solutions: short tables, and the same in a notebook."""

from __future__ import annotations

import math

import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import limit_rows, limits_text
from mathnavi.controllers.ocp.solution import ReplayResult, Timing


@pytest.mark.parametrize(
    ("lower", "upper", "text"),
    [(0.0, 1.0, "0 to 1"), (-math.inf, math.inf, "free"), (2.0, 2.0, "= 2"), (0.0, math.inf, ">= 0"),
     (-math.inf, 3.0, "<= 3")],
)  # fmt: skip
def test_limits_are_a_few_characters(lower: float, upper: float, text: str) -> None:
    assert limits_text(lower, upper) == text


def test_many_of_a_kind_are_counted() -> None:
    rows = limit_rows("state", [(f"x[{k}]", 0.0, 1.0) for k in range(30)])
    assert len(rows) == 13
    assert rows[-1][0] == "18 more of state"


def test_problems_and_results_are_short_tables() -> None:
    ocp = OptimalControlProblem("pulled")
    x, v, u = ocp.state("x"), ocp.state("v", upper=2.0), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(3.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, v)
    assert repr(ocp).splitlines()[-1].split() == ["no", "dynamics", "yet", "v"]
    force = ocp.parameter("force", 0.2)
    ocp.dynamics(v, u + force)
    ocp.constrain(x + v, upper=9.0, name="reach")
    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, 1.0)
    solution = solve(ocp.functions(), 9)
    shown = [ocp, solution.problem, solution, solution.multipliers, solution.sensitivities, solution.replay]
    for each in (*shown, solution.timing):
        text = repr(each)
        assert len(text) < 900, text
        assert max(map(len, text.splitlines())) < 100, text
    for words in (
        "state v <= 2",
        "control u -1 to 1",
        "path reach <= 9",
        "parameter force = 0.2",
        "T = 3 s",
        "start of x = 0",
        "end of x = 1",
    ):
        for problem in (ocp, solution.problem):
            assert words in " ".join(repr(problem).split()), words
    assert "dJ/dforce" in repr(solution)
    assert isinstance(solution.replay, ReplayResult)
    assert "replay miss" in repr(solution.replay)
    assert repr(Timing(1.0, 2.0)) == "3.0 ms (build 1.0, solve 2.0, replay 0.0, gate 0.0, verify 0.0)"
    for each in (ocp, solution.problem, solution):
        assert each._repr_html_().startswith("<b>")
