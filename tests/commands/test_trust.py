"""A run folder is data: code that it names is imported only if it is installed, or if ``--trust`` is given."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.interfaces.errors import RunFolderError, UntrustedError
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.report import again
from mathnavi.sim.plugin.trust import trusting
from tests.renders.drawn import needs_opengl

EVIL = """
from pathlib import Path

Path({mark!r}).touch()
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank as Estimator
from mathnavi.controllers.active_sensing.plugin import ActiveSensing as Controller
from mathnavi.sim.scenarios.range_localisation import RangeLocalisation as Scenario
from mathnavi.renders.ranging.drawing import drawing
"""
Forge = Callable[..., Path]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return mn.run("range-localisation", seed=1, duration=1.0).save(tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file that the stranger's module writes when it is imported; the module lies in the current folder."""
    mark = tmp_path / "executed"
    here = tmp_path / "here"
    here.mkdir()
    (here / f"evil_{tmp_path.name}.py").write_text(EVIL.format(mark=str(mark)))
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "path", [*sys.path, str(here)])
    return mark


@pytest.fixture
def forged(recorded: Path, mark: Path, tmp_path: Path) -> Forge:
    """Copies the recorded run with some entries of config.json replaced; "EVIL" stands for the stranger's module."""

    def forge(**entries: Any) -> Path:
        folder = shutil.copytree(recorded, tmp_path / "here" / "old")
        config = json.loads((folder / "config.json").read_text())
        for name, value in entries.items():
            config[name] = {**config[name], **value} if isinstance(value, dict) else value
        (folder / "config.json").write_text(json.dumps(config).replace("EVIL", f"evil_{tmp_path.name}"))
        return folder

    return forge


