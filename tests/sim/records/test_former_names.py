"""Run folders that name modules by their former places are drawn, run again, estimated over and compared."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.renders.drawing import drawing_of
from mathnavi.sim.commands.cli import main
from mathnavi.sim.commands.run_config import RunConfig
from mathnavi.sim.records.former_names import MOVED, present_name, with_present_names

ROOT = Path(__file__).resolve().parents[3]
POINTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
PLACES = [place for kind in ("controllers", "estimators", "consensus") for place in POINTS[f"mathnavi.{kind}"].values()]


def formerly(place: str) -> str:
    """The former name of a place: by the table, or without the name of the package."""
    return {now: before for before, now in MOVED.items()}.get(place, place.removeprefix("mathnavi."))


@pytest.fixture(scope="module")
def old(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run's folder with the former names in its config.json."""
    folder = tmp_path_factory.mktemp("before") / "run"
    mn.run("range-localisation", seed=1, duration=1.0).save(folder)
    path = folder / "config.json"
    config = json.loads(path.read_text(encoding="utf-8"))
    config["drawing"] = formerly(config["drawing"])
    for kind in ("controller", "estimator"):
        config[kind]["name"] = formerly(config[kind]["name"])
    path.write_text(json.dumps(config), encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    assert '"controllers.exciting.plugin:Exciting"' in text
    assert '"estimators.ranging.feasible_set_bank:FeasibleSetBank"' in text
    assert '"renders.ranging.drawing"' in text
    assert "mathnavi." not in text
    return folder


@pytest.mark.parametrize("place", PLACES)
def test_every_plug_in_is_found_by_its_former_place_and_by_its_present_one(place: str) -> None:
    assert present_name(formerly(place)) == present_name(place) == place


@pytest.mark.parametrize(
    "place", ["controllers.mine:Planner", "models.own.thing:Thing", "ridgeline.controller:Roadmap", "my_planner:Mine"]
)
def test_a_users_own_place_stays(place: str) -> None:
    assert present_name(place) == place


def test_a_configuration_without_plug_ins_stays() -> None:
    assert with_present_names({"scenario": "s", "controller": None}) == {"scenario": "s", "controller": None}


def test_a_field_is_read_under_its_present_name(tmp_path: Path) -> None:
    plugins = {"controller": {"name": "missile"}, "estimator": {"name": "full_state"}}
    config = {"scenario": "missile-guidance", "seed": 1, "fields": {"target_told": 0.5, "case": "FAST"}, **plugins}
    (tmp_path / "config.json").write_text(json.dumps(config), encoding="utf-8")
    fields = {"target_announcement_delay": 0.5, "case": "FAST"}
    assert RunConfig.read(tmp_path).fields == with_present_names(config)["fields"] == fields


def test_it_is_read_with_the_present_names(old: Path) -> None:
    config = mn.load(old).config
    assert config["controller"]["name"] == "mathnavi.controllers.active_sensing.plugin:ActiveSensing"
    assert config["drawing"] == "mathnavi.renders.ranging.drawing"
    assert drawing_of(old).cameras


def test_it_is_run_again_bit_for_bit(old: Path, tmp_path: Path) -> None:
    assert main(["run", "--from", str(old), "--out", str(tmp_path / "again")]) in (0, 1)
    one, other = mn.load(old), mn.load(tmp_path / "again")
    assert list(one.arrays) == list(other.arrays)
    for name, rows in one.arrays.items():
        np.testing.assert_array_equal(rows, other[name])


def test_an_estimator_runs_over_it(old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "range_ekf", str(old), "--out", str(tmp_path / "again")]) in (0, 1)
    assert "recorded: feasible_set_bank" in capsys.readouterr().out


def test_it_is_compared_and_drawn(old: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(old, tmp_path / "copy")
    assert main(["compare", str(old), str(copy), "--out", str(tmp_path / "page.html")]) == 0
    assert (
        "FeasibleSetBank" not in mn.load(copy).report(tmp_path / "report.html").read_text().partition("config.json")[0]
    )
