"""Words become the fields of a dataclass, whatever their types, and a wrong word is refused in one line."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from mathnavi.commands.arguments import FlagGroup, flags, parse
from mathnavi.commands.errors import BadInputError, HelpPrinted
from mathnavi.interfaces.field_table import NumberList, Positional


class Colour(Enum):
    RED = 1
    GREEN = 2


@dataclass(frozen=True)
class Inner:
    rate: float = 1.0
    warm: bool = True

    def __post_init__(self) -> None:
        if self.rate < 0.0:
            raise ValueError(f"rate = {self.rate}; allowed: >= 0")


@dataclass(frozen=True)
class Special(Inner):
    extra: float = 3.0


@dataclass(frozen=True)
class Fields:
    count: int = 1
    name: str = ""
    path: Path | None = None
    colour: Colour = Colour.RED
    shape: Literal["round", "square"] = "round"
    size: Literal["small", "large"] | None = None
    point: tuple[float, float] = (0.0, 0.0)
    corner: tuple[float, float] | None = None
    """x, y [m]; none if not given"""
    boxes: tuple[tuple[str, int], ...] = (("first", 1),)
    names: list[str] = field(default_factory=list)
    numbers: NumberList = ()
    either: int | str = 0
    several: tuple[float, float] | float = 0.0
    nested: tuple[tuple[int, int], str] = ((0, 0), "")
    limit: Annotated[float, "a mark"] = 1.0
    table: dict[str, float] = field(default_factory=dict)
    inner: Inner = Inner()
    special: Inner = Special(extra=4.0)
    made: int = field(default=5, init=False)


def read(*argv: str, schema: type = Fields, prefix: str = "", default: Any = None) -> Any:
    (fields,) = parse(argv, "mathnavi test", "", FlagGroup(schema, prefix, default))
    return fields


@pytest.mark.parametrize(
    ("argv", "name", "value"),
    [
        ("--count 3", "count", 3),
        ("--count=-3", "count", -3),
        ("--count -3", "count", -3),
        ("--name=--odd", "name", "--odd"),
        ("--name=", "name", ""),
        ("--path a/b", "path", Path("a/b")),
        ("--colour GREEN", "colour", Colour.GREEN),
        ("--shape square", "shape", "square"),
        ("--size large", "size", "large"),
        ("--point 1 -2.5e3", "point", (1.0, -2500.0)),
        ("--point=1 2", "point", (1.0, 2.0)),
        ("--corner 1 2", "corner", (1.0, 2.0)),
        ("--boxes second 2 --boxes third 3", "boxes", (("first", 1), ("second", 2), ("third", 3))),
        ("--names a --names b", "names", ["a", "b"]),
        ("--numbers 1 -2 -.5", "numbers", (1.0, -2.0, -0.5)),
        ("--numbers", "numbers", ()),
        ("--either 3", "either", 3),
        ("--either three", "either", "three"),
        ("--several 1 2", "several", (1.0, 2.0)),
        ("--several 1", "several", 1.0),
        ("--nested 1 2 x", "nested", ((1, 2), "x")),
        ("--limit 2", "limit", 2.0),
        ("--inner.rate 2", "inner", Inner(2.0)),
        ("--inner.no-warm", "inner", Inner(1.0, False)),
        ("--special.rate 2", "special", Special(2.0, extra=4.0)),
        ("", "table", {}),
    ],
)
def test_words_become_fields(argv: str, name: str, value: Any) -> None:
    expected = {"path": None, "made": 5} | {name: value}
    fields = read(*argv.split())
    assert getattr(fields, name) == value
    assert type(getattr(fields, name)) is type(value)
    for other in set(expected) - {name}:
        assert getattr(fields, other) == expected[other]


@pytest.mark.parametrize(
    ("argv", "line"),
    [
        ("--count many", "--count = many; allowed: INT"),
        ("--count", "--count: its value is missing; allowed: 1 value"),
        ("--count --name x", "--count: its value is missing; allowed: 1 value"),
        ("--colour BLUE", "--colour = BLUE; allowed: GREEN, RED"),
        ("--size none", "--size = none; allowed: large, small"),
        ("--point 1", "--point = 1; allowed: 2 values (FLOAT FLOAT)"),
        ("--point 1 two", "--point = 1 two; allowed: 2 values (FLOAT FLOAT)"),
        ("--corner 1 2 3", "--corner = 1 2 3; allowed: 2 values: x, y [m] (FLOAT FLOAT)"),
        ("--numbers 1 two", "--numbers = 1 two; allowed: FLOAT..."),
        ("--table a 1", "--table = a 1; allowed: no value on the command line"),
        ("--inner.rate -1", "--inner.rate = -1.0; allowed: >= 0"),
        ("--limit nan", "--limit = nan; allowed: finite numbers"),
        ("--inner.rate inf", "--inner.rate = inf; allowed: finite numbers"),
        ("--count 1 2 x", "2, x: this argument is not expected here; allowed: flags, each followed by its values"),
        ("--count 1 --count 2", "--count is given 2 times; allowed: once"),
        ("--inner.warm --inner.no-warm", "--inner.warm is given together with --inner.no-warm; allowed: one of both"),
    ],
)  # fmt: skip
def test_a_wrong_word_is_refused_in_one_line(argv: str, line: str) -> None:
    with pytest.raises(BadInputError) as refused:
        read(*argv.split())
    assert str(refused.value) == line


def test_a_prefix_stands_before_every_flag() -> None:
    default = Fields(count=7, inner=Inner(3.0))
    fields = read("--part.inner.no_warm", "--part.name", "x", prefix="part", default=default)
    assert (fields.count, fields.name, fields.inner) == (7, "x", Inner(3.0, False))
    with pytest.raises(BadInputError, match=r"^--part\.inner\.rate = -1\.0; allowed: >= 0$"):
        read("--part.inner.rate", "-1", prefix="part", default=default)


@dataclass(frozen=True)
class Places:
    left: Annotated[Path, Positional("DIR")]
    """a folder"""
    out: Path
    """the file to write"""
    right: Annotated[str, Positional()]
    """another one"""
    quick: bool = False


def test_places_take_the_words_without_a_flag() -> None:
    assert read("a", "--out", "o", "--quick", "b", schema=Places) == Places(Path("a"), Path("o"), "b", True)
    assert read("--out", "o", "--", "-a", "-b", schema=Places) == Places(Path("-a"), Path("o"), "-b")


@dataclass(frozen=True)
class Sides:
    left: Annotated[str, Positional("DIR")]
    right: Annotated[str, Positional("DIR")]


def test_two_places_may_have_one_name() -> None:
    assert read("a", "b", schema=Sides) == Sides("a", "b")
    with pytest.raises(BadInputError, match=r"^DIR is missing; allowed: DIR$"):
        read("a", schema=Sides)


def test_all_that_is_missing_is_named() -> None:
    with pytest.raises(BadInputError) as refused:
        read("a", schema=Places)
    assert (
        str(refused.value)
        == "--out is missing; allowed: PATH the file to write; RIGHT is missing; allowed: another one"
    )


def test_flags_say_which_may_be_given_several_times() -> None:
    known = flags(Fields)
    assert {flag for flag, repeats in known.items() if repeats} == {"--boxes", "--names"}
    assert "--inner.no-warm" in known
    assert "--made" not in known
    assert not set(flags(Places)) & {"--left", "--right"}


def test_help_is_printed_whatever_else_is_given(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(HelpPrinted):
        read("--count", "many", "--help", schema=Inner, prefix="part")
    assert "--part.rate" in capsys.readouterr().out


def test_two_groups_with_one_flag_are_refused() -> None:
    """As an option of a study, and a field of an own study that is called the same."""

    @dataclass
    class Options:
        workers: int = 1

    @dataclass
    class Config:
        workers: int = 3

    for words in ([], ["--workers", "2"], ["--help"]):
        with pytest.raises(BadInputError, match=r"--workers is a field of .*Options and of .*Config; allowed: another"):
            parse(words, "prog", "purpose", FlagGroup(Options, default=Options()), FlagGroup(Config, default=Config()))