NAMED: dict[str, dict[str, Any]] = {
    "scenario": {"scenario": "EVIL:Scenario"},
    "controller": {"controller": {"name": "EVIL:Controller"}},
    "estimator": {"estimator": {"name": "EVIL:Estimator"}},
}
COMMANDS = {
    "run": ["run", "--from", "old", "--out", "new"],
    "estimate": ["estimate", "range_ekf", "old", "--out", "new"],
    "view": ["view", "old"],
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("named", NAMED)
def test_no_command_imports_what_a_folder_names(
    named: str, command: str, forged: Forge, mark: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forged(**NAMED[named])
    assert main(COMMANDS[command]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "not installed" in line
    assert "--trust" in line
    assert not mark.exists()
    assert not Path("new").exists()


def test_no_field_of_a_folder_imports_what_it_names(
    mark: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = {
        "scenario": "simultaneous-arrival",
        "seed": 0,
        "fields": {"consensus": f"evil_{tmp_path.name}:Controller"},
        "controller": {"name": "mathnavi.controllers.flight.plugin:FlightController", "fields": {}},
        "estimator": {"name": "mathnavi.estimators.kalman:Kalman", "fields": {}},
    }
    Path("old").mkdir()
    Path("old/config.json").write_text(json.dumps(config))
    assert main(COMMANDS["run"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "config.json names code that is not installed" in line
    assert not mark.exists()
    assert main([*COMMANDS["run"], "--trust"]) == 2  # it is no consensus
    assert mark.exists()


def test_a_recorded_text_that_is_no_code_is_no_matter_of_trust(tmp_path: Path) -> None:
    mn.run("arm-velocity", mechanism="dm_control:pendulum", duration=0.2, settled=0.1).save(tmp_path / "old")
    assert main(["run", "--from", str(tmp_path / "old"), "--out", str(tmp_path / "new")]) in (0, 1)


def test_with_trust_it_is_run_again(forged: Forge, mark: Path) -> None:
    forged(**NAMED["controller"])
    assert main([*COMMANDS["run"], "--trust"]) in (0, 1)
    assert mark.exists()


def test_what_the_command_line_names_too_needs_no_trust(forged: Forge, mark: Path, tmp_path: Path) -> None:
    forged(**NAMED["estimator"])
    assert main([*COMMANDS["run"], "--estimator", f"evil_{tmp_path.name}:Estimator"]) in (0, 1)
    assert mark.exists()


def test_an_estimator_of_a_trusted_folder_is_run(forged: Forge, mark: Path) -> None:
    forged(**NAMED["estimator"])
    assert main([*COMMANDS["estimate"], "--trust"]) in (0, 1)
    assert mark.exists()


def test_no_picture_imports_what_a_folder_names(
    forged: Forge, mark: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    old = forged(drawing=f"evil_{tmp_path.name}")
    for command in (["render", "--still"], ["render", "--clip"], ["render"], ["report"]):
        assert main([*command, "old"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "not installed" in line
    run = mn.load(old)
    for draw in (run.plot, lambda: run.report(tmp_path / "page.html"), lambda: run.video(tmp_path / "film.mp4")):
        with pytest.raises(UntrustedError, match=r"--trust"):
            draw()
    assert not mark.exists()
    mn.load(old, trust=True).report(tmp_path / "page.html")
    assert mark.exists()


def test_a_run_in_the_place_of_another_imports_nothing_that_this_one_names(
    forged: Forge, mark: Path, tmp_path: Path
) -> None:
    forged(drawing=f"evil_{tmp_path.name}")
    assert main(["run", "range-localisation", "--duration", "0.5", "--out", "old"]) in (0, 1)
    assert not mark.exists()


def test_a_drawing_that_is_installed_is_found_by_its_name_and_by_its_module(forged: Forge) -> None:
    old = forged(drawing="ranging")
    assert drawing_of(old).cameras == ("top", "chase")
    shutil.rmtree(old)
    assert drawing_of(forged(drawing="mathnavi.renders.ranging.drawing")).cameras == ("top", "chase")


@pytest.mark.parametrize("drawing", [3, [], "", "..", "/etc/passwd", "os", "a.b:c", "x\0y", "ranging\n", "\ud800"])
def test_a_drawing_that_is_none_is_refused(forged: Forge, drawing: object) -> None:
    old = forged(drawing=drawing)
    for trust in (False, True):
        with trusting(trust), pytest.raises(RunFolderError):
            drawing_of(old)


PACKAGE = """[mathnavi.controllers]
flight = EVIL:Controller
[mathnavi.estimators]
found_here = EVIL:Estimator
[mathnavi.terrains]
found_here = EVIL:drawing
"""


def test_the_current_folder_installs_nothing(
    forged: Forge, mark: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = f"evil_{tmp_path.name}"
    folder = Path("evil-1.0.dist-info")
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(PACKAGE.replace("EVIL", module))
    forged(**NAMED["estimator"])
    assert main(COMMANDS["run"]) == 2
    assert main(["list"]) == 0
    assert module not in capsys.readouterr().out
    assert "found_here" not in mn.available("estimators") + mn.available("terrains")
    assert not mark.exists()


@pytest.mark.parametrize(
    "name",
    ["plain", "two words", "it's", 'a "quoted" one', "$(touch pwned)", "`touch pwned`", "a;b", "new\nline", "-x"],
)
def test_the_command_of_a_report_is_one_that_a_shell_reads_back(name: str) -> None:
    text = str(again(Path(name), {"scenario": "safe-flight; $(touch pwned)"})[1])
    shown = re.search(r"<pre[^>]*>(.*?)</pre>", text, re.DOTALL)
    assert shown is not None
    words = shlex.split(unescape(shown[1]))
    assert words[:4] == ["mathnavi", "run", "safe-flight; $(touch pwned)", "--from"]
    assert len(words) == 5
    assert Path(words[4]) == Path(name)
    assert not words[4].startswith("-")


def test_a_report_asks_for_trust_where_the_run_is_refused_without_it_and_nowhere_else(
    recorded: Path, forged: Forge, tmp_path: Path
) -> None:
    """Each forged folder names one part that is not installed."""
    fleet = {"scenario": "simultaneous-arrival", "fields": {"consensus": f"evil_{tmp_path.name}:Controller"}}
    own = json.loads((recorded / "config.json").read_text())
    assert own["controller"]["name"] == "mathnavi.controllers.active_sensing.plugin:ActiveSensing"
    assert "--trust" not in "".join(again(recorded, own))
    assert main(["run", "--from", str(recorded), "--out", "new"]) in (0, 1)
    for named in (*NAMED.values(), fleet):
        folder = forged(**named)
        text = "".join(again(folder, json.loads((folder / "config.json").read_text())))
        shutil.rmtree(folder)
        assert "add --trust" in text.lower()
        assert f"evil_{tmp_path.name}:" in text
    a_name_with_a_colon = {**own, "fields": {"mechanism": "dm_control:pendulum"}}
    assert "--trust" not in "".join(again(recorded, a_name_with_a_colon))


NUMPY = "from pathlib import Path\nPath({mark!r}).touch()\nraise RuntimeError('this is no NumPy')\n"


@needs_opengl
@pytest.mark.usefixtures("drawing_apart")
def test_a_library_of_the_current_folder_is_not_taken_for_the_one_that_draws(
    recorded: Path, mark: Path, tmp_path: Path
) -> None:
    from mathnavi.renders.video import write_still

    for module in ("numpy", "sitecustomize", "json"):
        Path(f"{module}.py").write_text(NUMPY.format(mark=str(mark)))
    write_still(recorded, path=tmp_path / "still.png", width=64, height=48)
    assert not mark.exists()


def test_the_module_mathnavi_takes_no_library_from_the_current_folder(mark: Path) -> None:
    Path("numpy.py").write_text(NUMPY.format(mark=str(mark)))
    done = subprocess.run(
        [sys.executable, "-m", "mathnavi", "terrain", "show", "nowhere"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    assert not mark.exists()


def test_the_processes_of_a_sweep_take_no_library_from_the_current_folder(mark: Path) -> None:
    for module in ("numpy", "sitecustomize", "json"):
        Path(f"{module}.py").write_text(NUMPY.format(mark=str(mark)))
    assert main(["sweep", "range-localisation", "--duration", "0.5", "--trials", "1", "--store", "sweep.db"]) == 0
    assert not mark.exists()


DRAWN = """
from dataclasses import replace
from mathnavi.sim.scenarios.range_localisation import RangeLocalisation

class Mine(RangeLocalisation):
    @staticmethod
    def build(*arguments):
        built = RangeLocalisation.build(*arguments)
        return replace(built, config={{**built.config, "scenario": "{0}:Mine", "drawing": "{0}_pictures"}})
"""


@pytest.mark.parametrize("source", ["from mathnavi.renders.ranging.drawing import drawing", "raise KeyError('none')"])
def test_a_run_of_ones_own_scenario_is_drawn_by_its_own_drawing(
    source: str, mark: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = f"own_{tmp_path.name}"
    Path(f"{name}.py").write_text(DRAWN.format(name))
    Path(f"{name}_pictures.py").write_text(f"{source}\n")
    assert main(["run", f"{name}:Mine", "--duration", "0.5", "--out", "new", "--report"]) in (0, 1)
    drawn = "import drawing" in source
    assert Path("new/report.html").is_file() is drawn
    if not drawn:
        assert "no report: " in capsys.readouterr().err
    assert main(["run", "--from", "new", "--out", "again"]) == 2


def test_a_saved_copy_follows_no_link(recorded: Path, tmp_path: Path) -> None:
    precious, copy = tmp_path / "precious", tmp_path / "copy"
    precious.write_text("mine")
    copy.mkdir()
    (copy / "config.json").symlink_to(precious)
    mn.load(recorded).save(copy)
    assert precious.read_text() == "mine"
    assert (copy / "config.json").read_text() == (recorded / "config.json").read_text()


@needs_opengl
def test_a_trusted_drawing_is_found_in_the_current_folder(forged: Forge, tmp_path: Path) -> None:
    module = f"mine_{tmp_path.name}"
    (tmp_path / "here" / f"{module}.py").write_text("from mathnavi.renders.ranging.drawing import drawing\n")
    old = forged(drawing=module)
    sys.path[:] = [entry for entry in sys.path if entry != str(tmp_path / "here")]  # as for an installed command
    for command in (["render", "--still"], ["report"]):
        assert main([*command, str(old)]) == 2
        assert main([*command, str(old), "--trust"]) == 0
