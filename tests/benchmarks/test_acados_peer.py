"""acados solves the same swing-up where it can be had, and is left out with one line where not."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks import acados_peer
from benchmarks.acados_cart_pole import CART, FORCE, GRAVITY, LENGTH, POLE
from benchmarks.acados_wheel import FOLDER, missing
from mathnavi.controllers.ocp.problems import articles
from mathnavi.controllers.ocp.problems.library import PROBLEMS


def test_it_is_left_out_with_one_line_where_it_is_not_installed(tmp_path: Path) -> None:
    console = Console(file=io.StringIO(), width=300)
    findings = acados_peer.run(acados_peer.Arguments(folder=tmp_path), console)
    assert findings.comparisons() == []
    assert console.file.getvalue().count("\n") == 1  # type: ignore[attr-defined]
    assert "acados is left out: it is not installed" in console.file.getvalue()  # type: ignore[attr-defined]


def test_the_figures_are_those_of_the_library() -> None:
    assert (CART, POLE) == (articles.CART_MASS, articles.POLE_MASS)
    assert (LENGTH, GRAVITY) == (articles.POLE_LENGTH, articles.GRAVITY)
    assert PROBLEMS["cart-pole"].problem().control_bounds.upper.tolist() == [FORCE]


def test_acados_solves_the_same_problem() -> None:
    if reason := missing(FOLDER):
        pytest.skip(f"acados: {reason}")
    attempt, iterations = acados_peer.solved(FOLDER, 40, 1)
    assert attempt.accuracy < 2e-2  # a control held on 40 intervals
    assert iterations.failures < iterations.count
