"""``range-localisation`` through the command line: run, run again, bad input, sweep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from tests.commands.test_sweep_cli import records

PARTS = ("--controller", "tests.localisation:Pattern", "--estimator", "tests.localisation:DeadReckoner")
EIGHT = tuple(word for row in ("0000", "2000", "0001") for word in ("--field.coefficients", *row))
SHORT = ("range-localisation", *PARTS, "--duration", "1")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run."""
    folder = tmp_path_factory.mktemp("field") / "run"
    words = ("--sensors", "-90", "-45", "0", "--start-known", "--noise.dropout", "0.1", "--field.shape", "egg")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MUJOCO_GL", "disable")
        assert main(["run", *SHORT, *words, "--outage", "0.2", "0.4", "--out", str(folder)]) in (0, 1)
    return folder


def test_a_run_leaves_what_every_run_leaves(finished: Path) -> None:
    names = {path.name for path in finished.iterdir()}
    assert names == {"config.json", "summary.json", "events.jsonl", "log.npz", "log.json"}
    config = json.loads((finished / "config.json").read_text())
    assert config["drawing"] == "mathnavi.renders.ranging.drawing"
    assert config["fields"]["sensors"] == [-90.0, -45.0, 0.0]
    assert config["mission"]["field"] == "egg"
    assert json.loads((finished / "log.json").read_text())["arrays"]["measurement.ranges"]["shape"] == [101, 3]


def test_a_run_can_be_run_again_bit_for_bit(finished: Path, tmp_path: Path) -> None:
    assert main(["run", "--trust", "--from", str(finished), "--out", str(tmp_path)]) in (0, 1)
    with np.load(finished / "log.npz") as one, np.load(tmp_path / "log.npz") as other:
        assert set(one) == set(other)
        for name in one:
            np.testing.assert_array_equal(one[name], other[name])


def test_a_run_again_takes_other_sensors_as_a_whole(finished: Path, tmp_path: Path) -> None:
    assert main(["run", "--trust", "--from", str(finished), "--sensors", "60", "-60", "--out", str(tmp_path)]) in (0, 1)
    assert json.loads((tmp_path / "config.json").read_text())["fields"]["sensors"] == [60.0, -60.0]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--start", "5", "0", "0"), ("--start = (5.0, 0.0, 0.0)", "outside", "allowed: within it")),
        (("--start", "3.7", "0", "0"), ("--start = ", "from the wall")),
        (("--start", "nan", "0", "0"), ("--start = ", "finite")),
        (("--sensors",), ("--sensors = ()", "1 to 64")),
        (("--sensors", "10", "370"), ("--sensors", "-360 to 360")),
        (("--sensors", "0", "90", "0"), ("--sensors", "one direction twice")),
        (("--sensors", "ahead"), ("--sensors = ahead", "FLOAT...")),
        (("--sensors", "0", "--sensors", "90"), ("--sensors is given 2 times",)),
        (("--friction", "0"), ("--friction = 0.0", ">= 0.01 and <= 10")),
        (("--friction", "nan"), ("--friction = nan",)),
        (("--drive", "tracks"), ("--drive = tracks", "differential, ideal")),
        (("--field.shape", "fourier"), ("--field.coefficients = ()", "two rows")),
        (
            ("--field.shape", "fourier", *EIGHT),
            ("--field.coefficients: the curve crosses itself",),
        ),
        (("--field.half-axes", "-1", "2"), ("--field.half-axes = (-1.0, 2.0)",)),
        (("--noise.outliers", "2"), ("--noise.outliers = 2.0",)),
        (("--outage", "3", "2"), ("--outage = (3.0, 2.0)", "T0 < T1")),
        (("--friction", "0.5"), ("--friction = 0.5", "differential")),
        (("--estimator", "kalman"), ("kalman",)),
        (
            ("--estimator", "range_observer", "--estimator.z-0", "1", "2"),
            ("--estimator.z-0 = (1.0, 2.0)", "with 2 sensors: 3"),
        ),
        (("--sensor", "3"), ("--sensor", "--sensors")),
    ],
)
def test_bad_input_is_one_line_that_names_the_flag(
    words: Sequence[str], expected: Sequence[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = SHORT if "--estimator" not in words else SHORT[:3]
    assert main(["run", *given, *words, "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    for word in expected:
        assert word in line
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("trials_here")
def test_sensor_sets_can_be_swept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = tmp_path / "sets.db"
    words = ("--vary", "sensors=-90 -45,-60 60 0", "--trials", "2", "--workers", "1", "--store", str(store))
    assert main(["sweep", *SHORT, *words]) == 0
    found = records(store)
    assert sorted({tuple(record.fields["sensors"]) for record in found}) == [(-90.0, -45.0), (-60.0, 60.0, 0.0)]
    assert "converged" in capsys.readouterr().out
