"""Arguments that say which rows of a vector environment begin an episode, when, and from which seeds.

They are those of Gymnasium's ``SyncVectorEnv``.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from mathnavi.interfaces.errors import ArgumentError

RESET_MASK = "reset_mask"  # option of ``reset``: True for every row that begins an episode


def checked_options(options: Any, *known: str) -> Mapping[str, Any]:
    """Return the options of ``reset``, none for None; ArgumentError for one that is not ``known``."""
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ArgumentError(f"options = {options!r}; allowed: a mapping, or None")
    for name in options:
        if name not in known:
            raise ArgumentError(f"options: {name!r} is not known; allowed: {', '.join(known) or 'none'}")
    return options


def reset_rows(options: Any, count: int) -> NDArray[np.bool_]:
    """Return the mask (count,) of the rows that begin an episode: all, or those of the option ``reset_mask``.

    Raises ArgumentError for another option, and for a mask of another kind or length or without a row.
    """
    checked = checked_options(options, RESET_MASK)
    if RESET_MASK not in checked:
        return np.ones(count, dtype=np.bool_)
    mask = checked[RESET_MASK]
    allowed = f"allowed: an array of bool of shape ({count},) with at least one True"
    if not isinstance(mask, np.ndarray):
        raise ArgumentError(f"options: {RESET_MASK} is a {type(mask).__name__}; {allowed}")
    if mask.dtype != np.bool_ or mask.shape != (count,):
        raise ArgumentError(f"options: {RESET_MASK} is an array of {mask.dtype} of shape {mask.shape}; {allowed}")
    if not mask.any():
        raise ArgumentError(f"options: {RESET_MASK} is False in every row; {allowed}")
    return mask.copy()


def seeds_of_rows(seed: Any, count: int) -> list[int | None]:
    """Return a seed for each row: ``seed`` and those that follow it, those of a list, or None.

    Raises ArgumentError for what is no seed, and for a list of another length.
    """
    if seed is None:
        return [None] * count
    if isinstance(seed, (list, tuple, np.ndarray)):
        if len(seed) != count:
            raise ArgumentError(f"seed holds {len(seed)} seeds; allowed: {count}")
        return [None if own is None else _checked_seed(own) for own in seed]
    first = _checked_seed(seed)
    return [first + k for k in range(count)]


def checked_mode(mode: Any) -> AutoresetMode:
    """Return the mode of that name or value; ArgumentError if none exists."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(repr(each.value) for each in AutoresetMode)
        raise ArgumentError(f"autoreset_mode = {mode!r}; allowed: an AutoresetMode, or {names}") from None


def checked_limit(steps: Any) -> int | None:
    """Return the number of steps after which an episode is truncated; None for None and -1, as ``gymnasium.make``.

    Raises ArgumentError for what is no such number.
    """
    if steps is None:
        return None
    limit = _whole(steps)
    if limit is None or not (limit == -1 or limit >= 1):
        raise ArgumentError(f"max_episode_steps = {steps!r}; allowed: a whole number >= 1, or -1 or None for no limit")
    return None if limit == -1 else limit


def _checked_seed(seed: Any) -> int:
    found = _whole(seed)
    if found is None or found < 0:
        raise ArgumentError(f"seed = {seed!r}; allowed: whole numbers >= 0, or None")
    return found


def _whole(value: Any) -> int | None:
    """Return a whole number, of Python or NumPy, as an int; None for anything else."""
    if isinstance(value, (bool, np.bool_)):
        return None
    try:
        return operator.index(value)
    except TypeError:
        return None
