"""Every text of the public interface follows the rules of style that a machine can check.

``python -m tests.docs.public_texts FILE`` writes all of them into one file, which is to be read from top to bottom:
most rules of style only a reader can check.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from tests.docs.public_texts import Docstring, Help, docstrings, document, field_helps

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


def help_faults(each: Help) -> Iterator[str]:
    """Yield what is wrong with a help text, which names a quantity with its unit and is read alone."""
    text = each.text
    if not text:
        yield "no help"
        return
    if RELATIVE.match(text):
        yield "it begins with a preposition or a relative word"
    if not (text[0].islower() or re.match(r"[A-Z]{2}", text)):
        yield "it begins with a capital letter"
    if text.endswith(".") and not text.endswith("..."):
        yield "it ends with a full stop"
    if (each.hint is bool) != text.startswith("whether "):
        yield "whether: of truth values, and of nothing else"
    known = UNIT.search(text) or UNITLESS.search(text) or f"{each.owner.__name__}.{each.field}" in SAID_ELSEWHERE
    if "float" in str(each.hint) and not known:
        yield "no unit"
    yield from _odd(text)


def docstring_faults(each: Docstring) -> Iterator[str]:
    """Yield what is wrong with a docstring, whose first line is read alone."""
    first = each.text.partition("\n\n")[0]
    if not first:
        yield "no docstring"
        return
    if "\n" in first:
        yield "its first sentence is longer than a line"
    if first[-1] not in ".?:,":
        yield "its first line is no sentence"
    if RELATIVE.match(first):
        yield "it begins with a preposition or a relative word"
    yield from _odd(each.text)


def _odd(text: str) -> Iterator[str]:
    if DECIMAL.search(text):
        yield "a decimal without its zero"
    if word := WORDS.search(text):
        yield f"an odd word: {word.group()}"


def test_all_public_texts_are_collected_in_one_file_and_follow_the_rules() -> None:
    """One test, for it is the collection that takes time."""
    helps, docs = field_helps(), docstrings()
    texts = document(helps, docs)
    assert "## mathnavi run safe-flight --help" in texts
    assert all(" ".join(each.text.split()) in texts for each in helps)
    faults = [f"{each.place}: {fault}: {each.text}" for each in helps for fault in help_faults(each)]
    faults += [f"{each.place}: {fault}: {each.text}" for each in docs for fault in docstring_faults(each)]
    assert not faults, "\n".join(faults)
    without = {f"{each.owner.__name__}.{each.field}" for each in helps if not UNIT.search(each.text)}
    assert set(SAID_ELSEWHERE) <= without, "an exception that is not needed"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("of every random draw", "it begins with a preposition or a relative word"),
        ("Seed of the run", "it begins with a capital letter"),
        ("seed of the run.", "it ends with a full stop"),
        ("duration of the run", "no unit"),
        ("share of .25 at most", "a decimal without its zero"),
    ],
)
def test_a_faulty_help_text_is_found(text: str, fault: str) -> None:
    assert fault in help_faults(Help(object, "field", float, text))
