"""Render modes of an environment, and what draws its episodes, which is found by its entry point."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.entry_points import entry_points_of, named
from mathnavi.interfaces.errors import ArgumentError, PluginError
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.plugin.groups import PICTURES

RENDER_MODES = ("rgb_array", "human")
FPS = 30  # [1/s] pictures of a window
WIDTH, HEIGHT = 640, 480  # [pixels] if not given
_LEAST, _MOST = 16, 8192  # [pixels]

Pixels = NDArray[np.uint8]


class Pictures(Protocol):
    """Renderer of episodes, which keeps its resources from one picture to the next."""

    def drawn(self, episode: EpisodeRunner) -> Pixels:
        """Draw the picture (height, width, 3) of the present state; NoOpenGLError if OpenGL is not available."""
        ...

    def show(self, episode: EpisodeRunner) -> None:
        """Show the present state in a window."""
        ...

    def close(self) -> None:
        """Free the resources and close the window."""
        ...


def pictures(width: int, height: int) -> Pictures:
    """Return a new renderer of pictures of this size [pixels], of the installed entry point "episode".

    Raises PluginError if none exists, or more than one.
    """
    point = named(entry_points_of(PICTURES), "pictures", "episode")
    if point is None:
        raise PluginError(f"nothing that draws episodes is installed; allowed: an entry point 'episode' of {PICTURES}")
    made: Pictures = point.load()(width, height)
    return made


def checked_mode(render_mode: str | None) -> str | None:
    """Return the render mode; ArgumentError for an unknown one."""
    if render_mode is not None and render_mode not in RENDER_MODES:
        raise ArgumentError(f"render_mode = {render_mode!r}; allowed: {', '.join(RENDER_MODES)}, or None")
    return render_mode


def checked_size(width: Any, height: Any) -> tuple[int, int]:
    """Return a size [pixels] as Python's integers; ArgumentError for one in which no picture is drawn."""
    for name, value in (("width", width), ("height", height)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not _LEAST <= value <= _MOST:
            raise ArgumentError(f"{name} = {value!r}; allowed: a whole number from {_LEAST} to {_MOST} pixels")
    return int(width), int(height)
