"""Values come back from JSON and arrays as they were, bit for bit."""

from __future__ import annotations

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
    """Of the same types and, of numbers, the same bits; one NaN is as another."""
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
    with pytest.raises(ValueError, match="no class of data"):
        decoded(Encoded({"$class": "subprocess:Popen", "$fields": {"args": ["true"]}}))
