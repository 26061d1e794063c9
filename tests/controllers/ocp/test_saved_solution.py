"""A solution that is written to a file and read back is what it was; a file that is anything else is refused."""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.controllers.ocp.function_tape import OF_ONE, OF_TWO, function_of, taped
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.saved_solution import SCHEMES, load_solution
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.collocation import LegendreGaussLobatto
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA
from mathnavi.interfaces.errors import SolutionFileError
from mathnavi.interfaces.signals import Array
from tests.controllers.ocp.statements import transfer


def _problem() -> OptimalControlProblem:
    ocp = OptimalControlProblem("pendulum")
    a, w = ocp.state("angle", guess=(3.0, 0.0)), ocp.state("w")
    u, g = ocp.control("u", lower=-5.0, upper=5.0), ocp.parameter("g", 2.0)
    ocp.duration(2.0)
    ocp.minimise(running=u**2 + ca.if_else(a > 1.0, a, 1.0), terminal=ca.atan2(w, 2.0) ** 2)
    ocp.dynamics(a, w)
    ocp.dynamics(w, u - g * ca.sin(a))
    ocp.constrain(w - 3.0, upper=0.0)
    ocp.start(a, 1.0)
    ocp.start(w, 0.0)
    ocp.end(a, 0.0)
    return ocp


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solve(_problem().functions(), 7, scheme=LegendreGaussLobatto(3))


@pytest.fixture(scope="module")
def content(solution: Solution, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return solution.save(tmp_path_factory.mktemp("saved") / "pendulum.npz").read_bytes()


def test_a_solution_that_is_read_back_can_do_what_it_could(solution: Solution, tmp_path: Path) -> None:
    found = mn.load_solution(solution.save(tmp_path / "pendulum.npz"))
    t = np.linspace(0.0, 2.0, 9)
    for name in ("x", "inner", "u", "costates", "t", "hamiltonian", "rates"):
        assert np.array_equal(getattr(found, name), getattr(solution, name)), name
    assert np.array_equal(found.state(t), solution.state(t))
    assert np.array_equal(found("u", t), solution("u", t))
    assert repr(found) == repr(solution)
    assert repr(found.multipliers) == repr(solution.multipliers)
    assert found.sensitivities["g"] == solution.sensitivities["g"]
    assert (found.scheme, found.status, found.timing) == (solution.scheme, solution.status, solution.timing)
    warm = solve(_problem().functions(), 7, scheme=LegendreGaussLobatto(3), guess=found)
    assert warm.iterations < solution.iterations
    again = solve(found.problem, 7, scheme=found.scheme)  # the problem itself came with the file
    assert again.cost == pytest.approx(solution.cost, rel=1e-9)


def test_a_failed_solution_and_one_without_a_replay_are_kept_too(solution: Solution, tmp_path: Path) -> None:
    bare = replace(solution, replay=None, cost=np.nan, method="refinement")
    found = load_solution(bare.save(tmp_path / "bare.npz"))
    assert found.replay is None
    assert np.isnan(found.cost)
    assert found.method == "refinement"


@pytest.mark.parametrize("name", PROBLEMS)
def test_functions_of_every_problem_are_the_same_after_the_file(name: str) -> None:
    problem = PROBLEMS[name].problem()
    nx, nu, known = problem.nx, problem.nu, len(problem.parameters)
    rng = np.random.default_rng(0)
    for function in (problem.dynamics, problem.running_cost, problem.path):
        arrays = taped(function)
        assert arrays is not None
        again = function_of("again", arrays, (nx, nu, 1, known), function.numel_out(0))
        point = rng.uniform(0.5, 1.0, nx), rng.uniform(0.1, 0.9, nu), 0.5, problem.nominal
        assert np.array_equal(again(*point).full(), function(*point).full(), equal_nan=True)


def test_every_operation_is_one_of_casadi() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    for names, arguments in ((OF_ONE, (x,)), (OF_TWO, (x, y))):
        for name in names:
            made = getattr(ca.SX, "unary" if len(arguments) == 1 else "binary")(getattr(ca, f"OP_{name}"), *arguments)
            function = ca.Function("f", [x, y], [made])
            arrays = taped(function)
            assert arrays is not None, name
            again = function_of("again", arrays, (1, 1), 1)
            assert np.array_equal(again(0.3, 0.7).full(), function(0.3, 0.7).full(), equal_nan=True), name


def test_a_function_that_calls_a_table_is_taken_from_the_problem(tmp_path: Path) -> None:
    at = np.linspace(-1.0, 2.0, 9)
    table = ca.interpolant("table", "bspline", [at], 1.0 + at**2)
    ocp = OptimalControlProblem("table")
    x, u = ocp.state("x", guess=(0.0, 1.0)), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u / table(x))
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    problem = ocp.functions()
    assert taped(problem.dynamics) is None
    solution = solve(problem, 5)
    path = solution.save(tmp_path / "table.npz")
    with pytest.raises(SolutionFileError, match=r"dynamics.*allowed: to give the problem, problem=ocp.functions\(\)"):
        load_solution(path)
    assert np.array_equal(load_solution(path, problem).rates, solution.rates)


