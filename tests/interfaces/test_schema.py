"""Plain data is held to the type that a dataclass declares; an error names the place, the value and what is allowed."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from mathnavi.interfaces.bounds import Count, Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.fields import with_fields
from mathnavi.interfaces.schema import shortened, validated


class Side(Enum):
    LEFT = "left"
    RIGHT = "right"


@configuration
class Noise:
    rate: Positive = 1.0
    side: Side = Side.LEFT


@configuration
class Settings:
    margin: Positive = 1.0
    nodes: Count = 3
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radars: tuple[tuple[float, float], ...] = ()
    form: Literal["x", "z"] = "x"
    optional: Positive | None = None
    noise: Noise = field(default_factory=Noise)
    several: tuple[Noise, ...] = ()
    by_name: dict[str, float] = field(default_factory=dict)
    map: Path = Path("map.npz")
    video: bool = False


@dataclass(frozen=True)
class Document:
    planner: Settings


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"margin": "1"}, "$.planner.margin = '1'; allowed: float"),
        ({"margin": True}, "$.planner.margin = True; allowed: float"),
        ({"margin": -1}, "$.planner.margin = -1.0; allowed: a finite value > 0"),
        ({"margin": float("nan")}, "$.planner.margin = nan; allowed: a finite value > 0"),
        ({"nodes": 1.0}, "$.planner.nodes = 1.0; allowed: int"),
        ({"start": [1, 2]}, "$.planner.start = [1, 2]; allowed: 3 values"),
        ({"start": [1, 2, None]}, "$.planner.start[2] = None; allowed: float"),
        ({"radars": [[1, 2], [3, "4"]]}, "$.planner.radars[1][1] = '4'; allowed: float"),
        ({"form": "y"}, "$.planner.form = 'y'; allowed: x, z"),
        ({"optional": []}, "$.planner.optional = []; allowed: float"),
        ({"noise": 3}, "$.planner.noise = 3; allowed: an object of names and values"),
        ({"noise": {"rate": 0}}, "$.planner.noise.rate = 0.0; allowed: a finite value > 0"),
        ({"noise": {"side": "up"}}, "$.planner.noise.side = 'up'; allowed: left, right"),
        ({"noise": {"rat": 1}}, "$.planner.noise.rat is not a field; did you mean rate? allowed: rate, side"),
        ({"several": [{}, {"rat": 1}]}, "$.planner.several[1].rat is not a field"),
        ({"by_name": {"a": 1, "b": "c"}}, "$.planner.by_name['b'] = 'c'; allowed: float"),
        ({"map": 3}, "$.planner.map = 3; allowed: str"),
        ({"video": 1}, "$.planner.video = 1; allowed: true, false"),
        ({"by_name": {"a": 10**400}}, "allowed: a number that a double holds"),
    ],
)
def test_an_error_names_the_place_the_value_and_what_is_allowed(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(FieldError) as refused:
        validated(Document, {"planner": fields})
    assert message in str(refused.value)


def test_what_is_missing_is_named() -> None:
    with pytest.raises(FieldError, match=r"\$\.planner is missing; allowed: planner"):
        validated(Document, {})
    with pytest.raises(FieldError, match=r"\$ = \[\]; allowed: an object"):
        validated(Document, [])


def test_plain_data_becomes_an_instance() -> None:
    tree = {"margin": 2, "start": [1, 2, 3], "radars": [[1, 2]], "noise": {"side": "right"}, "map": "a/b.npz"}
    made = validated(Settings, tree)
    assert made == Settings(
        margin=2.0, start=(1.0, 2.0, 3.0), radars=((1.0, 2.0),), noise=Noise(side=Side.RIGHT), map=Path("a/b.npz")
    )
    assert isinstance(made.margin, float)


def test_other_names_are_let_pass_where_they_may_be() -> None:
    assert validated(Noise, {"rate": 2.0, "colour": "red"}, closed=False) == Noise(2.0)


def test_numbers_of_numpy_are_numbers() -> None:
    made = with_fields(Settings(), {"margin": np.float64(2.0), "start": (np.float64(1.0), 2, np.float32(3.0))})
    assert made == Settings(margin=2.0, start=(1.0, 2.0, 3.0))


def test_a_long_value_is_shown_without_its_middle() -> None:
    assert len(shortened("x" * 100_000)) < 200
    assert len(shortened([list(range(1000))] * 1000)) < 400
