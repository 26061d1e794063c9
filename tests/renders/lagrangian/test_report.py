"""The report of a run of Paper D stands alone and has a figure of every recorded quantity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders.lagrangian.panel import with_unit
from mathnavi.renders.lagrangian.report import lyapunov_figure, report
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS
from tests.renders.reading import Page, check_stands_alone, checked_report

UNGROUPED = {"seed", "version", "real_time_factor", "shortfall"}


@pytest.fixture(autouse=True)
def no_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")


def test_the_report_stands_alone_and_shows_every_figure(
    folders: dict[str, Path], runs: dict[str, LagrangianRun]
) -> None:
    _, page = checked_report(folders["tracking"])
    assert "No picture of the scene: MUJOCO_GL = disable switches drawing off" in page.text
    assert "Velocity found" in page.text
    for title in ("Velocity: at the start", "Errors: at the start", "Inputs, and the innovation"):
        assert title in page.words
    assert "angle to the reference, RMS once settled" in page.words
    assert "Lyapunov functions: at the start" in page.words


def test_only_the_observer_has_lyapunov_functions(runs: dict[str, LagrangianRun]) -> None:
    words = Page(report(runs["differences"])).words
    assert "Velocity: at the start" in words
    assert "Lyapunov functions: at the start" not in words
    assert "Inputs" in words


def test_a_run_without_an_estimate_is_reported_too(runs: dict[str, LagrangianRun]) -> None:
    source = report(runs["silent"])
    check_stands_alone(source)
    assert "Velocity not found" in Page(source).text


def test_the_lyapunov_functions_are_those_of_the_gain_of_the_observer(runs: dict[str, LagrangianRun]) -> None:
    run = runs["hyperbolic-plane"]
    B = run.lyapunov_gain
    assert B == 100.0
    V, W = lyapunov_figure(run, B).axes[1].lines
    half = 0.5 * np.square(run.errors.norm)
    np.testing.assert_allclose(V.get_ydata(), half + 0.5 * B * np.square(run.errors.position), rtol=1e-6)
    assert (np.diff(W.get_ydata()[:50]) < 0.0).mean() > 0.9  # where noise is not all there is


@pytest.mark.parametrize("name", ["body", "sphere", "tracking", "arm", "cart"])
def test_every_figure_of_the_summary_has_its_group(name: str, runs: dict[str, LagrangianRun]) -> None:
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    assert set(runs[name].log.summary) - UNGROUPED <= grouped


def test_names_have_their_letters_and_units() -> None:
    assert with_unit("body_rate_x [rad/s]") == r"$\omega_{x}$ [rad/s]"
    assert with_unit("velocity_1 [1/s]") == "$v_{1}$ [1/s]"
    assert with_unit("velocity_joint_1 [rad/s]") == "joint 1 [rad/s]"
    assert with_unit("position_0 [-]") == "$p_{0}$"
    assert with_unit("torque_z [N m]") == r"$\tau_{z}$ [N m]"
