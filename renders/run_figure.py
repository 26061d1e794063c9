"""Figure that shows a run at a glance: the picture of a run in a notebook.

A drawing names the function that makes it of a run (``Drawing.figure``). A run whose drawing names none is shown by its
signals over time.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.signals import Array
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.figures import STYLE, canvas, thinned
from mathnavi.sim.records.run_folder import read_arrays

MOST_PANELS = 6


def run_figure(directory: str | Path) -> Figure:
    """The figure of the run in a folder, on white.

    Raises FileNotFoundError if a file is missing, ValueError if one is broken.
    """
    folder, drawing = Path(directory), drawing_of(directory)
    if drawing.figure is None:
        figure = signals_figure(read_arrays(folder))
    else:
        module, _, function = drawing.figure.partition(":")
        make: Callable[[Any], Figure] = getattr(importlib.import_module(module), function)
        figure = make(drawing.load_run(folder))
    figure.set_facecolor("white")
    return figure


def signals_figure(arrays: dict[str, Array]) -> Figure:
    """Figure of the first arrays (n, ...) of a log that have a row for each control step, over time [s]."""
    t = arrays["t"]
    names = [name for name, rows in arrays.items() if name != "t" and rows.ndim == 2 and len(rows) == len(t)]
    names = names[:MOST_PANELS]
    chosen = thinned(len(t), 0)
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 0.6 + 1.6 * max(1, len(names)))
        panels = np.atleast_1d(figure.subplots(max(1, len(names)), 1, sharex=True))
        for axes, name in zip(panels, names, strict=False):
            axes.plot(t[chosen], arrays[name][chosen])
            axes.set(title=name)
        panels[-1].set(xlabel="time [s]")
    return figure
