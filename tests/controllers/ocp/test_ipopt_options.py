"""Options reach IPOPT, and its log is written where it is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mathnavi.controllers.ocp.backend import Options
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.interfaces.errors import FieldError


def solved(method: str = "direct", **options: Any) -> Solution:
    ocp = OptimalControlProblem("landing")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", lower=-4.0, upper=4.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**4 + v**2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u - v**3)
    ocp.start(x, 0.0), ocp.start(v, 0.0), ocp.end(x, 0.5)
    return ocp.solve(7, method=method, options=Options(**options))  # type: ignore[arg-type]


@pytest.mark.parametrize("options", [{"linear_solver": "spral"}, {"hessian": "limited-memory", "tolerance": 1e-7}])
def test_another_solver_of_the_same_programme_finds_the_same(options: dict[str, Any]) -> None:
    one, other = solved(), solved(**options)
    assert other.ok
    assert other.cost == pytest.approx(one.cost, rel=1e-5)
    if "hessian" in options:
        assert other.iterations > one.iterations


@pytest.mark.parametrize("method", ["direct", "redistribute", "distribute", "refine"])
def test_the_log_has_a_line_for_each_iteration(method: str, tmp_path: Path) -> None:
    log = tmp_path / "ipopt.log"
    found = solved(method, log=str(log))
    assert found.status in (SolverOutcome.OPTIMAL, SolverOutcome.CONVERGED)
    assert "Number of Iterations" in log.read_text()
    if method == "direct":
        assert f"Number of Iterations....: {found.iterations}" in log.read_text()


def test_iterations_are_printed_on_request(capfd: pytest.CaptureFixture[str]) -> None:
    solved(print_level=5)
    assert "EXIT: Optimal Solution Found." in capfd.readouterr().out
    solved()
    assert capfd.readouterr().out == ""


def test_a_linear_solver_that_is_not_there_is_a_status() -> None:
    failed = solved(linear_solver="ma27")
    assert failed.status is SolverOutcome.FAILED
    assert "linear_solver = 'ma27' is not in this build of IPOPT" in failed.message


@pytest.mark.parametrize("wrong", [{"linear_solver": "ma"}, {"hessian": "none"}, {"print_level": 13}])
def test_options_that_ipopt_has_not_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(FieldError, match="allowed"):
        Options(**wrong)


@pytest.mark.parametrize("log", [5, b"a.log", True, "", "{}", "{}/none/a.log", "{}/a.log/b.log"])
def test_a_log_that_cannot_be_written_is_refused_before_anything_is_solved(log: Any, tmp_path: Path) -> None:
    kept = tmp_path / "a.log"
    kept.write_text("kept")
    with pytest.raises(FieldError, match=r"^log = .*; allowed: a (text|file)"):
        Options(log=log.format(tmp_path) if isinstance(log, str) else log)
    assert kept.read_text() == "kept"
