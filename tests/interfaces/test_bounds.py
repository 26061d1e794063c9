"""Bounds declared with the fields: what is accepted, and what is said of what is not."""

from __future__ import annotations

import dataclasses
import math
import pickle
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from annotated_types import Ge, Gt, Interval, Le, Lt
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.bounds import (
    ANEW,
    FINITE,
    FINITE_NUMBERS,
    MOST_IN_MEMORY,
    MOST_TO_COMPUTE,
    Count,
    CountInMemory,
    Each,
    Finite,
    Fraction,
    NonNegative,
    Positive,
    PositiveFraction,
    Probability,
    Seed,
    TickRate,
    Within,
    configuration,
    declared,
    whole_ticks,
)
from mathnavi.interfaces.errors import FieldError


@configuration
class Gains:
    k_p: Positive = 1.0
    damping: Annotated[float, Interval(gt=0.0, le=1.0), FINITE] = 0.7
    timeout: Positive | None = None
    nodes: Annotated[int, Interval(ge=2, le=60)] = 13
    form: Literal["x", "z"] = "x"
    weights: Annotated[tuple[float, ...], Each(Ge(0.0), FINITE)] = ()
    start: Annotated[tuple[float, ...], FINITE_NUMBERS] = ()
    periods: Annotated[Count, Within(Interval(ge=3, le=9))] = 5
    share: Annotated[float, Within(Lt(0.5), allowed="less than a half")] = 0.1
    anything: object = math.inf


@configuration(prefix="{name} sensor: ", eq=False)
class Sensor:
    noise: NonNegative = 0.0
    name: str = "position"


@configuration
class Ordered:
    low: Finite = 0.0
    high: Finite = 1.0

    def __post_init__(self) -> None:
        if self.high < self.low:
            raise FieldError(f"high = {self.high!r}; allowed: >= {self.low:g}")


@configuration
class Scaled(Ordered):
    scale: Positive = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scale > self.high:
            raise FieldError(f"scale = {self.scale!r}; allowed: <= {self.high:g}")


@dataclass(frozen=True)
class Named(Scaled):
    """A plain dataclass made of a configuration."""

    name: Annotated[str, "no bound"] = ""

    def __post_init__(self) -> None:
        super().__post_init__()


@configuration
class Narrower(Scaled):
    """Another default and another bound for fields of the base."""

    low: float = -1.0
    scale: Annotated[float, Le(0.5)] = 0.25


@configuration
class Wider(Narrower):
    """Bounds in the place of those of the base classes."""

    scale: Annotated[NonNegative, Le(9.0), ANEW] = 0.25

    def __post_init__(self) -> None:
        """Without the relation of the base."""


@configuration(prefix="wider.")
class StillWider(Wider):
    """They are inherited too."""

    scale: float = 2.0


class Plain(Scaled):
    """Not even that."""


@pytest.mark.parametrize(
    ("made", "fields", "message"),
    [
        (Gains, {"k_p": 0.0}, "k_p = 0.0; allowed: a finite value > 0"),
        (Gains, {"k_p": math.inf}, "k_p = inf; allowed: a finite value > 0"),
        (Gains, {"k_p": math.nan}, "k_p = nan; allowed: a finite value > 0"),
        (Gains, {"damping": 1.5}, "damping = 1.5; allowed: a finite value > 0 and <= 1"),
        (Gains, {"timeout": -1.0}, "timeout = -1.0; allowed: a finite value > 0"),
        (Gains, {"nodes": 1}, "nodes = 1; allowed: a whole number from 2 to 60"),
        (Gains, {"nodes": 61}, "nodes = 61; allowed: a whole number from 2 to 60"),
        (Gains, {"form": "y"}, "form = 'y'; allowed: x, z"),
        (Gains, {"weights": (1.0, -2.0)}, "weights = -2.0; allowed: a finite value >= 0"),
        (Gains, {"start": (1.0, math.nan)}, "start = (1.0, nan); allowed: finite numbers"),
        (Gains, {"periods": 0}, "periods = 0; allowed: a whole number from 1 to 100000"),
        (Gains, {"periods": 2}, "periods = 2; allowed: a whole number from 3 to 9"),
        (Gains, {"share": 0.5}, "share = 0.5; allowed: less than a half"),
        (Gains, {"nodes": 0, "k_p": 0.0}, "k_p = 0.0; allowed: a finite value > 0"),  # the first that is declared
        (Sensor, {"noise": -1.0}, "position sensor: noise = -1.0; allowed: a finite value >= 0"),
        (Sensor, {"noise": -1.0, "name": "speed"}, "speed sensor: noise = -1.0; allowed: a finite value >= 0"),
        (Ordered, {"low": 2.0}, "high = 1.0; allowed: >= 2"),
        (Ordered, {"low": math.inf}, "low = inf; allowed: a finite number"),  # each field before several together
        (Scaled, {"low": 2.0, "scale": 0.0}, "scale = 0.0; allowed: a finite value > 0"),
        (Scaled, {"low": 2.0, "scale": 9.0}, "high = 1.0; allowed: >= 2"),
        (Scaled, {"scale": 9.0}, "scale = 9.0; allowed: <= 1"),
        (Narrower, {"low": math.nan}, "low = nan; allowed: a finite number"),
        (Narrower, {"scale": 0.0}, "scale = 0.0; allowed: a finite value > 0"),
        (Narrower, {"scale": 0.75}, "scale = 0.75; allowed: a value <= 0.5"),
        (Wider, {"scale": -1.0}, "scale = -1.0; allowed: a finite value >= 0 and <= 9"),
        (Wider, {"scale": 9.5}, "scale = 9.5; allowed: a finite value >= 0 and <= 9"),
        (Wider, {"low": math.nan}, "low = nan; allowed: a finite number"),
        (StillWider, {"scale": 9.5}, "wider.scale = 9.5; allowed: a finite value >= 0 and <= 9"),
        (Named, {"scale": -1.0}, "scale = -1.0; allowed: a finite value > 0"),
        (Plain, {"scale": -1.0}, "scale = -1.0; allowed: a finite value > 0"),
    ],
)
def test_a_field_out_of_its_bounds_is_named_with_its_value_and_what_is_allowed(
    made: Any, fields: dict[str, Any], message: str
) -> None:
    with pytest.raises(FieldError) as refused:
        made(**fields)
    assert str(refused.value) == message


