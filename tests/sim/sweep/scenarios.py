"""Scenarios without a vehicle, for what a sweep has to live through."""

from __future__ import annotations

import os
import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np

from mathnavi.interfaces.input_files import InputFile, content_digest

DIGESTED: list[str] = []  # files whose digests were made


def digest(place: str) -> str:
    """Digest of a file, of which note is taken."""
    DIGESTED.append(place)
    return content_digest(place)


@dataclass(frozen=True)
class Part:
    """A nested group of fields."""

    share: float = 0.5
    count: int = 3

    def __post_init__(self) -> None:
        if not 0.0 <= self.share <= 1.0:
            raise ValueError(f"part.share = {self.share!r}; allowed: 0 to 1")


@dataclass(frozen=True)
class CoinConfig:
    """Action of the coin instead of falling."""

    bias: float = 0.5
    wait: float = 0.0  # [s]
    raise_at: tuple[int, ...] = ()  # seeds
    exit_at: tuple[int, ...] = ()
    segfault_at: tuple[int, ...] = ()
    die_at: tuple[int, ...] = ()
    hang_at: tuple[int, ...] = ()
    well_once: str = ""  # a folder; as soon as it is there, seeds neither crash nor hang
    refuse_gain: float = 1e9  # of the controller, from which the coin cannot be built
    chatter: bool = False
    marks: str = ""  # a folder in which every trial that begins leaves a file
    table: Annotated[str, InputFile(digest)] = ""
    part: Part = field(default_factory=Part)


class Coin:
    """A coin that falls as the seed has it."""

    Config = CoinConfig
    controller = "tests.sim.sweep.scenarios:Nobody"
    estimator = "tests.sim.sweep.scenarios:Nobody"

    @staticmethod
    def build(config: CoinConfig, seed: int, controller: Any, estimator: Any) -> Any:
        if controller.config.gain >= config.refuse_gain:
            raise ValueError(f"planner.gain = {controller.config.gain!r}; allowed: less than {config.refuse_gain!r}")

        def run() -> Any:
            if config.marks:
                Path(config.marks, f"{seed}-{time.time_ns()}-{os.getpid()}").touch()
            if config.chatter:
                print("nonsense\n" * 1000, flush=True)
                os.write(1, b"\x80\x04more nonsense")
            ill = not (config.well_once and Path(config.well_once).exists())
            if ill and seed in config.hang_at:
                time.sleep(3600.0)
            if seed in config.raise_at:
                raise RuntimeError(f"seed {seed} is out of order")
            if seed in config.exit_at:
                sys.exit("enough")
            if ill and seed in config.segfault_at:
                print("last words", file=sys.stderr)
                os.kill(os.getpid(), signal.SIGSEGV)
            if ill and seed in config.die_at:
                os._exit(7)
            time.sleep(config.wait)
            x = float(np.random.default_rng(seed).random())
            stray = float(np.random.random())  # from a generator that is not its own
            summary = {"heads": x < config.bias, "x_m": x, "stray": stray, "least_m": -np.inf, "mean": np.nan}
            wall = {"real_time_factor": time.perf_counter()}
            return SimpleNamespace(summary={**summary, **wall, "seed": seed}, success=bool(x < config.bias), arrays={})

        return SimpleNamespace(run=run)


class Nobody:
    """Neither a controller nor an estimator, where none is needed."""

    @dataclass(frozen=True)
    class Config:
        """Nothing that anyone asks for."""

        gain: float = 1.0

    build = sensors = quality = staticmethod(lambda config, mission: None)


class Somebody(Nobody):
    """Another one of that kind."""


def twice(outcome: Any) -> dict[str, Any]:
    """A measure."""
    return {"twice_x_m": 2.0 * outcome.summary["x_m"]}


SLOW = """
from dataclasses import dataclass
from types import SimpleNamespace

import numba
import numpy as np

from tests.sim.sweep.scenarios import Coin


@numba.njit
def slow(x):
    return np.linalg.norm(x)


class Slow:
    '''Compiles for a while, and then does nothing.'''

    Config, controller, estimator = Coin.Config, Coin.controller, Coin.estimator

    @staticmethod
    def build(config, seed, controller, estimator):
        slow(np.arange(3.0))
        return SimpleNamespace(run=lambda: SimpleNamespace(summary={}, success=True))
"""
