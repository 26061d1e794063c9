"""The study ``consensus`` measures what the theory predicts, and detects deviations from it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.studies.fleet.consensus import WITHIN
from mathnavi.studies.fleet.message_exchange import (
    FAR,
    SLOW,
    DelayCase,
    H,
    LinkCase,
    OutlierCase,
    RateCase,
    delayed,
    disagreement,
    graph_of,
    laplacians,
    names_of,
    over_links,
    rate_on,
    slope,
    with_outlier,
)


def test_in_short_rounds_the_rate_is_the_connectivity_and_in_long_ones_it_is_not() -> None:
    short, long = rate_on(RateCase("ring", 4, 0)), rate_on(RateCase("ring", 4, 0, 1.0))
    assert short["lambda_2"] == pytest.approx(2.0)
    assert short["rate"] / short["lambda_2"] == pytest.approx(-math.log(1.0 - SLOW) / SLOW, abs=1e-3)
    assert abs(long["rate"] / long["lambda_2"] - 1.0) > WITHIN
    assert short["average_moved"] < 1e-9
    assert short["rounds_to_maximum"] <= short["diameter"] == 2


@pytest.mark.parametrize("fraction", [0.9, 1.5])
def test_a_delay_decays_or_grows_at_the_rate_of_the_dominant_root(fraction: float) -> None:
    found = delayed(DelayCase(fraction, "then"))
    assert found["rate"] == pytest.approx(found["predicted"], rel=0.03)
    assert (found["rate"] > 0.0) == (fraction < 1.0)
    assert found["average_moved"] < 1e-9


def test_switching_decays_at_least_as_the_slowest_of_its_graphs() -> None:
    found = over_links(LinkCase("switching", 0))
    assert found["least"] > found["reference"] == pytest.approx(2.0 - 2.0 * math.cos(math.pi / 8.0))


def test_graphs_of_which_none_is_connected_agree_at_the_rate_of_their_mean() -> None:
    found = over_links(LinkCase("matchings", 0))
    assert found["rate"] == pytest.approx(found["reference"], rel=0.05)


def test_an_outlier_moves_the_others_by_one_round_of_what_it_hears_and_no_more() -> None:
    found = with_outlier(OutlierCase(400, steps=2))
    starts = found["values"][400]
    heard = 0.5 * (starts[FAR - 1] + starts[FAR + 1])
    amount = 60.0 * 5.0 / 3.0 / 400  # s h, on two links
    # Its first value lags the others' by a round, what it gives and takes afterwards adds up to nothing.
    assert found["shift"] == pytest.approx(2.0 * amount * (heard - found["agreed"][1]) / 7.0, rel=0.02)
    assert list(found["follows"]) == [False, True]
    assert found["everybody"][1] - found["others"][1] > 15.0


def test_the_slope_is_that_of_the_logarithm() -> None:
    t = np.linspace(0.0, 3.0, 7)
    assert slope(t, 5.0 * np.exp(-0.7 * t)) == pytest.approx(-0.7)
    np.testing.assert_allclose(disagreement(np.array([[1.0, 3.0], [2.0, 2.0]])), [math.sqrt(2.0), 0.0])


def test_random_graphs_of_a_seed_are_the_same_and_vehicles_have_names() -> None:
    np.testing.assert_array_equal(graph_of("random", 8, 3).weights, graph_of("random", 8, 3).weights)
    assert names_of(11)[-1] == "vehicle-10"
    assert len(laplacians(graph_of("line", 4), [1.0] * 4, period=H)) == 4
