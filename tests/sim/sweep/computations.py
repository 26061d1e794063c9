"""Functions that tests call as jobs."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.encoding import MeasuredTime


class Side(Enum):
    """Left or right."""

    LEFT = "l"
    RIGHT = "r"


class Pair(NamedTuple):
    """Two numbers."""

    a: float
    b: float


@dataclass(frozen=True)
class Walk:
    """A random walk."""

    steps: int
    seed: int
    scale: float = 1.0
    marks: str = ""  # a folder in which every call leaves a file
    wait: float = 0.0  # [s]


@dataclass(frozen=True, eq=False)
class Walked:
    """A random walk that was walked."""

    path: Array  # (n, 2)
    end: Pair
    side: Side
    by_key: dict[tuple[int, str], float]


def walked(walk: Walk, offset: float = 0.0) -> Walked:
    """The walk from an offset."""
    if walk.marks:
        Path(walk.marks, f"{walk.seed}-{time.time_ns()}-{os.getpid()}").touch()
    time.sleep(walk.wait)
    path = offset + walk.scale * np.cumsum(np.random.default_rng(walk.seed).standard_normal((walk.steps, 2)), axis=0)
    x, y = path[-1].tolist()
    by_key = {(walk.seed, "least"): float(path.min()), (walk.seed, "none"): np.inf}
    return Walked(path, Pair(x, y), Side.RIGHT if x > 0.0 else Side.LEFT, by_key)


def drawn_globally(count: int) -> list[float]:
    """Numbers of a generator that is not the function's own."""
    return np.random.random(count).tolist()


def returned(value: Any) -> Any:
    return value


def timed(n: int) -> dict[str, Any]:
    """A sum, and how long it took."""
    began = time.perf_counter()
    total = sum(range(n))
    return {"total": total, "taken_s": [MeasuredTime(time.perf_counter() - began)]}


def mishap(kind: str) -> str:
    """Ends as its argument demands, or successfully."""
    if kind == "raise":
        raise RuntimeError("out of order")
    if kind == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "hang":
        time.sleep(60.0)
    if kind == "object":
        return object()  # type: ignore[return-value]
    return kind


def process(_: int) -> int:
    return os.getpid()


def noted_and_asleep(place: str) -> None:
    Path(place).write_text(str(os.getpid()), encoding="utf-8")
    time.sleep(60.0)
