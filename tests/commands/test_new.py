"""``mathnavi new``: what it makes runs at once, passes its own tests, and is what the pages explain."""

from __future__ import annotations

import importlib
import json
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, get_args

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.commands.new import POINTS, Kind, class_of, contents, templates
from mathnavi.renders.generic.run_data import load_run
from mathnavi.renders.generic.scene import generic_scene
from mathnavi.renders.palette import SceneElement
from tests.docs.test_blocks import blocks_of
from tests.docs.test_notebooks import assert_form

DOCS = Path(__file__).resolve().parents[2] / "docs" / "how-to"
KINDS = get_args(Kind)
FIRST_RUNS = {  # what the README says to do first
    "vehicle": ["check", "my_vehicle.scenario:MyVehicle"],
    "planner": ["check", "my_planner.planner:MyPlanner"],
    "observer": ["check", "my_observer.observer:MyObserver"],
    "scenario": ["check", "my_scenario.scenario:MyScenario"],
}


@pytest.fixture(params=KINDS)
def made(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, Path]]:
    """A kind, and the folder that is made of it, in which the test works; its modules go with it."""
    kind = str(request.param)
    monkeypatch.chdir(tmp_path)
    assert main(["new", kind, f"my-{kind}"]) == 0
    folder = tmp_path / f"my-{kind}"
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder)])
    before = set(sys.modules)
    yield kind, folder
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


def test_what_is_made_runs_and_passes_its_own_tests(made: tuple[str, Path]) -> None:
    kind, folder = made
    tests = [str(path) for path in (folder / "tests").iterdir()]
    own = ["-c", "pyproject.toml", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--import-mode=importlib"]
    assert pytest.main([*own, *tests]) == 0
    if kind in FIRST_RUNS:
        assert main(FIRST_RUNS[kind]) == 0


OTHER_WHEELS = (  # of another rover: larger tyres of another shape, farther apart, slower, in another magnetic field
    ('magnetic="0 0.5 -0.2"', 'magnetic="0.2 0.3 -0.4"'),
    ('type="ellipsoid" size="0.08 0.02 0.08"', 'type="cylinder" size="0.12 0.02" euler="1.5707963267948966 0 0"'),
    ('pos="0.05 0.14 -0.02"', 'pos="0.05 0.2 0.02"'),
    ('pos="0.05 -0.14 -0.02"', 'pos="0.05 -0.2 0.02"'),
    ('ctrlrange="-10 10"', 'ctrlrange="-6 6"'),
)


def test_another_model_in_place_of_the_one_that_is_made_is_driven_by_its_own_dimensions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "vehicle", "roller"]) == 0
    monkeypatch.syspath_prepend(str(tmp_path / "roller"))
    model = tmp_path / "roller" / "roller" / "roller.xml"
    text = model.read_text()
    for before, after in OTHER_WHEELS:
        assert before in text
        text = text.replace(before, after)
    model.write_text(text)
    vehicle = importlib.import_module("roller.vehicle")
    body = vehicle.Body.of(vehicle.build_model())
    assert (body.wheel_radius, body.track, body.wheel_speed_max) == pytest.approx((0.12, 0.4, 6.0))
    assert body.magnetic == (0.2, 0.3)
    Roller = importlib.import_module("roller.scenario").Roller
    run = Roller.build(Roller.Config(), seed=3).run()
    assert run.success
    truth = run["truth.estimands"][np.searchsorted(run.t, run["estimate.t"] - 1e-9)]
    east, north, heading = (run["estimate.x"] - truth).T
    assert np.hypot(east, north).max() < 0.2
    assert np.abs(np.sin(heading)).max() < 0.05
    scene = run.scene_arrays()
    assert scene is not None
    ends = scene["plan.roller.pos"][scene["plan.roller.offsets"][1:] - 1]
    np.testing.assert_allclose(ends[:, :2], np.tile([4.0, 1.5], (len(ends), 1)), atol=1e-6)  # to the dock
    assert (np.abs(ends[:, 2] - 0.1) < 0.05).all()  # at the height of the chassis
    generic = generic_scene(load_run(run.save(tmp_path / "out")))
    assert SceneElement.PLAN.value in {lines.layer.name for lines in generic.lines}


