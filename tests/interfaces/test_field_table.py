"""The table of a dataclass's fields says of each type, default and help what the source says."""

from __future__ import annotations

import dataclasses
from dataclasses import MISSING, dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import pytest

from mathnavi.interfaces.field_table import (
    Form,
    NumberList,
    Positional,
    ValueName,
    field_of,
    fields_of,
    flag_of,
    form_of,
    leaves_of,
    negation,
)
from tests.interfaces import elsewhere


class Colour(Enum):
    RED = 1
    GREEN = 2


@dataclass(frozen=True)
class Unit:
    name: str


@dataclass(frozen=True)
class Noise:
    rate: Annotated[float, Unit("Hz")] = 10.0  # of the readings [Hz]
    bias: float = 0.0
    """offset of a reading

    [m]"""


@dataclass(frozen=True)
class Config(elsewhere.Base):
    """Fields of every kind."""

    folder: Annotated[Path, Positional("DIR")]
    start: tuple[float, float] | None = None
    noise: Noise = field(default_factory=lambda: Noise(bias=1.0))
    from_: Annotated[str, ValueName("PLACE")] = ""
    kinds: ClassVar[tuple[str, ...]] = ()
    made: int = field(default=0, init=False)


INT, PAIR = ("INT", 1, False, ()), ("FLOAT FLOAT", 2, False, ())
FORMS: list[tuple[Any, tuple[str, int | None, bool, tuple[str, ...]]]] = [  # name, words, repeats, choices
    (int, INT),
    (int | None, INT),
    (Annotated[int, Unit("m")], INT),
    (Annotated[int | None, Unit("m")], INT),
    (Annotated[int, Unit("m")] | None, INT),
    (bool, ("{True,False}", 1, False, ("True", "False"))),
    (Literal["a", 2], ("{a,2}", 1, False, ("a", "2"))),
    (Colour, ("{RED,GREEN}", 1, False, ("RED", "GREEN"))),
    (tuple[float, float], PAIR),
    (tuple[float, float] | None, PAIR),
    (tuple[tuple[str, float], ...], ("STR FLOAT", 2, True, ())),
    (list[Literal["a", "b"]], ("{a,b}", 1, True, ("a", "b"))),
    (NumberList, ("FLOAT...", None, False, ())),
    (NumberList | None, ("FLOAT...", None, False, ())),
    (int | str, ("INT|STR", 1, False, ())),
    (Literal["all"] | int, ("{all}|INT", 1, False, ())),
    (Literal["all"] | bool, ("{all}|{True,False}", 1, False, ("all", "True", "False"))),
    (tuple[float, float] | float, ("FLOAT FLOAT|FLOAT", None, False, ())),
]


@pytest.mark.parametrize(("hint", "expected"), FORMS)
def test_a_type_says_which_words_it_takes(hint: Any, expected: tuple[str, int | None, bool, tuple[str, ...]]) -> None:
    form = form_of(hint)
    assert form.readable
    assert (form.value_name, form.count, form.repeats, form.choices) == expected


@pytest.mark.parametrize(
    "hint",
    [
        dict,
        tuple,
        dict[str, float],
        object,
        tuple[dict[str, int], ...],
        list[list[int]],
        tuple[NumberList, int],
        int | list[int],
    ],
)
def test_a_type_without_words_says_so(hint: Any) -> None:
    assert not form_of(hint).readable


def test_an_empty_word_is_no_place() -> None:
    with pytest.raises(ValueError, match="an empty word"):
        form_of(Path).read([""])


def test_a_mark_is_found_wherever_it_stands() -> None:
    mark = Unit("m")
    marked = Annotated[str, mark]
    for hint in (marked, marked | None, Annotated[str | None, mark], tuple[marked, ...], dict[str, list[marked]]):  # type: ignore[valid-type]
        assert form_of(hint).mark(Unit) is mark
    assert form_of(str).mark(Unit) is None


def test_a_table_has_every_field_with_its_own_module_s_names() -> None:
    table = {each.name: each for each in fields_of(Config)}
    assert list(table) == [each.name for each in dataclasses.fields(Config)]
    assert table["size"].form.kind is elsewhere.Size
    assert [name for name, each in table.items() if not each.init] == ["made"]
    assert field_of(Config, "noise").inner is Noise
    assert fields_of(Config) is fields_of(Config)
    with pytest.raises(KeyError):
        field_of(Config, "sice")


def test_a_field_that_is_declared_again_has_both_types() -> None:
    @dataclass(frozen=True)
    class Faster(Noise):
        rate: Annotated[float, Unit("1/s")] = 20.0

    assert [form.mark(Unit).name for form in field_of(Faster, "rate").declared] == ["Hz", "1/s"]
    assert len(field_of(Faster, "bias").declared) == 1


def test_leaves_have_flags_defaults_and_help() -> None:
    leaves = {each.path: each for each in leaves_of(Config, "part")}
    assert {path: (each.flag, each.default) for path, each in leaves.items()} == {
        "size": ("--part.size", MISSING),
        "folder": ("--part.folder", MISSING),
        "start": ("--part.start", None),
        "noise.rate": ("--part.noise.rate", 10.0),
        "noise.bias": ("--part.noise.bias", 1.0),
        "from_": ("--part.from", ""),
    }
    assert leaves["noise.rate"].help == "of the readings [Hz]"
    assert leaves["noise.bias"].help == "offset of a reading [m]"
    assert leaves["size"].help == "of the whole"
    assert leaves["folder"].positional
    assert (leaves["folder"].description.place, leaves["from_"].description.place) == ("DIR", "--part.from")
    assert leaves["noise.rate"].description.group == "part.noise"
    assert leaves["from_"].value_name == "PLACE"
    given = Config("large", Path("x"), noise=Noise(3.0))
    assert [each.default for each in leaves_of(Config, instance=given)] == ["large", Path("x"), None, 3.0, 0.0, ""]


@dataclass(frozen=True)
class Place:
    x: float = 0.0  # east [m]
    y: float = 0.0  # north [m]
    z: str = "#"  # height


def test_a_comment_ends_with_its_field() -> None:
    assert [each.help for each in fields_of(Place)] == ["east [m]", "north [m]", "height"]


def test_flags_and_their_negations() -> None:
    assert flag_of("planner.grid_nodes") == "--planner.grid-nodes"
    assert flag_of("noise_.from_") == "--noise.from"
    assert (negation("--warm"), negation("--planner.warm")) == ("--no-warm", "--planner.no-warm")


def test_annotations_need_not_be_texts() -> None:
    """From Python 3.14 on they are evaluated when they are asked for, and are not among the attributes of the class."""
    names: dict[str, Any] = {}
    source = "@dataclass\nclass Wind:\n    speed: Annotated[float, mark] = 1.0\n"
    mark = Unit("m/s")
    exec(
        compile(source, "wind.py", "exec", dont_inherit=True),
        {"dataclass": dataclass, "Annotated": Annotated, "mark": mark},
        names,
    )
    form: Form = field_of(names["Wind"], "speed").form
    assert (form.kind, form.marks) == (float, (mark,))
