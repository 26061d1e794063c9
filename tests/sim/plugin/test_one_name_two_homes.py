"""Two plug-ins of one name are refused where the name is used, with the homes of both; all else goes on."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from mathnavi.commands.cli import main
from mathnavi.commands.completion import candidates
from mathnavi.commands.listing import listing
from mathnavi.interfaces.errors import PluginError
from mathnavi.models.terrain import library
from mathnavi.sim.plugin.groups import GROUPS, installed
from mathnavi.sim.plugin.registry import called, load, loadable, names

TAKEN = {
    "controllers": ("flight", "mathnavi.controllers.flight.plugin:FlightController"),
    "estimators": ("full_state", "mathnavi.estimators.full_state:FullState"),
    "consensus": ("clock", "mathnavi.controllers.arrival.clock:Clock"),
    "scenarios": ("missile-guidance", "mathnavi.sim.scenarios.missile_guidance:MissileGuidance"),
    "studies": ("noise", "mathnavi.studies.flight.noise:Noise"),
    "terrains": ("canyon", "mathnavi.models.terrain.synthetic:canyon"),
    "drawings": ("ranging", "mathnavi.renders.ranging.drawing"),
    "logs": ("table", "mathnavi.sim.logs.table:TableLog"),
}  # names that the stranger gives, and what he installs under each


@pytest.fixture(autouse=True)
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A distribution, strange 1.2, whose plug-ins are called as some of ours are."""
    folder = tmp_path / "site" / "strange-1.2.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.2\n", encoding="utf-8")
    groups = (f"[mathnavi.{kind}]\n{name} = {value}\n" for kind, (name, value) in TAKEN.items())
    (folder / "entry_points.txt").write_text("\n".join(groups), encoding="utf-8")
    monkeypatch.syspath_prepend(str(folder.parent))
    monkeypatch.chdir(tmp_path)


@pytest.mark.refused("plug-in", "one name in two packages")
@pytest.mark.parametrize("kind", [kind for kind in GROUPS if kind not in ("terrains", "drawings")])
def test_the_name_is_refused_with_both_homes_and_every_other_one_loads(kind: str) -> None:
    name, value = TAKEN[kind]
    with pytest.raises(PluginError, match=f"{name}.*mathnavi 0.*strange 1.2.*allowed: .*package.module:Class"):
        load(kind, name)
    assert set(loadable(kind)) == set(names(kind)) - {name}
    assert load(kind, value) is not None
    assert called(kind, value) == value, "the name says no longer which one"


def test_a_terrain_is_refused_and_another_loads() -> None:
    with pytest.raises(PluginError, match=r"'canyon'.*mathnavi 0.*strange 1.2"):
        library.load_terrain("canyon:3")
    assert library.load_terrain("tian_shan").name == "tian_shan"


@pytest.mark.parametrize(
    ("words", "flag"),
    [
        ("run safe-flight", "--controller"),
        ("run safe-flight --controller gatekeeper", "--estimator"),
        ("sweep missile-guidance --trials 1 --store s.db", "SCENARIO"),
        ("study noise", "NAME = 'noise'"),
        ("study all", "NAME = 'noise'"),
        ("study cost-to-go --terrain canyon", "terrain"),
        ("terrain show canyon", "terrain"),
    ],
)
def test_a_command_that_needs_it_ends_before_it_writes(
    words: str, flag: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(tmp_path.rglob("*"))
    assert main(words.split()) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert flag in line
    assert "mathnavi 0.1.0" in line
    assert "strange 1.2" in line
    assert sorted(tmp_path.rglob("*")) == before


def test_a_command_that_does_not_need_it_works(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "textbook-observer", "--duration", "1", "--out", "run"]) in (0, 1)
    assert "noise" in candidates(["study", ""])
    assert candidates(["study", "noise", "--"]) == []
    assert candidates(["study", "horizon", "--"])


def test_the_list_shows_both_and_says_that_they_are_refused() -> None:
    console = Console(width=200, file=StringIO())
    console.print(listing("consensus", installed("consensus"), full=True, verbose=True))
    text = console.file.getvalue()
    assert text.count("refused: 2 plug-ins have this name") == 2
    assert "strange 1.2, mathnavi.controllers.arrival.clock:Clock" in text
