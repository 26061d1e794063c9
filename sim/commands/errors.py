"""Bad input: mistakes that the user can put right, each said in one line."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

OUT_OF_TIME = 124  # exit code: what `timeout` calls a process whose time was up
PIPE_CLOSED = 141  # exit code: what a shell calls a process that ended by SIGPIPE


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
