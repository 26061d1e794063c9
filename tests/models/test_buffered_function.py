"""A buffered function reads and writes the arrays that it was given, and only those that were asked for."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import casadi
import numpy as np
import pytest

from mathnavi.models.buffered_function import BufferedFunction, NumericFunction

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


def test_a_numeric_function_returns_matrices_row_by_row_with_their_zeros_and_keeps_none_of_them() -> None:
    slope = casadi.jacobian(casadi.vertcat(X[0] * Y, X[1], X[1] * Y), X)  # (3, 2) with three zeros
    f = NumericFunction(casadi.Function("f", [X, Y], [slope, X]))
    first, x = f(np.array([1.0, 2.0]), 3.0)
    f(np.array([1.0, 2.0]), 5.0)
    assert first.tolist() == [[3.0, 0.0], [0.0, 1.0], [0.0, 3.0]]
    assert x.tolist() == [[1.0], [2.0]]
    with pytest.raises(ValueError, match="zip"):
        f(np.array([1.0, 2.0]))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda f: pickle.loads(pickle.dumps(f))])
def test_a_copy_of_a_numeric_function_has_numbers_of_its_own(
    copied: Callable[[NumericFunction], NumericFunction],
) -> None:
    f = NumericFunction(SUM_AND_PRODUCT)
    total, product = copied(f)(np.array([1.0, 2.0]), 3.0)
    assert (total.ravel().tolist(), product.ravel().tolist()) == ([4.0, 5.0], [3.0, 6.0])
