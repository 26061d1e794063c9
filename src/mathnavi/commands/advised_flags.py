"""Flags in place of the arguments of a function that a message advises: --sep ';' for sep=';'."""

from __future__ import annotations

import re
import shlex

_ADVISED = "disorder|sep|decimal|thousands|encoding|comment|skiprows|names|time|time_unit|units|trust_units|format"
_ARGUMENT = re.compile(rf"\b({_ADVISED})=(\{{.*?\}}|\[.*?\]|'.*?'|\w+)")


def as_flags(message: str) -> str:
    """Return a message with flags in place of the arguments that it advises."""
    return _ARGUMENT.sub(lambda found: f"--{found[1].replace('_', '-')} {_as_words(found[2])}".rstrip(), message)


def _as_words(value: str) -> str:
    """Return the words that give what Python's notation of a text, a list or a mapping expresses."""
    if value.startswith("{"):
        name, _, unit = value[1:-1].partition(": ")
        return f"{shlex.quote(name.strip(chr(39)))}={unit.strip(chr(39))}"
    if value.startswith("["):
        return value[1:-1]
    if value == "True":  # of a flag that is yes or no
        return ""
    return shlex.quote(value.strip("'"))
