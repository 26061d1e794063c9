"""The library's optima are those that two independent methods find; the quick part."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from benchmarks.ocp_references.__main__ import AGREEMENT, CLOSED_FORMS, KNOWN, Agreement, Arguments, agreement, main
from benchmarks.ocp_references.chains import CHAINS
from benchmarks.ocp_references.collocation import Arc, NoReferenceError, coefficients, collocate, gauss, radau
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.interfaces.errors import FieldError


def test_every_problem_has_its_computation() -> None:
    assert set(CHAINS) == set(KNOWN)
    assert set(CLOSED_FORMS) <= set(CHAINS)


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_the_library_has_what_is_known_on_paper(name: str) -> None:
    known = KNOWN[name]
    assert known.error(known.sign * CLOSED_FORMS[name]()) < AGREEMENT


@pytest.mark.parametrize("name", ["lunar landing", "singular regulator"])
def test_two_computations_agree(name: str) -> None:
    assert agreement(name).holds


def test_what_does_not_agree_is_named(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(Arguments(("target line",))) == 0
    monkeypatch.setitem(CLOSED_FORMS, "target line", lambda: 0.2143)
    assert main(Arguments(("target line",))) == 1
    assert "do not agree to 1e-07: target line" in capsys.readouterr().out


def test_a_library_value_that_neither_method_finds_is_an_error() -> None:
    wrong = Agreement("target line", ("a", "b"), (0.2143, 0.2143))
    assert wrong.difference == 0.0
    assert not wrong.holds


def test_an_unknown_problem_is_named() -> None:
    with pytest.raises(FieldError, match="problems: 'nothing'"):
        Arguments(("nothing",))


@pytest.mark.parametrize("points", [radau(4), gauss(4)])
def test_coefficients_integrate_polynomials(points: np.ndarray) -> None:
    A, b = coefficients(points)
    for power in range(4):
        assert A @ points**power == pytest.approx(points ** (power + 1) / (power + 1))
    for power in range(len(points) * 2 - 1):
        assert b @ points**power == pytest.approx(1.0 / (power + 1))
    assert coefficients(radau(4))[0][-1] == pytest.approx(coefficients(radau(4))[1])


def test_what_does_not_converge_says_so() -> None:
    ocp = OptimalControlProblem("nowhere")
    x, u = ocp.state("x"), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(1.0)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 2.0)
    with pytest.raises(NoReferenceError, match="nowhere"):
        collocate(ocp.functions(), [Arc(1.0, intervals=2)], radau(2))


def test_an_arc_begins_where_its_entry_vanishes() -> None:
    ocp = OptimalControlProblem("entry")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 0.0)
    arcs = [Arc(0.5), Arc(0.5, entry=lambda state, t: ca.SX(state - 1.0))]
    assert collocate(ocp.functions(), arcs, gauss(2), moving=False).cost == pytest.approx(4.0)
