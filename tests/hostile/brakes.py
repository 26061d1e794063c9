"""Brakes: what takes long stops soon, so that an input that turns out to be good costs little."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from mathnavi.renders.film import Frame
from mathnavi.renders.palette import Picture

STEPS = 12  # control steps of a run
FRAMES = 3  # of a video
SMALL = 160, 90  # pixels of a frame that is drawn


def brakes(patch: pytest.MonkeyPatch, *, draws: bool = False) -> None:
    """Runs end after a few control steps, sweeps, searches and studies before the first trial, pictures are small.

    Unless it ``draws``, pictures are black and figures empty: what is drawn is read and checked before.
    """
    from mathnavi.commands import search, sweep
    from mathnavi.renders import clip, video
    from mathnavi.sim.scenarios import closed_loop
    from mathnavi.studies.framework import study

    patch.setattr(closed_loop, "simulate", _short(closed_loop.simulate))
    patch.setattr(sweep, "run_trials", _stopped)
    patch.setattr(search, "_search", _stopped)
    for name in ("run_trials", "run_jobs"):
        patch.setattr(study, name, _stopped)
    for module in (video, clip):
        patch.setattr(module, "draw", _draw if draws else _black)
    if not draws:
        patch.setattr(Figure, "savefig", _saved)
    encode = video.encode
    patch.setattr(video, "encode", lambda path, pictures, *size: encode(path, islice(pictures, FRAMES), *size))


def _short(simulate: Callable[..., Any]) -> Callable[..., Any]:
    def short(plant: Any, agents: Any, duration: float, finished: Callable[..., bool], *others: Any) -> Any:
        steps = 0

        def soon(t: float, truths: Mapping[str, Any]) -> bool:
            nonlocal steps
            steps += 1
            return finished(t, truths) or steps >= STEPS

        return simulate(plant, agents, duration, soon, *others)

    return short


def _stopped(*_: Any, **__: Any) -> Any:
    from mathnavi.sim.records.store import StoreWriteError

    raise StoreWriteError("stopped before the first trial")


def _draw(directory: Path, frames: Sequence[Frame], width: int, height: int, samples: int) -> Generator[Picture]:
    """The first frame in small, which reads the run and builds its scene, and black ones after it."""
    from tests.renders.drawn import draw_here

    next(draw_here(directory, frames[:1], *SMALL, 0))
    yield from _black(directory, frames, width, height, samples)


def _black(directory: Path, frames: Sequence[Frame], width: int, height: int, samples: int) -> Generator[Picture]:
    for _ in frames:
        yield np.zeros((height, width, 3), np.uint8)


def _saved(figure: Figure, file: IO[Any], format: str, **_: Any) -> None:
    if format == "svg":
        file.write("<svg></svg>")
    else:
        Image.new("L", (1, 1)).save(file, format)
