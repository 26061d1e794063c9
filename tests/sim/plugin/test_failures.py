"""A plug-in that raises, ends the process, or returns rubbish, ends in one line that names it, and exit code 2."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.interfaces.errors import PluginError
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain import library
from mathnavi.sim.plugin.registry import PluginSpec, checked_estimator, load

RAISED = {
    "exit": "raise SystemExit(0)",
    "error": "raise KeyError('gone')",
    "own": "raise type('Own', (BaseException,), {})('mine')",
    "recursion": "f = lambda: f(); f()",
    "no message": "raise type('Odd', (Exception,), {'__str__': lambda error: 1 / 0})()",
}
CLASS = """
import dataclasses
{at_import}

@dataclasses.dataclass(frozen=True)
class Config:
    rate: float = 1.0

    def __post_init__(self):
        {at_configuration}

class Mine:
    Config = Config
    controller, estimator = "flight", "full_state"
    title, quick = "mine", None
    within_starts = True
    period = 1.0

    @staticmethod
    def build(config, mission, *more):
        {at_build}

    @staticmethod
    def sensors(config, mission):
        {at_build}

    quality = sensors

    @staticmethod
    def run(config, setup):
        {at_build}

    on_terrain = False
"""
Write = Callable[..., str]


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Writes a plug-in with some code in one of its phases, into the current folder; the name of its module."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])

    def write(**code: str) -> str:
        phases = {"at_import": "pass", "at_configuration": "pass", "at_build": "pass", **code}
        name = f"plugin_{tmp_path.name}"
        Path(f"{name}.py").write_text(CLASS.format(**phases))
        return name

    return write


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., str]:
    """Runs a command that has to end in one line, with exit code 2, and leave no result behind."""

    def run(*words: str) -> str:
        assert main(words) == 2
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err
        line = said.err.splitlines()[-1]  # numba may have compiled before
        assert not [path.name for path in tmp_path.rglob("*.json")]
        return line

    return run


def commands(module: str) -> dict[str, list[str]]:
    place = f"{module}:Mine"
    return {
        "controllers": ["run", "safe-flight", "--out", "out", "--controller", place],
        "estimators": ["run", "safe-flight", "--out", "out", "--estimator", place],
        "scenarios": ["run", place, "--out", "out"],
        "studies": ["study", place, "--out", "out"],
        "consensus": ["run", "simultaneous-arrival", "--out", "out", "--consensus", place],
    }


@pytest.mark.refused("plug-in", "an import or a configuration that fails")
@pytest.mark.parametrize("raised", RAISED)
@pytest.mark.parametrize("phase", ["at_import", "at_configuration"])
def test_a_plug_in_that_fails_before_it_is_built_is_named(
    phase: str, raised: str, written: Write, refused: Callable[..., str]
) -> None:
    module = written(**{phase: RAISED[raised]})
    for kind, words in commands(module).items():
        if kind == "consensus":  # its mission takes a while to be drawn
            continue
        assert f"{module}:Mine" in refused(*words)


@pytest.mark.refused("plug-in", "a build that fails or ends the process")
@pytest.mark.parametrize("raised", ["exit", "error", "own", "recursion"])
@pytest.mark.parametrize("kind", commands(""))
def test_a_plug_in_that_fails_while_it_is_built_is_named(
    kind: str, raised: str, written: Write, refused: Callable[..., str]
) -> None:
    module = written(at_build=RAISED[raised])
    line = refused(*commands(module)[kind])
    assert f"{module}:Mine" in line
    assert f"{module}.py:" in line


@pytest.mark.refused("plug-in", "a build that returns another thing")
@pytest.mark.parametrize("kind", commands(""))
@pytest.mark.parametrize("rubbish", ["return None", "return 3", "return 'text', []"])
def test_a_plug_in_that_builds_rubbish_is_named(
    kind: str, rubbish: str, written: Write, refused: Callable[..., str]
) -> None:
    module = written(at_build=rubbish)
    line = refused(*commands(module)[kind])
    assert f"{module}:Mine" in line
    assert "allowed" in line


HEIGHTS = "from mathnavi.models.terrain.height_field import HeightField\nimport numpy as np\ndef made():\n    {}\n"
GROUND = {
    **RAISED,
    "nothing": "return None",
    "an array": "return np.zeros((3, 3))",
    "NaN": "return HeightField(np.full((3, 3), np.nan), 1.0)",
    "another shape": "return HeightField(np.zeros(3), 1.0)",
    "no spacing": "return HeightField(np.zeros((3, 3)), float('nan'))",
    "a path": "return HeightField(np.zeros((3, 3)), 1.0, '../../precious')",
    "no name": "return HeightField(np.zeros((3, 3)), 1.0, None)",
}


@pytest.mark.refused("plug-in", "a terrain that fails or is none")
@pytest.mark.parametrize("body", GROUND)
def test_a_terrain_that_fails_is_named(
    body: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    module = f"ground_{tmp_path.name}"
    (tmp_path / f"{module}.py").write_text(HEIGHTS.format(GROUND[body]))
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.chdir(tmp_path)
    points = [EntryPoint("strange", f"{module}:made", library.GROUP)]
    monkeypatch.setattr(library, "_installed", lambda: points)
    for words in (["terrain", "show", "strange"], ["run", "safe-flight", "--terrain", "strange", "--out", "out"]):
        assert "strange" in refused(*words)


@pytest.mark.parametrize("value", ["gone:made", "numpy:no_such_name", "numpy:pi", "numpy", "", "a b:c", "..:x"])
def test_a_terrain_that_is_not_there_is_named(
    value: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, refused: Callable[..., str]
) -> None:
    monkeypatch.chdir(tmp_path)
    points = [EntryPoint("strange", value, library.GROUP)]
    monkeypatch.setattr(library, "_installed", lambda: points)
    assert "strange" in refused("terrain", "show", "strange")


@pytest.mark.refused("plug-in", "a place that names no class")
def test_a_place_without_a_plugin_says_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    filling = {"at_import": "", "at_configuration": "pass", "at_build": "pass"}
    Path("stairs.py").write_text(CLASS.format(**filling), encoding="utf-8")
    Path("halves.py").write_text("x = (", encoding="utf-8")
    Path("needing.py").write_text("import nothing_of_that_name", encoding="utf-8")
    said = {
        "stairs:Mien": f"{tmp_path / 'stairs.py'} has no Mien; did you mean Mine? allowed: Mine",
        "os.path:": "it names no class; allowed: package.module:Class",
        "stairs.py:Mine": "no module 'stairs.py' in the present folder, and none is installed; allowed: "
        "package.module:Class (the module of stairs.py is stairs)",
        "../stairs:Mine": "'../stairs' is not the name of a module; allowed: package.module:Class, from the folder",
        "stars:Mine": "there is no module 'stars' in the present folder",
        "halves:Mine": "SyntaxError: '(' was never closed (halves.py, line 1)\n",
        "needing:Mine": f"No module named 'nothing_of_that_name' ({tmp_path / 'needing.py'}:1)",
    }
    for place, expected in said.items():
        assert main(["run", "textbook-observer", "--controller", place]) == 2
        assert expected in capsys.readouterr().err


def test_a_mission_that_no_plug_in_fits_is_told_what_would_make_one_fit() -> None:
    class Voyage:
        control_period, start_state = 0.1, np.zeros(3)

    spec = PluginSpec.with_fields(load("estimators", "range_ekf"))
    with pytest.raises(PluginError) as refused:
        checked_estimator(spec, Voyage())
    said = str(refused.value)
    assert "'range_ekf' is for a RangingMission, and the mission is a Voyage; allowed: a RangingMission" in said
    assert "or full_state if Voyage had flow, full_state_covariance, full_state_quality, full_state_sensor" in said
    with pytest.raises(PluginError, match=r"allowed: full_state, kalman, moving_horizon, or package\.module:Class"):
        checked_estimator(spec, FlightMission(library.load_terrain("plain"), (9e3, 9e3, 500.0), (2e4, 2e4, 500.0)))
