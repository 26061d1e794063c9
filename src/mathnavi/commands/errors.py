"""Bad input: mistakes that the user can correct, each reported in one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mathnavi.interfaces.errors import PluginError

if TYPE_CHECKING:
    from rich.console import Console

UNFORESEEN = 70  # exit code: an internal error, as sysexits.h has it
OUT_OF_TIME = 124  # what `timeout` calls a process whose time was up
PIPE_CLOSED = 141  # what a shell calls a process that ended by SIGPIPE

_ARGUMENTS = {"scenarios": "SCENARIO", "controllers": "--controller", "estimators": "--estimator"}
_LONGEST_WORD = 200  # [characters] that a message shows
_LONGEST = 2000  # [characters] of a line on standard error


class HelpPrinted(Exception):  # noqa: N818
    """Signal that the help was requested and has been printed, so that the command has come to its end."""


class BadInputError(ValueError):
    """Mistake in the input; the message names the field, its value and what is allowed."""


@contextmanager
def bad_input() -> Iterator[None]:
    """Raise BadInputError for a ValueError or an OSError within the block: the input was bad."""
    try:
        yield
    except BadInputError:
        raise
    except ValueError as error:
        raise BadInputError(str(error)) from error
    except OSError as error:
        raise BadInputError(worded(error)) from error


@contextmanager
def bad_plugin() -> Iterator[None]:
    """Raise BadInputError for a plug-in that cannot be loaded; its message names the argument that names it."""
    try:
        yield
    except PluginError as error:
        kind, colon, rest = str(error).partition(":")
        raise BadInputError(f"{_ARGUMENTS.get(kind, kind)}{colon}{rest}") from error


def worded(error: Exception) -> str:
    """Return the message of an error; for one of the operating system with its file first."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{os.fsdecode(error.filename)}: {error.strerror}"
    return str(error)


def print_error(message: str) -> None:
    """Print a message on standard error, as one line with the name of the program."""
    print(f"mathnavi: {one_line(message)}", file=sys.stderr)


def print_note(console: Console, message: str) -> None:
    """Print a message as one dim line."""
    console.print(one_line(message), style="dim", highlight=False, soft_wrap=True)


def short(word: str) -> str:
    """Return a word of the command line as a message shows it: without its middle if it is very long."""
    return word if len(word) <= _LONGEST_WORD else f"{word[: _LONGEST_WORD // 2]}...{word[-_LONGEST_WORD // 2 :]}"


def one_line(message: str) -> str:
    """Return a message as one line that a terminal shows unchanged: without line breaks and control characters, and
    without its middle if it is very long.
    """
    line = " ".join(message.split())
    if len(line) > _LONGEST:
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in line)
