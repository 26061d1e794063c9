"""Every solver finds the same optimum, from the same guess the same way, and says so where it finds none."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from mathnavi.controllers.ocp.backend import Backend, NumericalSolver, Options
from mathnavi.controllers.ocp.distribution import Equidistributed, Fixed, NodeDistribution
from mathnavi.controllers.ocp.nlp import programme
from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.low_order import HermiteSimpson, MultipleShooting
from mathnavi.models import compilation
from mathnavi.models.solver_process import PROCESS
from tests.controllers.ocp.statements import growing

NODES = 12
COMPILED = pytest.mark.skipif(compilation.compiler() is None, reason="there is no C compiler named cc")
BACKENDS = [
    pytest.param(backend, marks=COMPILED if backend.endswith("compiled") else ()) for backend in get_args(Backend)
]


def solution(backend: Backend, distribution: NodeDistribution, guess: Solution | None = None) -> Solution:
    options = Options(backend, tolerance=1e-8, warm=guess is not None)
    return transcription(missile("SM2"), MultipleShooting(1), NODES, distribution, options).solve(guess)


@pytest.fixture(scope="module")
def uniform() -> Solution:
    return solution("ipopt", Fixed())


@pytest.fixture(scope="module")
def adaptive(uniform: Solution) -> Solution:
    return solution("ipopt", Equidistributed(), uniform)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_optimum_is_the_same(backend: Backend, uniform: Solution) -> None:
    found = solution(backend, Fixed(), uniform)
    assert found.solved, found.message
    assert found.cost == pytest.approx(uniform.cost, rel=1e-7)
    np.testing.assert_allclose(
        found.u / found.problem.control_scale, uniform.u / uniform.problem.control_scale, atol=1e-4
    )
    np.testing.assert_allclose(found.costates, uniform.costates, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("backend", BACKENDS)
def test_so_is_the_grid_where_the_nodes_are_unknowns(backend: Backend, uniform: Solution, adaptive: Solution) -> None:
    found = solution(backend, Equidistributed(), uniform)
    assert found.solved, found.message
    assert found.cost == pytest.approx(adaptive.cost, rel=1e-6)
    np.testing.assert_allclose(found.grid.nodes, adaptive.grid.nodes, atol=1e-4)
    assert np.ptp(np.diff(found.grid.nodes)) > 0.01


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_the_same_call_gives_the_same_answer_whatever_was_solved_before(backend: Backend) -> None:
    nlp = programme(missile("SM2"), MultipleShooting(1), Fixed(), NODES)
    known = np.concatenate([nlp.layout.problem.nominal, np.ones(NODES - 1)])
    guess = transcription(missile("SM2"), MultipleShooting(1), NODES).solve()
    z = np.hstack([guess.x, np.full((NODES, 1), guess.duration)])
    x_0 = nlp.layout.join(z, guess.u[:, 0], np.empty(0))
    solver = NumericalSolver(nlp, Options(backend, warm=True))
    first = solver.solve(x_0, known)
    elsewhere = solver.solve(1.1 * x_0, known, first.multipliers)
    again = solver.solve(x_0, known)
    assert first.ok
    assert elsewhere.iterations != again.iterations
    np.testing.assert_array_equal(first.x, again.x)
    np.testing.assert_array_equal(first.multipliers[1], again.multipliers[1])


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_an_answer_stays_as_it_was(backend: Backend) -> None:
    nlp = programme(growing(0.0), MultipleShooting(1), Fixed(), NODES)
    solver, known = NumericalSolver(nlp, Options(backend, iterations=2)), np.ones(NODES - 1)
    first = solver.solve(np.full(nlp.x.numel(), 0.25), known)
    kept = first.x.copy()
    assert not np.array_equal(solver.solve(np.full(nlp.x.numel(), 0.5), known).x, kept)
    np.testing.assert_array_equal(first.x, kept)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(backend: Backend, value: float) -> None:
    nlp = programme(missile("SM2"), MultipleShooting(1), Fixed(), NODES)
    solver = NumericalSolver(nlp, Options(backend))
    x_0, known = np.ones(nlp.x.numel()), np.ones(nlp.p.numel())
    x_0[3] = value
    answer = solver.solve(x_0, known)
    assert answer.status is SolverOutcome.NOT_FINITE
    assert not answer.ok


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_a_limit_of_iterations_is_a_status(backend: Backend) -> None:
    found = transcription(missile("SM2"), MultipleShooting(1), NODES, options=Options(backend, iterations=2)).solve()
    assert not found.ok
    assert found.iterations <= 3


def test_a_solve_that_does_not_return_is_ended_and_the_next_one_is_as_ever() -> None:
    options = Options("fatrop", iterations=50, seconds=0.1)
    good = transcription(growing(0.0), MultipleShooting(1), 6, options=options)
    before = good.solve()
    assert before.solved
    spent = PROCESS.cpu_seconds
    lost = transcription(growing(5.0), MultipleShooting(1), 6, options=options).solve()
    assert lost.status is SolverOutcome.LIMIT
    assert lost.message == "fatrop did not return within 0.1 s of CPU time"
    assert PROCESS.cpu_seconds == pytest.approx(spent + 0.1)
    after = good.solve()
    assert spent + 0.1 < PROCESS.cpu_seconds < spent + 0.2
    np.testing.assert_array_equal(after.x, before.x)
    assert (after.iterations, after.message) == (before.iterations, before.message)


def test_the_process_takes_no_module_of_the_current_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "casadi.py").write_text("raise SystemExit('not the library')", encoding="utf-8")
    PROCESS.close()
    monkeypatch.chdir(tmp_path)
    assert transcription(growing(0.0), MultipleShooting(1), 6, options=Options("fatrop")).solve().solved


def test_a_solver_whose_process_was_killed_says_so_and_starts_another() -> None:
    made = transcription(growing(0.0), MultipleShooting(1), 6, options=Options("fatrop"))
    assert made.solve().solved
    assert PROCESS._child is not None
    PROCESS._child.kill()
    PROCESS._child.wait()
    lost = made.solve()
    assert lost.status is SolverOutcome.FAILED
    assert "its process ended with -9" in lost.message
    assert made.solve().solved


def test_an_interrupted_solve_leaves_no_answer_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    made = transcription(growing(0.0), MultipleShooting(1), 6, options=Options("fatrop"))
    expected = made.solve()

    def interrupted(self: object, maxlength: int | None = None) -> bytes:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("multiprocessing.connection.Connection.recv_bytes", interrupted)
        with pytest.raises(KeyboardInterrupt):
            transcription(growing(0.1), MultipleShooting(1), 6, options=Options("fatrop")).solve()
    np.testing.assert_array_equal(made.solve().x, expected.x)


def test_ipopt_keeps_its_limit_of_time() -> None:
    found = transcription(missile("SM2"), MultipleShooting(1), NODES, options=Options(seconds=1e-6)).solve()
    assert found.status is SolverOutcome.LIMIT
    assert found.message == "Maximum_CpuTime_Exceeded"


def test_fatrop_refuses_a_scheme_that_is_not_explicit() -> None:
    with pytest.raises(ValueError, match=r"Hermite-Simpson.*allowed: forward Euler, multiple shooting"):
        transcription(missile("SM2"), HermiteSimpson(), NODES, options=Options("fatrop"))


def test_without_a_compiler_the_compiled_solver_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    nlp = programme(missile("SM2"), MultipleShooting(1), Fixed(), NODES)
    with pytest.raises(FileNotFoundError, match="no C compiler named cc"):
        NumericalSolver(nlp, Options("fatrop-compiled"))


@COMPILED
def test_a_programme_is_compiled_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    nlp = programme(missile("SM2"), MultipleShooting(1), Fixed(), 3)
    NumericalSolver(nlp, Options("fatrop-compiled"))
    (library,) = (tmp_path / "mathnavi").iterdir()
    made = library.stat().st_mtime_ns
    NumericalSolver(
        programme(missile("SM2"), MultipleShooting(1), Fixed(), 3), Options("fatrop-compiled", tolerance=1e-5)
    )
    assert [file.stat().st_mtime_ns for file in (tmp_path / "mathnavi").iterdir()] == [made]
