"""An exported RO-Crate, read back by rocrate: each action names the software, the configuration and the tables."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from rocrate.rocrate import ROCrate

from mathnavi.sim.commands.cli import main
from mathnavi.sim.records.crate import PROFILE
from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.origins import Origin
from mathnavi.sim.records.store import STUDY_STORE, Store
from tests.sim.records.test_store import record

JOB = JobRecord("j", "package.module:function", '{"n":3}', 0, "1+abc", "ok", '{"found":2.5}', timings={"wall_s": 0.1})
RECORDS = (
    record("a"),
    record("b", seed=8, success=False, code="2+def"),
    record("c", seed=9, status="timed-out", success=None, summary={}, timings={}),
    record("d", scenario="my_own:Steep", seed=2**62, summary={"path_m": 1, "odd": "text"}),
)


@pytest.fixture
def store(tmp_path: Path) -> Path:
    path = tmp_path / STUDY_STORE
    with Store.open(path) as store:
        store.add(*RECORDS, JOB)
    return path


@pytest.fixture
def export(store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    def write(*flags: str) -> ROCrate:
        assert main(["store", "export", str(store), "--out", str(tmp_path / "crate"), "--crate", *flags]) == 0
        return ROCrate(tmp_path / "crate")

    return write


def ids(entity: Any, name: str) -> list[str]:
    values = entity.get(name)
    return [each.id for each in (values if isinstance(values, list) else [values])]


def test_every_record_is_the_result_of_an_action_of_the_software_that_made_it(export: Any, tmp_path: Path) -> None:
    crate = export("--licence", "CC-BY-4.0")
    assert crate.root_dataset["conformsTo"].id == PROFILE
    assert crate.root_dataset["license"].id == "https://spdx.org/licenses/CC-BY-4.0"
    assert crate.name
    assert crate.description.startswith("4 trials and 1 other")
    actions = crate.root_dataset["mentions"]
    assert [action.type for action in actions] == ["CreateAction"] * 4
    made = {action["name"]: action for action in actions}
    assert set(made) == {
        "2 runs of flat",
        "1 runs of flat",
        "1 runs of my_own:Steep",
        "1 runs of package.module:function",
    }
    for name, action in made.items():
        tables = ["jobs.csv"] if "function" in name else ["trials.csv", "trials.jsonl"]
        assert ids(action, "result") == tables
        assert action["instrument"].type == "SoftwareApplication"
        assert action["endTime"]
        configuration = json.loads((tmp_path / "crate" / action["object"].id).read_text(encoding="utf-8"))
        assert configuration["code"] == action["instrument"]["softwareVersion"]
        assert name.endswith(configuration.get("scenario") or configuration["function"])
    assert made["1 runs of flat"]["instrument"]["softwareVersion"] == "2+def"
    assert made["2 runs of flat"]["description"] == "1 did what they should, 1 timed-out"


def test_the_configuration_says_what_was_the_same_and_what_varied(export: Any, store: Path, tmp_path: Path) -> None:
    other = {**RECORDS[0].parameters, "config": {**RECORDS[0].parameters["config"], "start": [3.0, 4.0]}}
    with Store.open(store) as opened:
        opened.add(record("e", seed=11, parameters={**other, "inputs": {"mechanism": "sha256:12"}}))
    export()
    found = json.loads((tmp_path / "crate" / "configuration" / "1-flat.json").read_text(encoding="utf-8"))
    assert found["seeds"] == [7, 9, 11]
    assert found["varied"] == ["start"]
    assert found["fields"]["planner.nodes"] == 3
    assert found["files"] == {"mechanism": ["sha256:12"]}


def test_the_computing_environments_of_the_tables_are_described(export: Any, store: Path, tmp_path: Path) -> None:
    made = [Origin("one", {"numpy": "2.4"}), Origin("two", {"numpy": "2.5"})]
    with Store.open(store) as opened:
        opened.add(*(record(f"made-{k}", seed=20 + k, origin=origin) for k, origin in enumerate(made)))
    export()
    described = json.loads((tmp_path / "crate" / "environments.json").read_text())
    assert described == {origin.digest: origin.environment for origin in made}
    with (tmp_path / "crate" / "trials.csv").open(newline="") as file:
        assert {row["environment"] for row in csv.DictReader(file)} == {*described, ""}


def test_every_file_is_in_the_crate_with_its_digest(export: Any, tmp_path: Path) -> None:
    crate = export("--parquet")
    files = {entity.id: entity for entity in crate.data_entities}
    folder = tmp_path / "crate"
    assert set(files) == {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "ro-crate-metadata.json"
    }
    for name, entity in files.items():
        content = (folder / name).read_bytes()
        assert entity["sha256"] == hashlib.sha256(content).hexdigest()
        assert entity["contentSize"] == str(len(content))
        assert "/" in entity["encodingFormat"]


def test_a_study_is_an_action_from_the_tables_to_its_files(export: Any, tmp_path: Path) -> None:
    document = {"study": "noise", "title": "Noise", "claims": [], "command": "mathnavi study noise"}
    (tmp_path / "noise.json").write_text(json.dumps(document), encoding="utf-8")
    for ending in ("csv", "png", "html"):
        (tmp_path / f"noise.{ending}").write_text("drawn", encoding="utf-8")
    (tmp_path / "other.json").write_text("[1, 2]", encoding="utf-8")
    (tmp_path / "broken.json").write_text("{", encoding="utf-8")
    crate = export()
    action = crate.dereference("#study-noise")
    assert action["description"] == "mathnavi study noise"
    assert set(ids(action, "object")) == {"trials.csv", "trials.jsonl", "jobs.csv"}
    assert set(ids(action, "result")) == {f"studies/noise.{ending}" for ending in ("json", "csv", "png", "html")}
    assert not (tmp_path / "crate" / "studies" / "other.json").exists()


def test_the_files_beside_a_sweeps_store_are_no_study_of_it(store: Path, tmp_path: Path) -> None:
    document = {"study": "noise", "title": "Noise", "claims": []}
    (tmp_path / "noise.json").write_text(json.dumps(document), encoding="utf-8")
    sweep = store.rename(tmp_path / "sweep.db")
    assert main(["store", "export", str(sweep), "--out", str(tmp_path / "crate"), "--crate"]) == 0
    assert ROCrate(tmp_path / "crate").dereference("#study-noise") is None


def test_an_empty_store_makes_a_crate_without_an_action(tmp_path: Path) -> None:
    Store.open(tmp_path / "empty.db").close()
    assert main(["store", "export", str(tmp_path / "empty.db"), "--out", str(tmp_path / "crate"), "--crate"]) == 0
    crate = ROCrate(tmp_path / "crate")
    assert not crate.get_by_type("CreateAction")
    assert crate.root_dataset["license"]["name"] == "not stated"


def test_the_same_store_makes_the_same_crate(export: Any, store: Path, tmp_path: Path) -> None:
    export("--parquet")
    words = ["store", "export", str(store), "--out", str(tmp_path / "again"), "--crate", "--parquet"]
    assert main(words) == 0
    first, again = (
        {path.name: path.read_bytes() for path in (tmp_path / name).rglob("*") if path.is_file()}
        for name in ("crate", "again")
    )
    assert first == again


def test_parquet_has_the_cells_of_csv_with_their_types(export: Any, store: Path, tmp_path: Path) -> None:
    export("--parquet")
    assert main(["store", "export", str(store), "--out", str(tmp_path / "table.parquet")]) == 0
    for table, lines in (("crate/trials.parquet", 4), ("table.parquet", 4), ("crate/jobs.parquet", 1)):
        text = (tmp_path / "crate" / ("jobs.csv" if "jobs" in table else "trials.csv")).read_text(encoding="utf-8")
        rows = list(csv.DictReader(text.splitlines()))
        columns = pyarrow.parquet.read_table(tmp_path / table).to_pydict()
        assert list(columns) == list(rows[0])
        assert all(len(values) == lines for values in columns.values())
    columns = pyarrow.parquet.read_table(tmp_path / "table.parquet").to_pydict()
    assert columns["seed"] == [7, 8, 9, 2**62]
    assert columns["success"] == [True, False, None, True]
    assert columns["path_m"] == [12.5, 12.5, None, 1.0]
    assert columns["start"] == ["[1.0,2.0]"] * 4
    assert columns["least_m"][0] == float("-inf")
    assert columns["odd"] == [None, None, None, "text"]


@pytest.mark.parametrize(
    ("missing", "words", "advice"),
    [
        ("rocrate", "--out crate --crate", "--crate needs the package rocrate, .*'mathnavi.crate.'"),
        (
            "pyarrow",
            "--out crate --crate --parquet",
            "--parquet needs the package pyarrow, .*'mathnavi.parquet.'",
        ),
        ("pyarrow", "--out table.parquet", "Parquet needs the package pyarrow"),
    ],
)
def test_a_missing_package_is_named_with_its_extra(
    missing: str,
    words: str,
    advice: str,
    store: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for module in [name for name in sys.modules if name.startswith(f"{missing}.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.chdir(tmp_path)
    assert main(["store", "export", store.name, *words.split()]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert re.search(advice, err)
    assert [path.name for path in tmp_path.iterdir()] == [store.name]


def test_a_crate_is_written_into_a_new_folder_only(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine", encoding="utf-8")
    before = sorted(tmp_path.rglob("*"))
    for out in ("full", "nowhere/crate", ".", store.name):
        assert main(["store", "export", store.name, "--out", out, "--crate"]) == 2
        assert capsys.readouterr().err.startswith(f"mathnavi: --out = {out}")
    for flags in ("--parquet", "--licence MIT"):
        assert main(["store", "export", store.name, "--out", "t.csv", *flags.split()]) == 2
        assert "allowed: only together with --crate" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before
