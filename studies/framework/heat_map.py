"""A table of numbers as colours: what several studies of methods on problems draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm, to_rgb
from matplotlib.patches import Rectangle

from mathnavi.interfaces.signals import Array

GOOD, EVEN, BAD = "#0d5fa8", "#f4f1ea", "#b3202f"
COLOURS = LinearSegmentedColormap.from_list("worth", (GOOD, "#6fb0dc", EVEN, "#f0a07c", BAD))
EMPTY = "#c9ced4"
DARK, LIGHT = "#16202a", "white"  # of a text, whichever has the better contrast


def heat_map(
    axes: Axes,
    values: Array,
    names: Sequence[str],
    columns: Sequence[str],
    texts: Sequence[Sequence[str]],
    *,
    decades: tuple[float, float],
    framed: Sequence[tuple[int, int]] = (),
    lacking: Mapping[str, str] | None = None,
) -> ScalarMappable:
    """Draw ``values`` (rows, columns) > 0 as colours on a log scale around 1, good below it.

    NaN has the colour that ``lacking`` has for its text, "none" to leave the cell out, else grey. ``decades`` below and
    above 1 have colours of their own, values beyond them have the colours of their ends. ``texts`` stand in the cells,
    ``framed`` cells (row, column) have a frame. Returns what a colour bar wants.
    """
    norm = TwoSlopeNorm(0.0, -decades[0], decades[1])
    logarithms = np.clip(np.log10(values), -decades[0], decades[1])
    shown = ScalarMappable(norm, COLOURS)
    for i, row in enumerate(logarithms):
        for j, value in enumerate(row):
            known = bool(np.isfinite(value))
            fill = COLOURS(norm(value)) if known else (lacking or {}).get(texts[i][j], EMPTY)
            if fill == "none":
                continue
            colour = to_rgb(fill)
            axes.add_patch(Rectangle((j, i), 1.0, 1.0, facecolor=colour, edgecolor="white", lw=1.2))
            axes.text(
                j + 0.5, i + 0.5, texts[i][j], ha="center", va="center", fontsize=7.5, color=readable_on(colour)
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


def readable_on(colour: tuple[float, float, float]) -> str:
    """The colour of a text on a ground: that of the higher contrast, (L_light + 0.05) / (L_dark + 0.05) (WCAG 2)."""
    ground, dark = _luminance(colour) + 0.05, _luminance(to_rgb(DARK)) + 0.05
    return LIGHT if 1.05 / ground > ground / dark else DARK


def _luminance(colour: tuple[float, float, float]) -> float:
    """The relative luminance L of red, green and blue in [0, 1]."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
