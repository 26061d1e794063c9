"""Values come back from JSON and arrays as they were, bit for bit."""

from __future__ import annotations

import io
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mathnavi.interfaces.errors import StoreError
from mathnavi.sim.records.encoding import Encoded, MeasuredTime, decoded, encoded
from tests.sim.sweep.computations import Pair, Side, Walk

LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.sampled_from([Side.LEFT, Pair(1.0, -0.0), Walk(3, 1), Path("a/b"), np.float64(0.1), np.int64(3), np.bool_(1)]),
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.lists(inner, max_size=3).map(tuple),
        st.dictionaries(st.text(max_size=4), inner, max_size=3),
        st.dictionaries(st.tuples(st.integers(), st.text(max_size=2)), inner, max_size=3),
    ),
    max_leaves=12,
)


def there_and_back(value: Any) -> Any:
    coded = encoded(value)
    return decoded(Encoded(json.loads(json.dumps(coded.tree, allow_nan=False)), coded.arrays, coded.timings))


def same(a: Any, b: Any) -> bool:
    """True if both have the same types and, of numbers, the same bits; one NaN is as another."""
    if type(a) is not type(b):
        return False
    if isinstance(a, float):
        return struct.pack("d", a) == struct.pack("d", b) or (math.isnan(a) and math.isnan(b))
    if isinstance(a, dict):
        return list(map(str, a)) == list(map(str, b)) and all(map(same, a.values(), b.values()))
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


@given(VALUES)
def test_a_value_comes_back_with_its_types(value: Any) -> None:
    assert same(there_and_back(value), value)


@given(
    arrays(
        st.sampled_from([np.float64, np.float32, np.int64, np.bool_, np.complex128, np.uint8]),
        array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=6),
    )
)
def test_an_array_comes_back_with_its_type_and_shape(array: np.ndarray) -> None:
    found = there_and_back({"x": array})["x"]
    assert (found.dtype, found.shape) == (array.dtype, array.shape)
    np.testing.assert_array_equal(found, array)


def test_what_is_timed_stands_apart() -> None:
    coded = encoded({"J": 2.0, "times": [MeasuredTime(0.25), MeasuredTime(math.nan)]})
    assert "0.25" not in json.dumps(coded.tree)
    assert coded.timings == {"times[0]": 0.25, "times[1]": None}
    back = decoded(coded)["times"]
    assert [type(time) for time in back] == [MeasuredTime, MeasuredTime]
    assert back[0] == 0.25
    assert math.isnan(back[1])


class NoData:
    """Neither plain nor a dataclass."""


@pytest.mark.parametrize("value", [NoData(), {"a": [NoData()]}, lambda: 0, np.array([NoData()])])
def test_what_cannot_be_had_back_is_refused(value: Any) -> None:
    with pytest.raises(TypeError, match=r"NoData|function|objects"):
        encoded(value)


def test_a_file_cannot_have_anything_else_built() -> None:
    with pytest.raises(StoreError, match="not a class of data"):
        decoded(Encoded({"$class": "subprocess:Popen", "$fields": {"args": ["true"]}}))


def test_arrays_of_one_type_and_shape_are_one_array_of_the_block() -> None:
    """A run has a covariance every control step: read one by one, they took longer than the flight."""
    covariances = [np.full((6, 6), float(k)) for k in range(20_000)]
    coded = encoded({"covariances": covariances, "times": np.arange(100.0)})
    assert coded.arrays is not None
    with np.load(io.BytesIO(coded.arrays)) as block:
        assert sorted(array.shape for array in block.values()) == [(1, 100), (20_000, 6, 6)]
    back = decoded(coded)["covariances"]
    assert all((one == k).all() and one.shape == (6, 6) for k, one in enumerate(back))
    back[0][:] = np.nan
    assert (back[1] == 1.0).all()


def test_an_array_keeps_the_order_of_its_elements_in_memory() -> None:
    by_columns = np.asfortranarray(np.arange(60.0).reshape(6, 10))
    back = decoded(encoded([by_columns, by_columns.copy(order="C")]))
    assert back[0].flags.f_contiguous
    assert back[1].flags.c_contiguous
    np.testing.assert_array_equal(*back)


@pytest.mark.parametrize("row", [2, -1, 0.0, True, "0", None])
def test_a_row_that_is_not_there_is_refused(row: Any) -> None:
    arrays = encoded([np.zeros(40), np.ones(40)]).arrays
    with pytest.raises(StoreError, match=r"\$block row = .*; allowed: a whole number from 0 to 1"):
        decoded(Encoded({"$block": ["s0", row]}, arrays))


def test_a_result_whose_arrays_were_stored_one_by_one_is_read() -> None:
    block = io.BytesIO()
    np.savez_compressed(block, a0=np.arange(40.0))
    np.testing.assert_array_equal(decoded(Encoded({"$block": "a0"}, block.getvalue())), np.arange(40.0))


@pytest.mark.parametrize("array", [["<f8", [3], [1, 2]], ["<f8", [1], ["x"]], ["nonsense", [1], [1]]])
def test_a_forged_array_is_a_store_error(array: list[Any]) -> None:
    with pytest.raises(StoreError, match="not a stored result"):
        decoded(Encoded({"$array": array}))
