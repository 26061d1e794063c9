"""The measures of the study of monitor functions."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problems.bryson_ho import bryson_denham
from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.studies.nodes.monitor_comparison import (
    BOOKS,
    FAILED,
    MONITORS,
    NAMES,
    NO_MISS,
    RADAU,
    SCHEMES,
    _claim,
    _claim_of_schemes,
    _figure,
    monitor_rows,
)


def test_every_problem_is_known() -> None:
    assert set(NAMES) <= BOOKS.keys()


@pytest.mark.parametrize("monitor", MONITORS, ids=lambda monitor: monitor.name)
def test_every_monitor_function_is_finite_and_positive(monitor: object) -> None:
    for problem in (missile("FAST"), bryson_denham()):
        solution = solve(problem, 12)
        w = monitor.density(solution, np.linspace(0.0, 1.0, 501), monitor.epsilon)  # type: ignore[attr-defined]
        assert w.shape == (501,)
        assert np.isfinite(w).all()
        assert (w > 0.0).all()


def test_the_uniform_monitor_function_changes_nothing() -> None:
    keys = ("transcription", "monitor", "redistributions")
    rows = {tuple(row[key] for key in keys): row for row in monitor_rows("missile, FAST", 12, 61)}
    for scheme in SCHEMES:
        for rounds in (1, 3):
            assert rows[scheme.name, "uniform", rounds]["control_error_ratio"] == pytest.approx(1.0, rel=1e-3)
            assert rows[scheme.name, "local error", rounds]["control_error_ratio"] < 0.5
        assert rows[scheme.name, "uniform grid", 0]["control_error_ratio"] == 1.0


def test_a_figure_says_why_a_ratio_is_not_there() -> None:
    nan = float("nan")
    ratios = {"linear": (0.5, nan), "unsolved": (nan, nan), "known": (0.5, 0.25)}
    rows = [
        {"problem": name, "transcription": scheme.name, "monitor": monitor.name, "redistributions": rounds,
         "control_error_ratio": error, "replay_miss_ratio": miss}
        for name, (error, miss) in ratios.items() for scheme in SCHEMES for monitor in MONITORS for rounds in (1, 3)
    ]  # fmt: skip
    figure = _figure(rows, list(ratios), 20)
    for errors, misses in ((0, 2), (4, 5)):
        of_errors, of_misses = ({text.get_text() for text in figure.axes[k].texts} for k in (errors, misses))
        assert of_errors == {"0.5", FAILED}
        assert of_misses == {NO_MISS, FAILED, "0.25"}
    assert RADAU.name.split()[0] in figure.axes[4].get_title(loc="left")
    assert NO_MISS in figure.get_supxlabel()


def test_a_miss_that_is_rounding_has_no_ratio() -> None:
    rows = monitor_rows("Bryson-Denham", 10, 61)
    assert all(np.isnan(row["replay_miss_ratio"]) for row in rows)
    assert all(np.isfinite(row["control_error_ratio"]) for row in rows)


@pytest.mark.parametrize(("arclength", "holds"), [(0.1, True), (0.9, False), (float("nan"), False)])
def test_the_claim_holds_only_where_arclength_is_the_least_everywhere(arclength: float, holds: bool) -> None:
    rows = [
        {"problem": name, "transcription": SCHEMES[0].name, "monitor": monitor.name, "redistributions": 3,
         "control_error_ratio": arclength if monitor.name == "arclength" and name == "second" else
         0.1 if monitor.name == "arclength" else 0.5}
        for name in ("first", "second")
        for monitor in MONITORS
    ]  # fmt: skip
    assert _claim(rows, ("first", "second")).holds is holds


def test_where_no_monitor_function_led_to_a_solution_none_is_the_best() -> None:
    rows = [
        {"problem": "first", "transcription": scheme.name, "monitor": monitor.name, "redistributions": 3,
         "control_error_ratio": float("nan")}
        for scheme in SCHEMES for monitor in MONITORS
    ]  # fmt: skip
    assert not _claim(rows, ("first",)).holds
    assert not _claim_of_schemes(rows).holds


@pytest.mark.parametrize(("curvature", "holds"), [(0.3, True), (0.1, False)])
def test_the_best_by_one_scheme_may_not_be_the_best_by_another(curvature: float, holds: bool) -> None:
    rows = [
        {"problem": "first", "transcription": scheme.name, "monitor": monitor.name, "redistributions": 3,
         "control_error_ratio": 0.2 if monitor.name == "residual" else
         curvature if monitor.name == "curvature" and scheme is RADAU else 0.5}
        for scheme in SCHEMES for monitor in MONITORS
    ]  # fmt: skip
    claim = _claim_of_schemes(rows)
    assert claim.holds is holds
    assert f"{'residual' if holds else 'curvature'} by {RADAU.name}" in claim.measured
