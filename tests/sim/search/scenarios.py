"""Scenarios without a vehicle, to be searched."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import Any

import numpy as np

from mathnavi.interfaces.bounds import Finite, configuration
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.sim.scenarios.redraw import ChanceFields, generator
from tests.sim.sweep.scenarios import Nobody


@configuration
class BowlConfig(ChanceFields):
    """A place in the bowl."""

    x: Finite = 0.0
    y: Finite = 0.0
    place: tuple[float, float] = (0.0, 0.0)
    colour: str = "blue"
    edge: float = 1e9
    """from which on x cannot be configured"""
    rim: float = 1e9
    """from which on there is no mission at x"""
    fire: float = 1e9
    """from which on y ends the process"""
    hole: float = 1e9
    """from which on nothing can be built at y"""
    times: int = 4
    """how many numbers are drawn"""

    def __post_init__(self) -> None:
        if self.x >= self.edge:
            raise FieldError(f"x = {self.x!r}; allowed: < {self.edge!r}")


class Bowl:
    """A bowl, lowest at (1, -2), with noise that makes a sum of normal numbers."""

    Config = BowlConfig
    controller = estimator = "tests.sim.sweep.scenarios:Nobody"

    @staticmethod
    def build(config: BowlConfig, seed: int, controller: Any = Nobody, estimator: Any = Nobody) -> Any:
        if config.x >= config.rim:
            raise MissionError(f"x = {config.x!r} is beyond the rim; allowed: < {config.rim!r}")

        if config.y >= config.hole:
            raise ValueError(f"y = {config.y!r} is in the hole; allowed: < {config.hole!r}")

        def run() -> Any:
            if config.y >= config.fire:
                os._exit(7)
            streams = generator(np.random.SeedSequence(seed), config.redraw).spawn(config.times)
            noise = sum(float(stream.standard_normal()) for stream in streams) / np.sqrt(config.times)
            if config.x == -4.0:
                raise ValueError("a defect in flight")
            height = (config.x - 1.0) ** 2 + (config.y + 2.0) ** 2 + config.place[1] ** 2 + (config.colour == "red")
            summary = {
                "height_m": height, "noise": noise, "deep": height < 0.1, "word": "bowl", "nothing": None,
                "lost": -np.inf, "solve_ms_mean": 1.0,
            }  # fmt: skip
            return SimpleNamespace(summary=summary, success=height >= 0.5, arrays={})

        return SimpleNamespace(run=run)
