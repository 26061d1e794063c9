"""Hostile values: words of a command line, values of JSON, names of files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

from annotated_types import Ge, Gt, Interval, Le, Lt
from numpy.random import Generator

Item = TypeVar("Item")

LONG = "x" * 300
TEXT_WORDS = """
evil_module evil_module:Evil os:system numpy:load mathnavi : :: a:b:c json: :JSONDecoder __main__:main ..:x .x:y
- -- --- = .. ../.. / /dev/null/x %s%n ${HOME} $(id) `id` ' " <script> [bold] [/] {0} {name} null None [] {} true NaN
dm_control: dm_control:nothing canyon: canyon:-1 canyon:1e9 canyon:٣ \udcff \ufffe \x07 \x1b[31mred\x1b[0m \U0001f681
\u202edesrever e\u0301
"""
NUMBER_WORDS = """
nan inf -inf 1e400 -1e400 1e308 -1e308 5e-324 1e-300 0 -0.0 -1 -7 1 2 3 0.1 1000000000 2147483648 -2147483649
9223372036854775808 99999999999999999999 0x10 1_0 ٣ 1,5 1e ١e٣ +5 true 1j
"""
JSON_WORDS = r"""
null true false 0 -0 -7 1 1.5 NaN Infinity -Infinity 1e400 -1e400 1e308 5e-324 99999999999999999999 - 0.1e 'x'
undefined [] {} [[]] [null] [1,2,3] [1,[2,[3]]] [NaN,Infinity] [1e999,-1e999] ["a","b"] {"a":1} {"":null} "" "x" "nan"
"\u0000" "\u001b[31m" "\ud800" "\n\n" "../../../precious" "/etc/passwd" "[/]" "<script>" "{seed}" "evil_module"
"evil_module:Evil" "os:system" {"$class":"os:system","$fields":{}}
"""
PLACE_WORDS = """
. .. / /proc/new /dev/full /dev/null /dev/null/new precious.txt precious.txt/new precious precious/letter.txt loop
loop/new pipe dangling dangling/new ~ - -- missing/a/b/c link * ? C:\\new \udcff new\x1b[31m new\U0001f681
"""
LONG = "x" * 300
TEXTS = (*TEXT_WORDS.split(), "", " ", "line\nbreak", "\r", "\t", "; ls", LONG, "x" * 70000, "a/" * 3000)
NUMBERS = (*NUMBER_WORDS.split(), " 5", "9" * 400, "9" * 5000)
DEEP = ("[" * 30 + "]" * 30, "[" * 100_000 + "]" * 100_000, '{"a":' * 20_000 + "1" + "}" * 20_000)
JSON = (*JSON_WORDS.split(), *DEEP, f'"{LONG}"', "9" * 400, "1" + "0" * 5000, "[" + "0," * 3000 + "0]")  # as in a file
# To write to, or to read from, in the folder of a case (``judge.box``).
PLACES = (*PLACE_WORDS.split(), "", " ", "new ", "new\nline", LONG, f"{LONG}/new", f"new/{LONG}", "n/" * 2500)


def one_of(rng: Generator, items: Sequence[Item]) -> Item:
    return items[int(rng.integers(len(items)))]


def text(rng: Generator) -> str:
    """A word that means nothing, or is none."""
    if rng.random() < 0.2:
        return "".join(chr(int(code)) for code in rng.integers(1, 0x3000, int(rng.integers(1, 12))))
    return one_of(rng, TEXTS)


def number(rng: Generator, marks: Sequence[object] = ()) -> str:
    """A number of a command line, often just outside of the bounds that a field declares."""
    limits = _limits(marks)
    if limits and rng.random() < 0.6:
        limit, below = one_of(rng, limits)
        beside = math.nextafter(limit, -math.inf if below else math.inf)
        return repr(one_of(rng, (beside, limit - 1 if below else limit + 1)))
    return one_of(rng, NUMBERS)


def misspelt(rng: Generator, word: str) -> str:
    """A word with a letter too few, too many, or two exchanged."""
    k = int(rng.integers(max(1, len(word))))
    begin, end = word[:k], word[k:]
    return one_of(rng, (begin + end[1:], f"{begin}q{end}", begin[::-1] + end, word.upper(), f"{word}s"))


def _limits(marks: Sequence[object]) -> list[tuple[float, bool]]:
    """Limits that an interval declares, each with whether what is below it is outside."""
    found: list[tuple[float, bool]] = []
    for mark in marks:
        for each in list(mark) if isinstance(mark, Interval) else [mark]:
            for kind, name, below in ((Gt, "gt", True), (Ge, "ge", True), (Lt, "lt", False), (Le, "le", False)):
                limit = getattr(each, name) if isinstance(each, kind) else None
                if isinstance(limit, int | float):
                    found.append((limit, below))
    return found
