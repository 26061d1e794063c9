"""Shared drawings of the studies stay legible where curves and texts overlap."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from mathnavi.studies.framework.drawing import DARK, LIGHT, heat_map, paths_on_map, readable_on
from mathnavi.studies.framework.study import VEHICLE
from tests.flight import mountains

CHANNELS = st.floats(0.0, 1.0)


def contrast(one: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    def luminance(colour: tuple[float, float, float]) -> float:
        linear = np.where(
            np.array(colour) <= 0.04045, np.array(colour) / 12.92, ((np.array(colour) + 0.055) / 1.055) ** 2.4
        )
        return float(linear @ [0.2126, 0.7152, 0.0722])

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@given(st.tuples(CHANNELS, CHANNELS, CHANNELS))
def test_a_text_is_readable_on_every_ground(ground: tuple[float, float, float]) -> None:
    assert contrast(to_rgb(readable_on(ground)), ground) >= 4.0
    assert (
        contrast(to_rgb(readable_on(ground)), ground) >= max(contrast(to_rgb(c), ground) for c in (DARK, LIGHT)) - 1e-9
    )


def test_cells_without_a_value_look_as_their_text_says() -> None:
    axes = Figure().add_subplot()
    values = np.array([[1.0, np.nan, np.nan, np.nan]])
    texts = [["1", "refused", "", "odd"]]
    heat_map(axes, values, ["row"], list("abcd"), texts, decades=(2.0, 2.0), lacking={"refused": "#ff0000", "": "none"})
    cells = {round(patch.get_x()): patch.get_facecolor()[:3] for patch in axes.patches}
    assert cells.keys() == {0, 1, 3}
    assert cells[1] == (1.0, 0.0, 0.0)
    assert {text.get_text() for text in axes.texts} == {"1", "refused", "odd"}


def test_paths_on_top_of_each_other_are_all_seen() -> None:
    x = np.linspace([1e3, 2e3, 900.0, 0.0, 0.0, 0.0], [9e3, 8e3, 900.0, 0.0, 0.0, 0.0], 20)
    config = {"mission": {"radars": [], "start": x[0, :3].tolist(), "target": x[-1, :3].tolist()}}
    outcome = SimpleNamespace(recording=SimpleNamespace(truths={VEHICLE: x}), config=config)
    axes = Figure().add_subplot()
    paths_on_map(axes, mountains(), {name: (outcome, name) for name in ("red", "green", "blue")}, "paths")  # type: ignore[misc]
    paths = [line for line in axes.lines if line.get_label() in ("red", "green", "blue")]
    widths = [line.get_linewidth() for line in paths]
    assert [line.get_label() for line in paths] == ["red", "green", "blue"]
    assert all(before - after >= 1.0 for before, after in pairwise(widths))
    assert min(widths) >= 1.0
