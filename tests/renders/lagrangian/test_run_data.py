"""A run is read as it was: errors in the metric, and estimates drawn so much farther off than they are."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.lagrangian.drawing import verdict
from mathnavi.renders.lagrangian.run_data import REACH, LagrangianRun, load_run
from mathnavi.sim.metrics.lagrangian import rms

ALL = ("body", "sphere", "hyperbolic-plane", "tracking", "arm", "cart", "differences")


@pytest.mark.parametrize("name", ALL)
def test_a_run_is_drawn_by_its_own_drawing_and_its_errors_are_the_summary_s(
    name: str, folders: dict[str, Path], runs: dict[str, LagrangianRun]
) -> None:
    assert drawing_of(folders[name]).cameras == ("panel", "scene")
    run = runs[name]
    late = run.errors.after(0.8)
    assert rms(run.velocity_error[late]) == pytest.approx(run.log.summary["velocity_rms"])
    assert rms(run.errors.position[late]) == pytest.approx(run.log.summary["position_rms"])


@pytest.mark.parametrize("name", ALL)
def test_an_estimate_is_drawn_its_magnification_times_as_far_off(name: str, runs: dict[str, LagrangianRun]) -> None:
    run, n = runs[name], runs[name].manifold.size
    for k in (2, 40, 299):
        error = run.manifold.coordinates(run.truth[k, :n], run.estimate[k, :n])
        drawn = run.manifold.coordinates(run.truth[k, :n], run.drawn(k))
        np.testing.assert_allclose(drawn, run.magnification * error, atol=1e-7 * run.magnification)
        np.testing.assert_allclose(run.towards(k, 0.0), run.truth[k, :n], atol=1e-9)


@pytest.mark.parametrize("name", ["body", "sphere", "hyperbolic-plane", "tracking", "thrown"])
def test_the_largest_error_is_drawn_as_large_as_may_be(name: str, runs: dict[str, LagrangianRun]) -> None:
    run = runs[name]
    apart = [run.apart(k) for k in range(len(run.t_estimate))]
    largest = run.magnification * max(float(np.abs(c).max()) for c in apart if c is not None)
    assert 0.35 * REACH < largest <= REACH
    assert f"{run.magnification:.0e}"[0] in "125"


def test_a_run_without_errors_or_with_great_ones_is_drawn_as_it_is(runs: dict[str, LagrangianRun]) -> None:
    run = runs["body"]
    assert replace(run, estimate=run.truth).magnification == 1.0
    assert replace(run, estimate=np.roll(run.estimate, 60, axis=0)).magnification == 1.0


@pytest.mark.parametrize("name", ["body", "sphere", "hyperbolic-plane", "arm"])
def test_the_estimated_velocity_is_that_moved_in_parallel_to_the_truth(
    name: str, runs: dict[str, LagrangianRun]
) -> None:
    run, n = runs[name], runs[name].manifold.size
    for k in (5, 250):
        moved = run.manifold.transport(run.estimate[k, :n], run.truth[k, :n], run.estimate[k, n:])
        np.testing.assert_allclose(run.velocity[1][k], moved, atol=1e-6)


def test_units_are_those_of_what_moves(runs: dict[str, LagrangianRun]) -> None:
    units = {name: run.unit for name, run in runs.items()}
    assert units == {
        "body": "rad/s", "sphere": "1/s", "hyperbolic-plane": "1/s", "silent": "rad/s", "tracking": "rad/s",
        "arm": "rad/s", "cart": "m/s, rad/s", "thrown": "rad/s", "differences": "rad/s",
    }  # fmt: skip


def test_what_never_was_read_has_no_estimate(runs: dict[str, LagrangianRun]) -> None:
    assert runs["silent"].belief(1.0) == -1
    assert runs["body"].belief(0.0) == 0


def test_a_reference_is_what_the_plan_in_force_says(runs: dict[str, LagrangianRun]) -> None:
    run = runs["tracking"]
    first = run.reference(0.0)
    assert first is not None
    np.testing.assert_allclose(first, [1.0, 0.0, 0.0, 0.0], atol=1e-9)
    later = run.reference(1.0)
    assert later is not None
    assert run.manifold.distance(first, later) > 0.05
    assert runs["body"].reference(1.0) is None
    assert runs["arm"].reference(1.0) is None


def test_a_run_that_diverged_is_drawn_up_to_its_last_finite_state(folders: dict[str, Path], tmp_path: Path) -> None:
    shutil.copytree(folders["body"], tmp_path / "run")
    path = tmp_path / "run" / "log.npz"
    arrays = dict(np.load(path))
    arrays["truth.x"][100:] = np.nan
    np.savez(path, **arrays)
    run = load_run(tmp_path / "run")
    assert len(run.t) == len(run.t_estimate) == len(run.errors.t) == 100
    assert verdict(run) == f"the motion diverged after {run.duration:.3g} s"
    arrays["truth.x"][1:] = np.nan
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match="is not finite"):
        load_run(tmp_path / "run")


def test_a_broken_run_is_refused(folders: dict[str, Path], tmp_path: Path) -> None:
    shutil.copytree(folders["body"], tmp_path / "run")
    path = tmp_path / "run" / "config.json"
    config = json.loads(path.read_text())
    for mission in ({"states": ["x_1"], "space": "body"}, {**config["mission"], "space": "cube"}, {}):
        path.write_text(json.dumps({**config, "mission": mission}))
        with pytest.raises(ValueError, match="does not hold the run of a Lagrangian system"):
            load_run(tmp_path / "run")
