"""Style of all figures, for matplotlib's ``rc_context``: a transparent background, one ink, one colour for the grid.

A report replaces ``INK`` and ``GRID`` by the colours of the reader's light or dark theme. matplotlib is not imported
here.
"""

from __future__ import annotations

from typing import Any

INK, GRID = "#1b2733", "#b9c2cc"
BOUND = "#c2183b"
SERIES = ("#0d6bf2", "#e07b00", "#12a06b", "#c2185b", "#8a4fd0", "#7a8896")  # readable on light and dark background
STYLE: Any = {
    "font.size": 9.0,
    "font.family": "DejaVu Sans",
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.formatter.useoffset": False,  # numbers of an axis are read as they stand
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "figure.facecolor": "none",
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "svg.fonttype": "none",
}
