"""A table of numbers as colours: what several studies of methods on problems draw."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm
from matplotlib.patches import Rectangle

from sim.signals import Array

GOOD, EVEN, BAD = "#0d5fa8", "#f4f1ea", "#b3202f"
COLOURS = LinearSegmentedColormap.from_list("worth", (GOOD, "#6fb0dc", EVEN, "#f0a07c", BAD))
EMPTY = "#c9ced4"
PALE = 0.55  # of the colours' range on either side of the middle, beyond which a text is white


def heat_map(
    axes: Axes,
    values: Array,
    names: Sequence[str],
    columns: Sequence[str],
    texts: Sequence[Sequence[str]],
    *,
    decades: tuple[float, float],
    framed: Sequence[tuple[int, int]] = (),
) -> ScalarMappable:
    """``values`` (rows, columns) > 0 as colours on a log scale around 1, good below it; NaN is grey.

    ``decades`` below and above 1 have colours of their own, what is beyond them looks like their ends. ``texts`` stand
    in the cells, ``framed`` cells (row, column) have a frame. Returns what a colour bar wants.
    """
    norm = TwoSlopeNorm(0.0, -decades[0], decades[1])
    logarithms = np.clip(np.log10(values), -decades[0], decades[1])
    shown = ScalarMappable(norm, COLOURS)
    for i, row in enumerate(logarithms):
        for j, value in enumerate(row):
            known = bool(np.isfinite(value))
            colour = COLOURS(norm(value)) if known else EMPTY
            axes.add_patch(Rectangle((j, i), 1.0, 1.0, facecolor=colour, edgecolor="white", lw=1.2))
            strong = known and abs(float(norm(value)) - 0.5) > 0.5 * PALE
            axes.text(
                j + 0.5, i + 0.5, texts[i][j], ha="center", va="center", fontsize=7.5,
                color="white" if strong else "#16202a",
            )  # fmt: skip
    for i, j in framed:
        axes.add_patch(Rectangle((j + 0.04, i + 0.05), 0.92, 0.9, fill=False, edgecolor="#16202a", lw=2.0, zorder=3))
    axes.set(xlim=(0, len(columns)), ylim=(len(names), 0))
    axes.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=28, ha="right", rotation_mode="anchor")
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    return shown
