"""A store as Parquet has the cells of its CSV, with their types."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import pyarrow.parquet
import pytest

from mathnavi.commands.cli import main
from mathnavi.sim.records.store import Store
from tests.sim.records.test_store import record

RECORDS = (
    record("a"),
    record("b", seed=8, success=False, code="2+def"),
    record("c", seed=9, status="timed-out", success=None, summary={}, timings={}),
    record("d", scenario="my_own:Steep", seed=2**62, summary={"path_m": 1, "odd": "text"}),
)


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    with Store.open(tmp_path / "trials.db") as store:
        store.add(*RECORDS)
    return "trials.db"


def test_parquet_has_the_cells_of_csv_with_their_types(store: str) -> None:
    for out in ("table.parquet", "table.csv"):
        assert main(["store", "export", store, "--out", out]) == 0
    rows = list(csv.DictReader(Path("table.csv").read_text(encoding="utf-8").splitlines()))
    columns = pyarrow.parquet.read_table("table.parquet").to_pydict()
    assert list(columns) == list(rows[0])
    assert all(len(values) == len(rows) == len(RECORDS) for values in columns.values())
    assert columns["seed"] == [7, 8, 9, 2**62]
    assert columns["success"] == [True, False, None, True]
    assert columns["path_m"] == [12.5, 12.5, None, 1.0]
    assert columns["start"] == ["[1.0,2.0]"] * 4
    assert columns["least_m"][0] == float("-inf")
    assert columns["odd"] == [None, None, None, "text"]


def test_a_missing_package_is_named_with_its_extra(
    store: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in [name for name in sys.modules if name.startswith("pyarrow.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["store", "export", store, "--out", "table.parquet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        "Parquet needs the package pyarrow, which is not installed; allowed after pip install 'mathnavi[parquet]'"
        in line
    )
    assert [path.name for path in Path().iterdir()] == [store]


@pytest.mark.parametrize("out", ["nowhere/table.csv", ".", "table.xls"])
def test_a_place_that_cannot_be_written_is_named_and_nothing_changes(
    out: str, store: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["store", "export", store, "--out", out]) == 2
    assert capsys.readouterr().err.startswith(f"mathnavi: --out = {out}")
    assert [path.name for path in Path().iterdir()] == [store]