@pytest.mark.parametrize("name", SCHEMES)
def test_every_scheme_is_read_back(name: str, tmp_path: Path) -> None:
    problem = transfer(1.0).functions()
    scheme = VariableRadauIIA((2, 4)) if name == "VariableRadauIIA" else SCHEMES[name]()
    solution = solve(problem, 3, scheme=scheme)
    found = load_solution(solution.save(tmp_path / "short.npz"), problem)
    assert found.problem is problem
    assert found.scheme == solution.scheme
    assert np.array_equal(found.control(0.4), solution.control(0.4))


def _archive(arrays: dict[str, Array]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


Forgery = Callable[[dict[str, Array]], dict[str, Array]]


@pytest.mark.parametrize(
    ("forgery", "said"),
    [
        (lambda a: {}, "no array 'format'"),
        (lambda a: a | {"format": np.array("mathnavi solution 99")}, "allowed: mathnavi solution 1"),
        (lambda a: {k: v for k, v in a.items() if k != "solution.u"}, "no array 'solution.u'"),
        (lambda a: a | {"solution.x": a["solution.x"][:-1]}, "of shape"),
        (lambda a: a | {"solution.x": np.array("x")}, "allowed: numbers"),
        (lambda a: a | {"solution.status": np.array("SPLENDID")}, "SPLENDID.*allowed: OPTIMAL"),
        (lambda a: a | {"solution.scheme.kind": np.array("os.system")}, "os.system.*allowed: Euler"),
        (lambda a: a | {"solution.scheme.degree": np.array(10**9)}, "degree"),
        (lambda a: a | {"solution.duration": np.array(-1.0)}, "duration"),
        (lambda a: a | {"solution.grid.nodes": a["solution.grid.nodes"][::-1]}, "increase from 0 to 1"),
        (lambda a: a | {"solution.problem.dynamics.tape": a["solution.problem.dynamics.tape"] * 7}, "tape row"),
        (lambda a: a | {"solution.problem.dynamics.tape": np.zeros((2, 2), int)}, "tape of"),
        (lambda a: a | {"solution.problem.dynamics.size": np.array(9)}, "result 9"),
        (lambda a: a | {"solution.problem.states": np.array(["angle"])}, "inputs"),
        (lambda a: a | {"solution.multipliers.path.names": np.array(["a", "b"])}, "2 names"),
    ],
)  # fmt: skip
def test_a_forged_file_ends_in_one_line(forgery: Forgery, said: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "forged.npz"
    path.write_bytes(_archive(forgery(dict(np.load(io.BytesIO(content))))))
    with pytest.raises(SolutionFileError, match=said) as caught:
        load_solution(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_truncated_file_a_pickle_and_none_at_all_are_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "broken.npz"
    for broken in (content[: len(content) // 2], b"", pickle.dumps([1]), _archive({"solution.x": np.array([None])})):
        path.write_bytes(broken)
        with pytest.raises(SolutionFileError):
            load_solution(path)
    with pytest.raises(FileNotFoundError):
        load_solution(tmp_path / "none.npz")


def test_a_solution_of_another_problem_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "pendulum.npz"
    path.write_bytes(content)
    with pytest.raises(SolutionFileError, match=r"angle, w; u; g, and Bryson-Denham.* other"):
        load_solution(path, PROBLEMS["Bryson-Denham"].problem())
