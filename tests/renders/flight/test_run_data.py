"""Reading a run's folder, and the error when it cannot be read."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders.flight.run_data import FlightRun, load_run
from mathnavi.renders.scene.landscape import plan_pieces


def test_state_agrees_with_the_log_at_every_tick_and_stays_at_its_ends(run: FlightRun) -> None:
    for i in (0, 1, len(run.t) // 2, len(run.t) - 1):
        np.testing.assert_allclose(run.state(float(run.t[i])), run.x[i], atol=1e-9)
    np.testing.assert_array_equal(run.state(run.duration + 5.0), run.x[-1])
    between = run.state(float(0.5 * (run.t[10] + run.t[11])))
    np.testing.assert_allclose(between, 0.5 * (run.x[10] + run.x[11]), atol=1e-6)


def test_plan_is_the_last_one_adopted(run: FlightRun) -> None:
    assert run.plan(-0.1) is None
    assert run.plan(float(run.log.adopted[3])) is run.log.plans[3]
    assert run.plan(float(run.log.adopted[3]) - 1e-3) is run.log.plans[2]


def test_what_is_left_of_a_plan_starts_now_and_ends_at_rest_on_its_last_state(run: FlightRun) -> None:
    plan = run.log.plans[2]
    now = plan.t_start + 2.0
    pieces = plan_pieces(plan, now)
    (_, (times, places)), (_, (_, last)) = pieces[0], pieces[-1]
    assert times[0] == now
    np.testing.assert_allclose(places[0], run.state(now)[:3], atol=60.0)  # the made-up arcs follow the path roughly
    np.testing.assert_allclose(last[-1], plan.x[-1, :3], atol=1e-6)
    assert plan_pieces(plan, plan.t_end) == []


def test_missing_folder_and_missing_files_are_named(run_dir: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        load_run(tmp_path / "nowhere")
    for name in ("config.json", "summary.json", "events.jsonl", "log.npz"):
        copy = shutil.copytree(run_dir, tmp_path / name)
        (copy / name).unlink()
        with pytest.raises(FileNotFoundError, match=name):
            load_run(copy)


@pytest.mark.parametrize("name", ["config.json", "summary.json", "events.jsonl", "log.npz"])
def test_truncated_file_is_a_value_error_that_names_it(name: str, run_dir: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(run_dir, tmp_path / "run")
    content = (copy / name).read_bytes()
    (copy / name).write_bytes(content[: len(content) // 2])
    with pytest.raises(ValueError, match=name):
        load_run(copy)


def test_config_without_a_mission_and_changed_terrain_are_refused(run_dir: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(run_dir, tmp_path / "run")
    config = json.loads((copy / "config.json").read_text())
    (copy / "config.json").write_text(json.dumps({k: v for k, v in config.items() if k != "mission"}))
    with pytest.raises(ValueError, match="mission"):
        load_run(copy)
    config["terrain"]["digest"] = "0" * 64
    (copy / "config.json").write_text(json.dumps(config))
    with pytest.raises(ValueError, match="no longer the one"):
        load_run(copy)


def test_arrays_of_unequal_length_and_fleets_are_refused(run_dir: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(run_dir, tmp_path / "run")
    with np.load(copy / "log.npz") as log:
        arrays = dict(log)
    np.savez(copy / "log.npz", **(arrays | {"command.u": arrays["command.u"][:-5]}))
    with pytest.raises(ValueError, match=r"command\.u"):
        load_run(copy)
    fleet = {f"alpha.{name}" if name != "t" else name: value for name, value in arrays.items()}
    np.savez(copy / "log.npz", **fleet)
    with pytest.raises(ValueError, match="single vehicle"):
        load_run(copy)
