"""Pictures of a matplotlib figure by blitting: static artists are drawn once, moving ones over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mathnavi.renders.palette import Picture


class Blitted:
    """Figure of which some artists change from picture to picture."""

    def __init__(self, figure: Figure, moving: Sequence[Artist], dpi: float) -> None:
        figure.set_dpi(dpi)
        for artist in moving:
            artist.set_animated(True)
        self._figure, self._moving = figure, moving
        self._canvas = FigureCanvasAgg(figure)
        self._canvas.draw()  # type: ignore[no-untyped-call]
        self._still: Any = self._canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]

    def picture(self) -> Picture:
        """Draw the picture (height, width, 3) with the present artists."""
        self._canvas.restore_region(self._still)  # type: ignore[no-untyped-call]
        for artist in self._moving:
            self._figure.draw_artist(artist)
        pixels = self._canvas.buffer_rgba()  # type: ignore[no-untyped-call]
        return np.asarray(pixels)[..., :3].copy()
