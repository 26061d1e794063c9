"""Shared by the tests of environments: every scenario with short missions over small maps, built once."""

from __future__ import annotations

import tempfile
import unittest
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from dm_env import test_utils
from gymnasium.utils.env_checker import check_env

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.environments.dm import Environment
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.records.run_spec import RunSpec
from tests.flight import save

SCENARIOS = (
    "arm-velocity",
    "attitude-tracking",
    "missile-guidance",
    "quadrotor-canyon",
    "range-localisation",
    "safe-flight",
    "simultaneous-arrival",
    "sphere-observer",
    "textbook-observer",
)


@cache
def hills() -> str:
    """12 km of gentle hills between 300 and 700 m."""
    x, y = np.meshgrid(np.arange(121) * 100.0, np.arange(121) * 100.0)
    terrain = HeightField(500.0 + 200.0 * np.sin(x / 1500.0) * np.cos(y / 1700.0), 100.0, "hills")
    return save(terrain, Path(tempfile.mkdtemp()) / "hills.npz")


def fields(scenario: str) -> Mapping[str, Any]:
    """Fields of a mission that takes little to build."""
    flight = {"terrain": hills(), "target": (7000.0, 3000.0, 800.0)}
    return {
        "safe-flight": {**flight, "start": (3000.0, 3000.0, 800.0), "noise": {"position": 2.0}},
        "simultaneous-arrival": {"terrain": hills(), "vehicles": 2},
        "quadrotor-canyon": {"start": (300.0, 275.0, 1232.0), "target": (204.0, 303.0, 1232.0)},
        "arm-velocity": {"start": (0.3, -0.2, 0.5, 1.0), "duration": 0.05, "settled": 0.0},
    }.get(scenario, {})


@cache
def commanded(scenario: str) -> EpisodeRunner:
    return EpisodeRunner(RunSpec.of(scenario, 1, fields=fields(scenario)))


def environment(scenario: str, seed: int = 1) -> Environment:
    """A fresh one, on a mission that is built once."""
    return Environment(commanded(scenario), np.random.default_rng(seed))


ADVICE = ("is infinity", "is -infinity", "recommend using a symmetric and normalized space")
"""of the checker of Gymnasium, that does not hold here: states and forces have units, and some have no bounds"""


class BlankPictures:
    """Renderer that draws nothing, in place of one that needs OpenGL."""

    def __init__(self, width: int, height: int) -> None:
        self._shape = (height, width, 3)

    def drawn(self, _: EpisodeRunner) -> np.ndarray[Any, Any]:
        return np.zeros(self._shape, np.uint8)

    def close(self) -> None: ...


def assert_passes_dm_env(make: Callable[[], Any]) -> None:
    """What is made passes the checker of dm_env."""

    class Checked(test_utils.EnvironmentTestMixin, unittest.TestCase):
        def make_object_under_test(self) -> Any:
            return make()

    result = unittest.TestResult()
    unittest.defaultTestLoader.loadTestsFromTestCase(Checked).run(result)
    assert result.testsRun >= 4
    assert not [expected for _, expected in (*result.failures, *result.errors)]


def assert_passes_gymnasium(identifier: str, patch: pytest.MonkeyPatch) -> None:
    """What is made of that identifier passes the checker of Gymnasium, without a warning that holds here."""
    patch.setattr("mathnavi.sim.environments.gym.EpisodeRunner", lambda spec: commanded(spec.scenario))
    patch.setattr("mathnavi.sim.environments.gym.pictures", BlankPictures)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(gymnasium.make(identifier).unwrapped)
    assert not [str(each.message) for each in caught if not any(advice in str(each.message) for advice in ADVICE)]
