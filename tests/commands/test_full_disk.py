"""A disk that is full ends a command in one line that names the file, and leaves what was there as it was."""

from __future__ import annotations

import errno
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.renders import video
from mathnavi.sim.records.claimed_folder import claimed, locked
from mathnavi.sim.records.run_folder import RUN_FILES
from mathnavi.sim.records.store import Store
from mathnavi.sim.records.timing import TIMING
from mathnavi.sim.sweep.execution import run_trials
from tests.little_room import little_room
from tests.sim.sweep.test_execution import coins

RUN = ("run", "textbook-observer", "--duration", "0.5")
STUDY = ("study", "tests.studies.test_study_command:Anywhere")
Outcome = Callable[..., str]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run, a store of two trials, and a map."""
    folder = tmp_path_factory.mktemp("results")
    main([*RUN, "--out", str(folder / "run")])
    with Store.open(folder / "store.db") as store:
        run_trials(coins(2), store)
    return folder


@pytest.fixture
def failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Outcome:
    """The one line in which a command ends with this exit code, when nothing in the working directory was changed."""
    monkeypatch.chdir(tmp_path)

    def fail(code: int, *argv: str, size: int = 0) -> str:
        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        folders = sorted(tmp_path.rglob("*"))
        capsys.readouterr()
        with little_room(size):
            assert main(argv) == code
        error = capsys.readouterr().err
        assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
        assert sorted(tmp_path.rglob("*")) == folders
        assert len(error.splitlines()) == 1, error
        return error

    return fail


def test_a_run_is_not_written_and_the_earlier_one_stays(failed: Outcome, results: Path) -> None:
    assert failed(1, *RUN, "--out", "new/run") == "mathnavi: new/run/log.npz: File too large\n"
    assert main([*RUN, "--out", "run"]) in (0, 1)
    assert failed(1, *RUN, "--seed", "1", "--out", "run") == "mathnavi: run/log.npz: File too large\n"
    estimate = ("estimate", "textbook_ekf", str(results / "run"), "--out", "run")
    assert failed(1, *estimate) == "mathnavi: run/log.npz: File too large\n"


@pytest.mark.parametrize(
    ("code", "words", "named"),
    [
        (2, "store export {0}/store.db --out trials.csv", "trials.csv"),
        (2, "store export {0}/store.db --out trials.jsonl", "trials.jsonl"),
        (2, "terrain show canyon:1 --out map.png", "map.png"),
        (2, "compare {0}/run {0}/run --out two.html", "two.html"),
    ],
)
def test_a_table_a_picture_and_a_page_are_named(
    code: int, words: str, named: str, failed: Outcome, results: Path
) -> None:
    Path(named).write_text("Written by mathnavi compare.")
    line = failed(code, *words.format(results).split())
    assert f"{named}: File too large" in line


def test_a_map_is_named(failed: Outcome, hills: Path) -> None:
    Path("map.npz").write_text("an earlier map")
    assert "map.npz: File too large" in failed(2, "terrain", "import", str(hills), "--out", "map.npz")


def test_the_pages_of_a_study_stay_those_of_one_study(failed: Outcome) -> None:
    assert main([*STUDY, "--out", "study"]) == 0
    name = "study/tests.studies.test_study_command.Anywhere"
    line = failed(1, *STUDY, "--quick", "--out", "study", size=20_000)
    assert f": {name}." in line
    assert line.endswith(": File too large\n")
    assert json.loads(Path(f"{name}.json").read_text())["rows"] == [{"count": 3}]


@pytest.fixture
def without_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Videos and stills are drawn here, without a scene."""

    def draw(directory: Path, frames: Any, width: int, height: int, samples: int) -> Iterator[Any]:
        rng = np.random.default_rng(0)
        for _ in frames[:3]:
            yield rng.integers(0, 255, (height, width, 3), dtype=np.uint8)

    monkeypatch.setattr(video, "draw", draw)


@pytest.mark.usefixtures("without_opengl")
def test_a_video_and_a_still_are_named(failed: Outcome, results: Path) -> None:
    assert main([*RUN, "--out", "run"]) in (0, 1)
    Path("run/video.mp4").write_text("an earlier video")
    assert "run/video.mp4: File too large" in failed(2, "render", "run", size=4096)
    assert "run/board.png: File too large" in failed(2, "render", "run", "--still", "--camera", "board", size=4096)
    assert "run/report.html: File too large" in failed(2, "report", "run", size=4096)


def test_a_run_whose_pictures_find_no_room_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "run/picture")

    monkeypatch.setattr("mathnavi.renders.video.video_begun", full)
    monkeypatch.setattr("mathnavi.renders.report.write_report", full)
    folder = tmp_path / "run"
    assert main([*RUN, "--video", "--report", "--out", str(folder)]) == 1
    assert capsys.readouterr().err.splitlines() == [
        "mathnavi: no video: run/picture: No space left on device",
        "writing the report",
        "mathnavi: no report: run/picture: No space left on device",
    ]
    assert (folder / "summary.json").is_file()


def test_standard_output_that_cannot_be_written_is_named() -> None:
    with Path("/dev/full").open("w") as full:
        words = [sys.executable, "-m", "mathnavi", "list"]
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (1, "mathnavi: standard output: No space left on device\n")


@pytest.mark.parametrize("place", ["file/inner", "lost/inner", "n" * 300])
@pytest.mark.parametrize(
    ("words", "ending"),
    [
        ((*RUN, "--out"), ""),
        (("estimate", "textbook_ekf", "{0}/run", "--out"), ""),
        ((*STUDY, "--out"), ""),
        (("report", "{0}/run", "--out"), ".html"),
        (("compare", "{0}/run", "{0}/run", "--out"), ".html"),
        (("store", "export", "{0}/store.db", "--out"), ".csv"),
        (("terrain", "show", "canyon:1", "--out"), ".png"),
        (("terrain", "import", "{1}", "--out"), ".npz"),
        (("sweep", "textbook-observer", "--trials", "1", "--store"), ".db"),
        (("search", "textbook-observer", "--minimise", "duration_s", "--over", "seed=0..3", "--store"), ".db"),
    ],
    ids=lambda value: "-".join(value[:2]) if isinstance(value, tuple) else None,
)
def test_a_place_where_nothing_can_be_written_is_refused(
    words: tuple[str, ...], ending: str, place: str, failed: Outcome, results: Path, hills: Path
) -> None:
    Path("file").write_text("a file")
    Path("lost").symlink_to("nowhere")
    argv = [word.format(results, hills) for word in words]
    assert place.partition("/")[0][:40] in failed(2, *argv, f"{place}{ending}", size=resource.RLIM_INFINITY)


def test_a_folder_that_is_in_use_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with claimed(tmp_path / "run"):
        assert main([*RUN, "--out", str(tmp_path / "run")]) == 2
        assert main(["render", str(tmp_path / "run")]) == 2
        assert main(["report", str(tmp_path / "run")]) == 2
    name = tmp_path / "tests.studies.test_study_command.Anywhere.json"
    with locked(name, name):
        assert main([*STUDY, "--out", str(tmp_path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    named = (*[tmp_path / "run"] * 3, name)
    assert [f"{path} is in use" in line for path, line in zip(named, lines, strict=True)] == [True] * 4


def test_a_run_that_was_killed_is_no_bar(tmp_path: Path) -> None:
    (tmp_path / "log.json").write_text("half")
    assert main([*RUN, "--out", str(tmp_path)]) in (0, 1)
    assert {path.name for path in tmp_path.iterdir()} == {*RUN_FILES, TIMING}
