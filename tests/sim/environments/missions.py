"""Shared by the tests of environments: every scenario with short missions over small maps, built once."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

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
        "arm-velocity": {"start": (0.3, -0.2, 0.5, 1.0), "duration": 0.05, "settled": 0.0},
    }.get(scenario, {})


@cache
def commanded(scenario: str) -> EpisodeRunner:
    return EpisodeRunner(RunSpec.of(scenario, 1, fields=fields(scenario)))


def environment(scenario: str, seed: int = 1) -> Environment:
    """A fresh one, on a mission that is built once."""
    return Environment(commanded(scenario), np.random.default_rng(seed))
