"""A buffered function reads and writes the arrays that it was given, and only those that were asked for."""

from __future__ import annotations

import casadi
import numpy as np

from mathnavi.models.buffered_function import BufferedFunction

X, Y = casadi.SX.sym("x", 2), casadi.SX.sym("y")
SUM_AND_PRODUCT = casadi.Function("f", [X, Y], [X + Y, X * Y])


def test_it_reads_its_arguments_anew_at_every_call() -> None:
    x, y, total, product = np.array([1.0, 2.0]), np.array([3.0]), np.zeros(2), np.zeros(2)
    evaluate = BufferedFunction(SUM_AND_PRODUCT, (x, y), (total, product))
    evaluate()
    assert (total.tolist(), product.tolist()) == ([4.0, 5.0], [3.0, 6.0])
    x[:], y[:] = (5.0, 7.0), 2.0
    evaluate()
    assert (total.tolist(), product.tolist()) == ([7.0, 9.0], [10.0, 14.0])


def test_it_outlives_the_names_of_its_arrays_and_leaves_out_what_nobody_asks_for() -> None:
    product = np.zeros(2)
    evaluate = BufferedFunction(SUM_AND_PRODUCT, (np.array([1.0, 2.0]), np.array([3.0])), (None, product))
    evaluate()
    assert product.tolist() == [3.0, 6.0]