def test_each_entry_point_leads_to_what_is_made(made: tuple[str, Path]) -> None:
    kind, folder = made
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    assert project["project"]["name"] == f"my-{kind}"
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == [f"my_{kind}"]
    groups = project["project"]["entry-points"]
    assert len(groups) == len(POINTS[kind])
    for group, points in groups.items():
        for name, place in points.items():
            assert name == f"my-{kind}"
            EntryPoint(name, place, group).load()


def test_nothing_is_left_to_replace() -> None:
    for kind in KINDS:
        for path, text in contents(kind, "my-robot").items():
            assert not re.search(r"@\w+@", path + text), path
        assert any("my_robot" in path for path in contents(kind, "my-robot"))
    assert class_of("my-robot_2") == "MyRobot2"


def test_a_plug_in_and_its_fields_have_the_name_that_was_given(made: tuple[str, Path]) -> None:
    """None keeps the name of the example on its page: `new planner my-planner` writes no ElevatorConfig."""
    kind, _ = made
    for place in POINTS[kind].values():
        named = place.replace("@name@", f"my_{kind}").replace("@Name@", class_of(f"my-{kind}"))
        plugin = EntryPoint("", named, "").load()
        assert kind == "terrain" or plugin.Config.__name__ == f"{plugin.__name__}Config"


def test_the_notebook_of_the_folder_runs_from_top_to_bottom(
    made: tuple[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    kind, folder = made
    assert_form(notebook := json.loads((folder / f"my_{kind}.ipynb").read_text(encoding="utf-8")))
    names: dict[str, Any] = {}
    for k, cell in enumerate(cell for cell in notebook["cells"] if cell["cell_type"] == "code"):
        exec(compile("".join(cell["source"]), f"cell {k}", "exec"), names)
    assert "nan" not in capsys.readouterr().out
    assert names["run"].success
    plt.close("all")


PAGES = {  # page, its file, the class in it that has the name
    "planner": ("elevator.py", "Elevator"),
    "observer": ("luenberger.py", "Luenberger"),
    "scenario": ("watch.py", "Watch"),
}


@pytest.mark.parametrize("kind", PAGES)
def test_the_page_explains_the_code_that_is_made(kind: str) -> None:
    file, named = PAGES[kind]
    blocks = blocks_of((DOCS / f"{kind}.md").read_text(encoding="utf-8"))
    shown = [block.text.partition("\n")[2].strip("\n") for block in blocks if block.file == file]
    code = templates(kind)[f"@name@/{kind}.py"].replace("@Name@", named)
    assert code == "\n\n\n".join(shown) + "\n"


@pytest.mark.parametrize(
    ("page", "kind", "name", "files"),
    [
        ("rover", "vehicle", "rover", {"rover.xml", "vehicle.py", "estimator.py", "controller.py", "scenario.py"}),
        ("terrain", "terrain", "fens", {"terrain.py", "pyproject.toml"}),
    ],
)
def test_the_page_shows_parts_of_what_is_made(page: str, kind: str, name: str, files: set[str]) -> None:
    code = contents(kind, name)
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```(?:py|xml|toml)\n(?:# |<!-- )(\S+?)(?: -->)?\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert {file.removeprefix(f"{name}/") for file, _ in shown} == files
    for file, excerpt in shown:
        for part in excerpt.split("...\n"):
            assert part.strip("\n") in code[file], f"{file}:\n{part}"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["boat", "mine"], "KIND = boat; allowed: "),
        (["vehicle", "9x"], "NAME = '9x'; allowed: 2 to 40 lower-case letters"),
        (["vehicle", "My"], "NAME = 'My'; allowed: "),
        (["vehicle", "../x"], "NAME = '../x'; allowed: "),
        (["vehicle", "class"], "NAME = 'class'; allowed: "),
        (["vehicle", "json"], "a Python module 'json' exists already"),
        (["planner", "up-across-down"], "the code has another 'UpAcrossDown'"),
        (["planner", "gatekeeper"], "NAME = 'gatekeeper' is that of installed controllers"),
        (["terrain", "canyon"], "NAME = 'canyon' is that of installed terrains"),
        (["terrain", "there"], "NAME = there exists; allowed: a new folder"),
        (["terrain", "fens", "--out", "there"], "--out = there exists; allowed: a new folder"),
    ],
)
def test_a_name_that_cannot_be_is_refused_in_one_line(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    assert main(["new", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
