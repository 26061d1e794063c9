"""A store of a stranger is data: nothing that it names is run, imported or unpickled."""

from __future__ import annotations

import io
import json
import pickle
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.interfaces.errors import RunFolderError, TerrainError
from mathnavi.models.terrain.dem import read_npz
from mathnavi.sim.records.run_folder import ARRAYS, read_arrays
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.execution import run_jobs
from tests.sim.sweep.test_jobs import walks

EVIL = """
from dataclasses import dataclass
from pathlib import Path

Path({mark!r}).touch()

@dataclass
class Data:
    x: float = 0.0

def function(*_):
    Path({mark!r}).touch()
"""


class Bomb:
    """Its pickle makes a file when it is read."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.mark,)


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / f"evil_{tmp_path.name}.py").write_text(EVIL.format(mark=str(tmp_path / "executed")))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    return tmp_path / "executed"


def forge(path: Path, **columns: object) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        for name, value in columns.items():
            connection.execute(f"UPDATE jobs SET {name} = ?", (value,))


@pytest.mark.usefixtures("trials_here")
@pytest.mark.parametrize("tree", ['{"$class": "EVIL:Data", "$fields": {}}', '{"$enum": ["EVIL:Data", "x"]}'])
def test_the_result_of_a_job_imports_no_class_of_a_stranger(tree: str, mark: Path, tmp_path: Path) -> None:
    path = tmp_path / "store.db"
    with Store.open(path) as store:
        run_jobs(walks(1), store)
    forge(path, result=tree.replace("EVIL", f"evil_{tmp_path.name}"), arrays=None)
    with Store.open(path) as store:
        (record,) = run_jobs(walks(1), store)
        with pytest.raises(ValueError, match="not installed"):
            _ = record.value
    assert not mark.exists()


@pytest.mark.usefixtures("trials_here")
def test_the_function_that_a_store_names_is_not_called(mark: Path, tmp_path: Path) -> None:
    path = tmp_path / "store.db"
    with Store.open(path) as store:
        run_jobs(walks(1), store)
    forge(path, function=f"evil_{tmp_path.name}:function", status="crashed", result=None)
    with Store.open(path) as store:
        (record,) = run_jobs(walks(1), store, retry=True)
        assert record.value is not None
    for words in (["show", str(path)], ["export", str(path), "--out", str(tmp_path / "table.csv")]):
        assert main(["store", *words]) == 0
    assert not mark.exists()


@pytest.mark.usefixtures("trials_here")
def test_the_arrays_of_a_store_are_not_unpickled(mark: Path, tmp_path: Path) -> None:
    path, block = tmp_path / "store.db", io.BytesIO()
    np.savez(block, a0=np.array([Bomb(mark)], dtype=object))
    with Store.open(path) as store:
        run_jobs(walks(1), store)
    for arrays in (block.getvalue(), pickle.dumps(Bomb(mark))):
        forge(path, result='{"$block": "a0"}', arrays=arrays)
        with Store.open(path) as store, pytest.raises(ValueError, match=r"type object|not a readable"):
            _ = run_jobs(walks(1), store)[0].value
    assert not mark.exists()


def test_the_arrays_of_a_run_and_a_map_are_not_unpickled(mark: Path, tmp_path: Path) -> None:
    objects = np.array([Bomb(mark)], dtype=object)
    with (tmp_path / ARRAYS).open("wb") as file:
        np.savez(file, t=objects)
    with pytest.raises(RunFolderError):
        read_arrays(tmp_path)
    np.savez(tmp_path / "map.npz", z=objects, meta=np.array(json.dumps({"spacing_m": 1.0})))
    with pytest.raises(TerrainError):
        read_npz(tmp_path / "map.npz")
    for name in (ARRAYS, "map.npz"):
        (tmp_path / name).write_bytes(pickle.dumps(Bomb(mark)))
    with pytest.raises(RunFolderError):
        read_arrays(tmp_path)
    with pytest.raises(TerrainError):
        read_npz(tmp_path / "map.npz")
    assert not mark.exists()
