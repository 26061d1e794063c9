"""The figure of a solution shows each state, control and constraint beside its multiplier, and the mesh."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mathnavi.controllers.ocp.figure import dense_times
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.bryson_ho import bryson_denham
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.low_order import MultipleShooting


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solve(bryson_denham(), 13)


@pytest.fixture(scope="module")
def limited() -> Solution:
    ocp = OptimalControlProblem("limited")
    x, v, u = ocp.state("r[0]"), ocp.state("r[1]"), ocp.control("u", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=3.0)
    ocp.minimise(terminal=T)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.constrain(v + u / 10, upper=0.8)
    for state, end in ((x, 2.0), (v, 0.0)):
        ocp.start(state, 0.0)
        ocp.end(state, end)
    return solve(ocp.functions(), 12, scheme=MultipleShooting())


def test_everything_is_drawn_beside_its_multiplier(solution: Solution, limited: Solution) -> None:
    def titles(drawn: Solution, *names: str) -> list[str]:
        return [axes.get_title(loc="left") for axes in drawn.plot(*names).axes]

    assert titles(solution) == [
        "x", "costate of x", "v", "costate of v", "u", "", "Hamiltonian", "error of each interval"
    ]  # fmt: skip
    assert titles(limited)[4:] == [
        "u", "multiplier of the bounds of u", "path 0", "multiplier of path 0", "Hamiltonian", "mesh: 12 nodes"
    ] or titles(limited)[6].startswith("(")  # fmt: skip
    assert titles(limited, "r")[:4] == ["r[0]", "costate of r[0]", "r[1]", "costate of r[1]"]
    assert titles(limited, "u")[:2] == ["u", "multiplier of the bounds of u"]
    with pytest.raises(KeyError, match="is not a state, control or path constraint"):
        solution.plot("y")


def test_curves_are_those_of_the_solution(solution: Solution) -> None:
    axes = solution.plot("x").axes
    curve, nodes, limit = axes[0].lines
    t, x = curve.get_data()
    assert np.array_equal(x, solution("x", np.asarray(t)))
    assert np.array_equal(nodes.get_xdata(), solution.t)
    assert np.allclose(np.asarray(nodes.get_ydata(), float), solution["x"], atol=1e-12)
    assert set(np.asarray(limit.get_ydata(), float)) == {1.0 / 9.0}
    (note,) = axes[1].texts
    assert (
        note.get_text()
        == f"bound: ∫ μ dt = {float((solution.multipliers.states['x'] * solution.point_shares).sum()):.4g}"
    )
    times, hamiltonian = axes[2].lines[0].get_data()
    assert np.array_equal(hamiltonian, solution.hamiltonian.ravel())
    assert np.array_equal(times, solution.point_times.ravel())


def test_a_jump_of_a_held_control_is_drawn_upright(limited: Solution) -> None:
    t = dense_times(limited.t)
    assert np.isin(limited.t, t).all()
    assert (np.diff(t) > 0.0).all()
    u = limited("u", t)
    changed = np.flatnonzero(np.diff(u))
    assert len(changed)
    assert np.diff(t)[changed].max() < 1e-8


def test_a_figure_is_written_as_a_picture(solution: Solution, tmp_path: Path) -> None:
    for ending, begins in ((".png", b"\x89PNG"), (".svg", b"<?xml")):
        path = tmp_path / f"figure{ending}"
        solution.plot("x", path=path)
        assert path.read_bytes().startswith(begins)
    with pytest.raises(ValueError, match=r"allowed: \.png, \.svg, \.pdf"):
        solution.plot(path=tmp_path / "figure.gif")
    assert not (tmp_path / "figure.gif").exists()


def test_a_failed_solution_is_drawn_too(solution: Solution) -> None:
    bare = replace(solution, replay=None, interval_errors=None)
    assert bare.plot().axes[-1].get_title(loc="left") == "mesh: 13 nodes"


def test_matplotlib_is_imported_only_to_draw() -> None:
    code = "import sys; import mathnavi.controllers.ocp.problems.library; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
