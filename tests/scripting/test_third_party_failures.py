"""The failure of a third-party scenario, as a command, a sweep, a script and an environment report it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.environments.dm import load
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.textbook import TextbookConfig, TextbookObserver
from mathnavi.sim.sweep.trial import trial

BROKEN = f"{__name__}:Broken"
Failure = Literal["none", "raises", "exits", "returns-nothing", "ends-in-flight"]


@configuration
class BrokenConfig(TextbookConfig):
    """Fields of the scenario."""

    failure: Failure = "none"


class Broken:
    """A scenario that fails as its configuration has it."""

    Config = BrokenConfig
    controller, estimator = TextbookObserver.controller, TextbookObserver.estimator

    @staticmethod
    def build(config: BrokenConfig, seed: int, controller: PluginSpec, estimator: PluginSpec) -> ClosedLoop | None:
        if config.failure == "raises":
            raise KeyError("colour")
        if config.failure == "exits":
            raise SystemExit("enough")
        if config.failure == "returns-nothing":
            return None
        loop = TextbookObserver.build(config, seed, controller, estimator)
        return dataclasses.replace(loop, finished=_broken) if config.failure == "ends-in-flight" else loop


def _broken(t: float, truths: Mapping[str, Array]) -> bool:
    raise KeyError("colour")


def by_script(failure: str) -> None:
    mn.run(BROKEN, failure=failure, duration=0.2)


def by_trial(failure: str) -> None:
    trial(BROKEN, failure=failure, duration=0.2).run()


def by_environment(failure: str) -> None:
    environment = load(BROKEN, failure=failure, duration=0.2)
    environment.reset()
    environment.step(np.zeros(1))


RAISED = (PluginError, rf"scenarios: '{re.escape(BROKEN)}': build\(\) failed: KeyError: 'colour' \(.*:\d+\)$")
EXITED = (PluginError, rf"scenarios: '{re.escape(BROKEN)}': build\(\) failed: SystemExit: enough \(.*:\d+\)$")
NOTHING = (PluginError, rf"scenarios: '{re.escape(BROKEN)}': build\(\) returned a NoneType; allowed: a ClosedLoop$")
IN_FLIGHT = (PluginError, rf"scenarios: '{re.escape(BROKEN)}': a run failed: KeyError: 'colour' \(.*:\d+\)$")


@pytest.mark.refused("plug-in", "a scenario that fails in a run")
@pytest.mark.parametrize(
    ("way", "failure", "expected"),
    [
        (by_script, "raises", RAISED),
        (by_script, "exits", EXITED),
        (by_script, "returns-nothing", NOTHING),
        (by_script, "ends-in-flight", IN_FLIGHT),
        (by_trial, "raises", RAISED),
        (by_trial, "exits", EXITED),
        (by_trial, "returns-nothing", NOTHING),
        (by_trial, "ends-in-flight", IN_FLIGHT),
        (by_environment, "raises", RAISED),
        (by_environment, "exits", EXITED),
        (by_environment, "returns-nothing", NOTHING),
        (by_environment, "ends-in-flight", (PluginError, IN_FLIGHT[1].replace("a run", "an episode"))),
    ],
)
def test_the_failure_of_a_scenario_is_reported(
    way: Callable[[str], None], failure: str, expected: tuple[type[BaseException], str]
) -> None:
    kind, message = expected
    with pytest.raises(kind, match=message):
        way(failure)


SWEEP = ("sweep", "--trials", "2", "--store", "s.db")


@pytest.mark.parametrize(
    ("command", "failure"),
    [
        *((("run",), failure) for failure in ("raises", "exits", "returns-nothing", "ends-in-flight")),
        *((SWEEP, failure) for failure in ("raises", "exits", "returns-nothing")),
    ],
)
def test_a_command_reports_it_in_one_line_before_anything_is_written(
    command: Sequence[str],
    failure: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    first, *more = command
    assert main([first, BROKEN, "--failure", failure, "--duration", "0.2", *more]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"scenarios: '{BROKEN}': " in line
    assert list(tmp_path.iterdir()) == []
