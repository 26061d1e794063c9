"""Every text of the public interface follows the rules of style that a machine can check.

``python -m tests.docs.public_texts FILE`` writes all of them into one file, which is to be read from top to bottom:
most rules of style only a reader can check.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.public_texts import Docstring, Help, docstrings, field_helps, main

HELPS, DOCSTRINGS = field_helps(), docstrings()
RELATIVE = re.compile(
    r"(about|as|at|beside|by|for|from|how|in|of|on|over|since|so|than|that|to|under|until|what|when|where|which|who|whose"
    r"|with)\b",
    re.IGNORECASE,
)
DECIMAL = re.compile(r"(?<![\w.])\.\d")  # .25
UNIT = re.compile(r"\[[^\]]+\]")
UNITLESS = re.compile(  # words that say of a number that it has no unit
    r"\b(shares?|fraction|ratio|factor|probability|relative|coefficient|over v_max|over a_max|multiple|likelihood|NIS"
    r"|standard deviations|divergence|weight|scaling|spread of the sigma points)\b"
)
SAID_ELSEWHERE = {  # fields whose unit their own text cannot say, with the reason
    "SearchOptions.until": "that of the figure which is searched for",
    "TerrainImportOptions.crop": "it depends on the kind of file, as the text says",
    "InputSignalConfig.constant": "that of each input of the system",
    "InputSignalConfig.amplitude": "that of each input of the system",
    "Example22Config.alpha": "Example 2.2 has no units",
    "Example22Config.beta": "Example 2.2 has no units",
    "LaplacianConfig.delta": "A.14 compares relative differences",
    "ArmVelocityConfig.start": "that of each component of the state",
    "SphereObserverConfig.start": "that of each component of the state",
    "TextbookConfig.start": "that of each component of the state",
    "TextbookConfig.start_error": "that of each component of the state",
    "TextbookConfig.noise": "that of each output",
    "TextbookConfig.tolerance": "that of the state",
}
WORDS = re.compile(r"\b(anew|likewise|nought|nobody|somebody|whoever|thereof|whence|of one's own|so many|so much)\b")


def place(text: Help | Docstring) -> str:
    return text.place


def test_all_texts_can_be_written_into_one_file(tmp_path: Path) -> None:
    main([str(tmp_path / "texts.txt")])
    written = (tmp_path / "texts.txt").read_text(encoding="utf-8")
    assert "## mathnavi run safe-flight --help" in written
    assert all(" ".join(each.text.split()) in written for each in HELPS)
    assert all(each.text in written for each in DOCSTRINGS)


@pytest.mark.parametrize("each", HELPS, ids=place)
def test_a_help_text_names_a_quantity_with_its_unit(each: Help) -> None:
    text = each.text
    assert text, "no help"
    assert not RELATIVE.match(text), "it begins with a preposition or a relative word"
    assert text[0].islower() or re.match(r"[A-Z]{2}", text), "it begins with a capital letter"
    assert not text.endswith(".") or text.endswith("..."), "it ends with a full stop"
    assert (each.hint is bool) == text.startswith("whether "), "whether: of truth values, and of nothing else"
    assert not DECIMAL.search(text), "a decimal without its zero"
    assert not WORDS.search(text), "an odd word"
    if "float" in str(each.hint) and f"{each.owner.__name__}.{each.field}" not in SAID_ELSEWHERE:
        assert UNIT.search(text) or UNITLESS.search(text), "no unit"


def test_every_exception_from_the_rule_on_units_is_needed() -> None:
    without = {f"{each.owner.__name__}.{each.field}" for each in HELPS if not UNIT.search(each.text)}
    assert set(SAID_ELSEWHERE) <= without


@pytest.mark.parametrize("each", DOCSTRINGS, ids=place)
def test_a_docstring_makes_sense_when_it_is_read_alone(each: Docstring) -> None:
    first = each.text.partition("\n\n")[0]
    assert first, "no docstring"
    assert "\n" not in first, "its first sentence is longer than a line"
    assert first[-1] in ".?:,", "its first line is no sentence"
    assert not RELATIVE.match(first), "it begins with a preposition or a relative word"
    assert not DECIMAL.search(each.text), "a decimal without its zero"
    assert not WORDS.search(each.text), "an odd word"
