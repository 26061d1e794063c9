"""Bad input: mistakes that the user can put right, each said in one line."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

UNFORESEEN = 70  # exit code: an internal error, as sysexits.h has it
OUT_OF_TIME = 124  # what `timeout` calls a process whose time was up
PIPE_CLOSED = 141  # what a shell calls a process that ended by SIGPIPE

_LONGEST_WORD = 200  # [characters] that a message shows
_LONGEST = 2000  # [characters] of a line on standard error


class BadInputError(ValueError):
    """The message names the field, its value and what is allowed."""


@contextmanager
def bad_input() -> Iterator[None]:
    """Raise BadInputError for a ValueError or an OSError in here: the input was bad."""
    try:
        yield
    except BadInputError:
        raise
    except ValueError as error:
        raise BadInputError(str(error)) from error
    except OSError as error:
        raise BadInputError(worded(error)) from error


def worded(error: Exception) -> str:
    """The message of an error; that of the operating system with its file first."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{os.fsdecode(error.filename)}: {error.strerror}"
    return str(error)


def short(word: str) -> str:
    """A word of the command line as a message shows it: without its middle where it is very long."""
    return word if len(word) <= _LONGEST_WORD else f"{word[: _LONGEST_WORD // 2]}...{word[-_LONGEST_WORD // 2 :]}"


def one_line(message: str) -> str:
    """A message as one line that a terminal shows as it is: no line breaks, no control characters, and what is very
    long without its middle.
    """
    line = " ".join(message.split())
    if len(line) > _LONGEST:
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in line)
