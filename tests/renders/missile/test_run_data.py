"""The data of a missile's pictures agree with the flight."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.missile.drawing import drawing
from mathnavi.renders.missile.run_data import MissileRun, load_run
from mathnavi.sim.plugin.trust import trusting


def test_the_world_has_z_up_and_the_path_ends_on_the_target(missile_run: MissileRun) -> None:
    assert missile_run.path[0].tolist() == [0.0, 0.0, 10.0]
    assert missile_run.path[:, 2].max() > 100.0
    end = missile_run.approach
    np.testing.assert_allclose(missile_run.target_at(end.t), missile_run.path[-1], atol=0.5)
    assert missile_run.target_velocity(1.0)[0] == 15.0
    assert missile_run.target_velocity(4.0)[0] == -15.0
    assert end.miss == pytest.approx(missile_run.log.summary["miss_m"], abs=1e-9)


def test_between_two_control_steps_it_is_between_their_places(missile_run: MissileRun) -> None:
    i, t = 100, missile_run.t
    np.testing.assert_allclose(missile_run.joints(float(t[i])), missile_run.log.x[i], atol=1e-12)
    middle = missile_run.joints(float(0.5 * (t[i] + t[i + 1])))
    np.testing.assert_allclose(middle, 0.5 * (missile_run.log.x[i] + missile_run.log.x[i + 1]), atol=1e-9)
    np.testing.assert_array_equal(missile_run.joints(1e3), missile_run.log.x[-1])


def test_the_reference_is_what_was_flown_nearly(missile_run: MissileRun, spatial_run: MissileRun) -> None:
    for run in (missile_run, spatial_run):
        error = run.coordinates.place(run.x) - run.coordinates.place(run.reference)
        assert np.nanmax(np.abs(error)) < 0.1
        assert not np.isnan(run.reference).any()


def test_the_plan_ahead_leads_from_here_to_where_the_target_will_be(missile_run: MissileRun) -> None:
    ahead = missile_run.plan_ahead(5.0, 30)
    np.testing.assert_allclose(ahead[0], missile_run.path[missile_run.index(5.0)], atol=0.1)
    np.testing.assert_allclose(ahead[-1], missile_run.target_at(missile_run.approach.t), atol=0.5)
    assert missile_run.plan_ahead(missile_run.duration + 1.0, 30).shape == (0, 3)


def test_a_run_says_by_whom_it_is_drawn(missile_dir: Path, run_dir: Path, tmp_path: Path) -> None:
    assert drawing_of(missile_dir).cameras == drawing.cameras == ("chase", "side", "target")
    assert drawing_of(run_dir).cameras == ("chase", "overview", "top")  # as flights are that say nothing
    for name, message in (
        ("renders.nowhere", "cannot be"),
        ("math", "lacks `drawing`; allowed: a module in which"),
        ("", "cannot be"),
    ):
        (tmp_path / "config.json").write_text(json.dumps({"scenario": "safe-flight", "seed": 0, "drawing": name}))
        with trusting(), pytest.raises(ValueError, match=message):
            drawing_of(tmp_path)


def test_what_does_not_describe_a_missile_is_refused(missile_dir: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(missile_dir, tmp_path / "run")
    config = json.loads((copy / "config.json").read_text())
    for mission in ({}, config["mission"] | {"dimension": "flat"}):
        (copy / "config.json").write_text(json.dumps(config | {"mission": mission}))
        with pytest.raises(ValueError, match=r"config\.json.* does not describe a missile"):
            load_run(copy)
    (copy / "config.json").write_text(json.dumps(config | {"mission": config["mission"] | {"dimension": "spatial"}}))
    with pytest.raises(ValueError, match=r"log\.npz.*spatial flight"):
        load_run(copy)
