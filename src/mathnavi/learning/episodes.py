"""Return and length of the episodes of many environments at once, and what a row receives when its episode ends."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

_FINAL = ("final_obs", "final_info")


class Episodes:
    """Return and length of the present episodes of n rows."""

    def __init__(self, count: int) -> None:
        """Begin to count."""
        self._began = time.perf_counter()
        self._return, self._length = np.zeros(count), np.zeros(count, dtype=np.int64)

    def begin(self) -> None:
        """Begin an episode in every row."""
        self._return[:] = 0.0
        self._length[:] = 0

    def step(self, rewards: Array, over: NDArray[np.bool_]) -> dict[int, dict[str, float]]:
        """The episodes that end, by row: return "r", steps "l", and time "t" [s] since these environments were made."""
        self._return += rewards
        self._length += 1
        now = time.perf_counter() - self._began
        ended = {
            int(i): {"r": float(self._return[i]), "l": int(self._length[i]), "t": now} for i in np.flatnonzero(over)
        }
        self._return[over] = 0.0
        self._length[over] = 0
        return ended


def check_resets(envs: VectorEnv[Any, Any, Any]) -> None:
    """Raise ArgumentError unless the next episode of a row begins in the step that ends the last one."""
    mode = envs.metadata.get("autoreset_mode")
    if mode is not AutoresetMode.SAME_STEP:
        raise ArgumentError(f"envs: autoreset_mode = {mode}; allowed: {AutoresetMode.SAME_STEP}")


def of_row(info: dict[str, Any], i: int) -> dict[str, Any]:
    """``info`` of row i out of that of all rows: what Gymnasium's masks say that it has."""
    found = {}
    for name, values in info.items():
        if name.startswith("_") or name in _FINAL:
            continue
        there = info.get(f"_{name}")
        if there is None or there[i]:
            found[name] = values[i]
    return found