@pytest.mark.parametrize("made", [Gains, Sensor, Ordered, Scaled, Narrower, Named, Plain])
def test_a_configuration_is_a_frozen_dataclass(made: Any) -> None:
    assert "__dataclass_fields__" in vars(made.__mro__[-2])
    one: Any = made()
    assert vars(made.__mro__[-2])["__dataclass_params__"].frozen
    entry = dataclasses.fields(one)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(one, entry, 2.0)
    again = pickle.loads(pickle.dumps(one))
    assert dataclasses.asdict(again) == dataclasses.asdict(one)
    with pytest.raises(FieldError):
        dataclasses.replace(one, **{entry: math.nan})


def test_equality_is_that_of_a_dataclass() -> None:
    assert Gains(k_p=2.0) == Gains(k_p=2.0)
    assert len({Gains(k_p=2.0), Gains(k_p=2.0), Gains()}) == 2
    assert Sensor() != Sensor()  # eq=False


def test_what_is_not_optional_cannot_be_none() -> None:
    assert Gains(timeout=None).timeout is None
    with pytest.raises(FieldError, match="k_p = None; allowed: a finite value > 0"):
        Gains(k_p=None)  # type: ignore[arg-type]


def test_each_bound_of_a_field_is_declared_once() -> None:
    assert [bound.name for bound in declared(Scaled)] == ["low", "high", "scale"]
    assert [bound.name for bound in declared(Sensor)] == ["noise"]


ALIASES: list[tuple[Any, Any]] = [  # and what each stands for
    (Finite, lambda value: math.isfinite(value)),
    (Positive, lambda value: 0.0 < value < math.inf),
    (NonNegative, lambda value: 0.0 <= value < math.inf),
    (Fraction, lambda value: 0.0 <= value <= 1.0),
    (PositiveFraction, lambda value: 0.0 < value <= 1.0),
    (Probability, lambda value: 0.0 < value < 1.0),
    (Count, lambda value: 1 <= value <= MOST_TO_COMPUTE),
    (CountInMemory, lambda value: 1 <= value <= MOST_IN_MEMORY),
    (Seed, lambda value: 0 <= value < 2**63),
]
NUMBERS = st.one_of(
    st.floats(),
    st.floats(-2.0, 2.0),
    st.integers(-3, 3),
    st.integers(),
    st.sampled_from([MOST_IN_MEMORY, MOST_IN_MEMORY + 1, 250.0, 500.0, 500.1, 125.0]),
)


def accepted(kind: Any, value: Any) -> bool:
    made: Any = configuration(type("One", (), {"__annotations__": {"value": kind}}))
    try:
        made(value)
    except FieldError as refused:
        return not str(refused).startswith(f"value = {value!r}; allowed: ") and pytest.fail(str(refused))
    return True


@pytest.mark.parametrize(("kind", "holds"), ALIASES, ids=lambda pair: getattr(pair, "__name__", str(pair)))
@given(value=NUMBERS)
def test_an_alias_accepts_what_it_stands_for(kind: Any, holds: Any, value: float) -> None:
    of_type = isinstance(value, int) or typing.get_args(kind)[0] is float
    assert accepted(kind, value) == (of_type and holds(value))


@given(
    value=st.one_of(st.floats(), st.floats(-10.0, 10.0)),
    low=st.floats(-8.0, 8.0),
    high=st.floats(-8.0, 8.0),
    low_is_open=st.booleans(),
    high_is_open=st.booleans(),
)
def test_a_bound_accepts_exactly_the_declared_interval(
    value: float, low: float, high: float, low_is_open: bool, high_is_open: bool
) -> None:
    interval = Interval(
        gt=low if low_is_open else None, ge=None if low_is_open else low,
        lt=high if high_is_open else None, le=None if high_is_open else high,
    )  # fmt: skip
    inside = (low < value if low_is_open else low <= value) and (value < high if high_is_open else value <= high)
    for end in (low, high, value):
        held = (low < end if low_is_open else low <= end) and (end < high if high_is_open else end <= high)
        assert accepted(Annotated[float, interval], end) == held
    one_by_one = Annotated[
        float, Gt(low) if low_is_open else Ge(low), Lt(high) if high_is_open else Le(high), FINITE
    ]  # fmt: skip
    assert accepted(one_by_one, value) == inside
    assert accepted(one_by_one | None, None)


