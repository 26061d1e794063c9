"""Figures of a sample show its statistics: every name, every limit, every bound."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from mathnavi.renders.page import inline_svg
from mathnavi.renders.statistics_figures import (
    bands_figure,
    distribution_figure,
    medians_figure,
    rates_figure,
    rates_figure_on,
    scatter_figure,
)
from mathnavi.sim.records.statistics import Band, median_band, rate

RNG = np.random.default_rng(0)


def bars(figure: Figure, panel: int) -> np.ndarray:
    """(n, 2) Ends of a panel's bars."""
    (lines,) = figure.axes[panel].collections
    return np.array([segment[:, 0] for segment in lines.get_segments()])


def test_a_rates_bar_spans_its_limits_and_that_of_none_its_upper_bound() -> None:
    rates = [rate(3, 200), rate(0, 200)]
    figure = rates_figure(["often", "never"], {"violations": rates, "arrivals": [rate(200, 200), rate(1, 2)]})
    expected = [[rates[0].low, rates[0].high], [0.0, rates[1].upper]]
    np.testing.assert_allclose(bars(figure, 0), 100.0 * np.array(expected))
    svg = inline_svg(figure, "rates", "rates")
    for word in ("often", "never", "violations", "arrivals"):
        assert word in svg


@pytest.mark.parametrize("rates", [[rate(0, 10_000)], [rate(10_000, 10_000)], [rate(5, 10), rate(0, 10)]])
def test_an_axis_of_rates_shows_every_bar_whole_and_no_impossible_rate(rates: list) -> None:
    axes = rates_figure([str(k) for k in range(len(rates))], {"event": rates}).axes[0]
    left, right = axes.get_xlim()
    spans = bars(axes.figure, 0)
    assert left <= spans.min()
    assert spans.max() <= right
    assert left >= 0.0 or right <= 100.0


def test_a_forest_plot_in_others_axes_says_in_words_what_it_shows() -> None:
    axes = Figure().add_subplot()
    rates_figure_on(axes, ["none"], [rate(0, 200)])
    assert [text.get_text() for text in axes.texts] == [rate(0, 200).text()]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["none"]


def test_medians_without_values_or_without_limits_leave_a_gap() -> None:
    known = median_band(RNG.normal(size=30), np.random.default_rng(0))
    alone = median_band([4.0], np.random.default_rng(0))
    figure = medians_figure(["known", "alone", "none"], {"path [m]": [known, alone, None]})
    dots = figure.axes[0].lines[0].get_xdata()
    np.testing.assert_allclose(dots, [known.median, 4.0, math.nan])
    assert "none" in inline_svg(figure, "medians", "medians")


def test_a_band_is_drawn_for_each_series_and_the_legend_names_them_once() -> None:
    bands = [median_band(RNG.normal(k, 1.0, 20), np.random.default_rng(0)) for k in range(3)]
    figure = bands_figure(
        [4, 7, 13], {"path [m]": {"a": bands, "b": [*bands[:2], None]}, "effort": {"a": bands, "b": bands}}, "nodes"
    )
    assert len(figure.axes[0].lines) == 2
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), [band.median for band in bands])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a", "b"]


def test_a_distribution_shows_its_least_value_and_the_bound() -> None:
    sample = np.append(RNG.uniform(80.0, 300.0, 5000), 51.0)
    axes = distribution_figure({"": sample}, "least clearance [m]", 50.0, "allowed 50 m").axes[0]
    x, y = axes.lines[0].get_data()
    assert x[0] == 51.0
    assert y[0] == pytest.approx(100.0 / 5001)
    assert y[-1] == 100.0
    assert len(x) < 1000
    assert [text.get_text() for text in axes.texts] == ["allowed 50 m"]


@pytest.mark.parametrize("lost", [False, True])
def test_what_is_far_above_the_others_does_not_squeeze_them(lost: bool) -> None:
    sample = np.array([*RNG.uniform(75.0, 90.0, 18), 417.6, 500.0, *([-math.inf] if lost else [])])
    axes = distribution_figure({"": sample}, "least clearance [m]", 50.0, "allowed 50 m").axes[0]
    left, right = axes.get_xlim()
    assert left < 50.0
    assert sample[sample < 400.0].max() < right < 200.0
    assert any(text.get_text().startswith(f"2 of {len(sample)} beyond, up to 500") for text in axes.texts)


def test_a_scatter_shows_every_trial_and_the_bins_bands() -> None:
    x = RNG.uniform(0.0, 4.0, 300)
    bands = [Band(1.0, 0.5, 1.5, 150), None, Band(9.0, 8.0, 10.0, 150)]
    figure = scatter_figure(x, {"error [m]": (x**2, bands)}, [0.0, 2.0, 3.0, 4.0], "gust")
    (points,) = figure.axes[0].lines
    assert len(points.get_xdata()) == 300
    _, medians = figure.axes[0].collections
    known = {tuple(segment.ravel()) for segment in medians.get_segments() if segment.size}
    assert known == {(0.0, 1.0, 2.0, 1.0), (3.0, 9.0, 4.0, 9.0)}  # each over its bin, not joined to the next


@pytest.mark.filterwarnings("error")
def test_what_is_infinite_stands_at_the_edge() -> None:
    sample = np.array([-math.inf, -math.inf, 10.0, 60.0])
    axes = distribution_figure({"": sample}, "least clearance [m]", 50.0, "allowed 50 m").axes[0]
    edge = axes.get_xlim()[0]
    x, share = axes.lines[0].get_data()
    assert edge < 10.0
    np.testing.assert_allclose([x[1], share[1]], [edge, 50.0])
    half = Band(20.0, -math.inf, 30.0, 4)
    ends = bars(medians_figure(["some", "none"], {"clearance [m]": [half, Band(10.0, 10.0, 10.0, 4)]}), 0)
    assert math.isfinite(ends[0, 0])
    assert ends[0, 0] < 10.0
    for figure in (
        bands_figure([1.0, 2.0], {"clearance [m]": {"": [half, half]}}, "gust [m/s^2]"),
        scatter_figure(np.arange(4.0), {"clearance [m]": (sample, [half, half])}, [0.0, 1.5, 3.0], "gust [m/s^2]"),
    ):
        area = figure.axes[0].collections[0]
        assert np.isfinite(area.get_paths()[0].vertices).all()
        assert area.get_paths()[0].vertices[:, 1].min() < 20.0
