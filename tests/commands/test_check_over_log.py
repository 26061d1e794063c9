"""``mathnavi check`` of an estimator over a log: its mission is found or given, and its sensors need no ``read``."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mathnavi.commands.cli import main
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.sim.plugin.named_object import named_object, objects_in
from mathnavi.sim.plugin.registry import PluginSpec, checked_quality, checked_sensors, class_at

CODE = """
import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.signals import Estimate, Status


@configuration
class LevelConfig:
    gain: Positive = 0.5


@dataclass(frozen=True)
class TankMission:
    period: float


class Filter:
    def __init__(self, config, mission):
        self.period, self.gain, self.x = mission.period, config.gain, np.zeros(1)

    def update(self, t, measurements, command):
        for each in measurements:
            self.x = self.x + self.gain * (each.value - self.x)
        return Estimate(t, self.x.copy(), None, Status.OK)


class Level:
    Config = LevelConfig

    @staticmethod
    def build(config: LevelConfig, mission: TankMission):
        return Filter(config, mission)

    @staticmethod
    def sensors(config, mission):
        return (SimpleNamespace(name="level", size=1),)


half, depths = 0.5, [1.0, 2.0]
"""
TANK = "tank = TankMission(0.1)\n"
Module = Callable[..., str]


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Module]:
    """Write the code above, with replacements and an addition, as a module of the test's own; return its name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setenv("COLUMNS", "400")
    name = f"own_{abs(hash(request.node.name))}"

    def written(*replaced: tuple[str, str], added: str = TANK) -> str:
        text = CODE + added
        for before, after in replaced:
            assert before in text
            text = text.replace(before, after)
        Path(f"{name}.py").write_text(text, encoding="utf-8")
        return name

    yield written
    sys.modules.pop(name, None)


def checked(capsys: pytest.CaptureFixture[str], code: int, *words: str) -> str:
    assert main(["check", *words]) == code
    return " ".join(capsys.readouterr().out.split())


def test_an_estimator_is_checked_with_the_mission_of_its_file_and_the_command_to_print_runs(
    module: Module, capsys: pytest.CaptureFixture[str]
) -> None:
    name = module()
    said = checked(capsys, 0, f"{name}.py:Level")
    assert f"over a log of {name}.py:tank, every 0.1 s" in said
    assert "sensor level has no rate and no read: a log needs none, a scenario does" in said
    command = shlex.split(said.partition("run mathnavi ")[2].replace("=COLUMN", "=h").replace("LOG.csv", "log.csv"))
    Path("log.csv").write_text("t,h\n0,1\n0.1,1\n0.2,1\n")
    assert main(command) == 0
    assert "ok 3 of 3" in " ".join(capsys.readouterr().out.split())


def test_a_mission_that_is_given_is_used_and_one_that_is_not_known_is_asked_for(
    module: Module, capsys: pytest.CaptureFixture[str]
) -> None:
    name = module(added="def made():\n    return TankMission(0.2)\n")
    assert f"mathnavi check {name}:Level --mission FILE.py:NAME" in checked(capsys, 0, f"{name}.py:Level")
    assert "every 0.2 s" in checked(capsys, 0, f"{name}:Level", "--mission", f"{name}.py:made")


@pytest.mark.parametrize(
    ("replaced", "code", "said"),
    [
        (('SimpleNamespace(name="level", size=1)', 'SimpleNamespace(name="level")'), 1, "without size"),
        (("Estimate(t, self.x.copy(), None, Status.OK)", "self.x"), 1, "update() at 0 s"),
        (("each.value", "each.valu"), 0, "note with readings of zeros: "),
        (("    Config = L", '    figures = {"a": ("b [m]",)}\n    Config = L'), 1, "in class Filter: figures = {'a': "),
        (("    Config = L", '    numbers = ("h [m]",)\n    Config = L'), 1, "in class Filter: numbers = ('h [m]',)"),
    ],
)
def test_what_a_log_needs_and_lacks_is_found(
    replaced: tuple[str, str], code: int, said: str, module: Module, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in checked(capsys, code, f"{module(replaced)}.py:Level")


def test_names_that_the_built_estimator_has_are_not_asked_for_again(
    module: Module, capsys: pytest.CaptureFixture[str]
) -> None:
    names = '    numbers = ("h [m]",)\n'
    own = module(("    Config = L", f"{names}    Config = L"), ("class Filter:\n", f"class Filter:\n{names}"))
    checked(capsys, 0, f"{own}.py:Level")


def test_only_what_can_be_a_mission_is_offered_in_the_place_of_one(
    module: Module, capsys: pytest.CaptureFixture[str]
) -> None:
    name = module()
    assert main(["check", f"{name}:Level", "--mission", f"{name}.py:tnk"]) == 2
    assert f"{name}.py has no tnk; did you mean tank? allowed: tank\n" in capsys.readouterr().err
    named_object(f"{name}:tank")
    assert list(objects_in(sys.modules[name])) == ["tank"]


@pytest.mark.parametrize("words", [("arm.xml",), ("flight",), ("safe-flight",)])
def test_a_mission_for_what_is_no_estimator_is_refused(
    words: tuple[str, ...], module: Module, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", *words, "--mission", f"{module()}.py:tank"]) == 2
    assert "allowed: with an estimator" in capsys.readouterr().err


def test_a_scenario_asks_for_more_of_an_estimator_than_a_log(module: Module) -> None:
    name = module()
    spec, mission = PluginSpec.with_fields(class_at("estimators", f"{name}:Level")), named_object(f"{name}:tank")
    with pytest.raises(ValueError, match=r"without rate and read; allowed: .*; over a log name and size are enough"):
        checked_sensors(spec, mission)
    with pytest.raises(ValueError, match="has no quality, which this scenario needs; allowed: a static method"):
        checked_quality(spec, mission, EstimateQuality)