@given(value=st.from_type(Positive) | st.from_type(Fraction).filter(bool))
def test_other_tools_read_the_bounds_too(value: float) -> None:
    """hypothesis draws what is allowed, for the metadata are those of annotated-types."""
    assert accepted(Positive, value)


@given(ticks=st.integers(1, 10**4), tick=st.sampled_from([1e-4, 2e-3, 1 / 60]))
def test_a_period_of_whole_ticks(ticks: int, tick: float) -> None:
    rate = Annotated[float, TickRate(tick)]
    assert accepted(rate, 1.0 / (ticks * tick))
    for wrong in (1.0 / ((ticks + 0.5) * tick), 1.001 / tick, 0.0, -1.0 / (ticks * tick), math.inf, math.nan):
        assert not accepted(rate, wrong)


@given(ticks=st.integers(0, 10**6), tick=st.sampled_from([1e-4, 2e-3, 1 / 60]))
def test_whole_ticks(ticks: int, tick: float) -> None:
    bound = Annotated[float, whole_ticks(tick)]
    assert accepted(bound, ticks * tick)
    assert not accepted(bound, (ticks + 0.5) * tick)


def test_a_value_of_numpy_is_shown_as_it_is() -> None:
    with pytest.raises(FieldError, match=r"k_p = np.float64\(-1.0\); allowed: "):
        Gains(k_p=np.float64(-1.0))


@dataclass(frozen=True)
class Nothing(Scaled):
    """No fields of its own."""


def test_bounds_that_are_declared_anew_may_be_wider() -> None:
    assert Wider(scale=0.0).scale == 0.0
    assert StillWider(scale=9.0).scale == 9.0


def test_a_subclass_without_fields_of_its_own_keeps_the_bounds() -> None:
    with pytest.raises(FieldError, match=r"scale = 0\.0; allowed: a finite value > 0"):
        Nothing(scale=0.0)


def test_bounds_hold_in_a_module_whose_annotations_are_not_texts() -> None:
    """From Python 3.14 on they are evaluated when they are asked for, and are not among the attributes of the class."""
    names: dict[str, Any] = {}
    source = "@configuration\nclass Wind:\n    speed: NonNegative = 1.0\n"
    exec(
        compile(source, "wind.py", "exec", dont_inherit=True),
        {"configuration": configuration, "NonNegative": NonNegative},
        names,
    )
    with pytest.raises(ValueError, match=r"speed = -1\.0"):
        names["Wind"](speed=-1.0)


@configuration
class _OfEachKind:
    name: str = "a"
    path: str | None = None
    whole: int = 1
    share: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.5
    count: Annotated[int, Ge(1)] = 3
    on: bool = False
    point: tuple[float, float] = (0.0, 0.0)
    times: tuple[float, ...] = ()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"name": 5}, "name = 5; allowed: a text"),
        ({"path": Path("a")}, f"path = {Path('a')!r}; allowed: a text"),
        ({"path": True}, "path = True; allowed: a text"),
        ({"whole": 2.5}, "whole = 2.5; allowed: a whole number"),
        ({"whole": True}, "whole = True; allowed: a whole number"),
        ({"share": "0.5"}, "share = '0.5'; allowed: a value >= 0 and <= 1"),
        ({"share": None}, "share = None; allowed: a value >= 0 and <= 1"),
        ({"count": 2.0}, "count = 2.0; allowed: a whole number >= 1"),
        ({"on": "yes"}, "on = 'yes'; allowed: True, False"),
        ({"on": 1}, "on = 1; allowed: True, False"),
        ({"point": 3.0}, "point = 3.0; allowed: a sequence of 2 values"),
        ({"point": (1.0, 2.0, 3.0)}, "point = (1.0, 2.0, 3.0); allowed: a sequence of 2 values"),
        ({"point": (1.0, "2")}, "point = (1.0, '2'); allowed: a sequence of 2 values"),
        ({"times": "0 1"}, "times = '0 1'; allowed: a sequence of values"),
        ({"times": 1.0}, "times = 1.0; allowed: a sequence of values"),
    ],
)
def test_a_value_of_another_type_is_refused_before_it_is_compared(given: Any, message: str) -> None:
    with pytest.raises(FieldError) as refused:
        _OfEachKind(**given)
    assert str(refused.value) == message


def test_numbers_of_numpy_and_whole_ones_for_real_ones_are_accepted() -> None:
    made = _OfEachKind(whole=np.int64(3), share=1, count=np.int32(2), on=np.True_, path=None, point=np.zeros(2))  # type: ignore[arg-type]
    assert (made.whole, made.share, made.count, made.on, tuple(made.point)) == (3, 1, 2, True, (0.0, 0.0))
