"""Conversion of exceptions in a plug-in's code to one error that names the plug-in."""

from __future__ import annotations

import contextlib
import importlib
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata

_MACHINERY = ("<frozen", __file__, importlib.__file__, metadata.__file__, contextlib.__file__)


@contextmanager
def failures_named(
    subject: str, kind: type[ValueError], passing: tuple[type[BaseException], ...] = ()
) -> Iterator[None]:
    """Raise a ``kind`` that begins with ``subject`` for any exception of a plug-in within the block, or ``sys.exit()``.

    Ctrl-C passes, and so do the exceptions ``passing`` and a ValueError that says what is allowed: it refuses its
    input.
    """
    try:
        yield
    except BaseException as error:
        refuses = isinstance(error, ValueError) and "allowed" in _text(error)
        if refuses or isinstance(error, (KeyboardInterrupt, *passing)):
            raise
        raise kind(f"{subject} {explained(error)}") from error


def explained(error: BaseException) -> str:
    """Return the exception as text, with the place where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    if isinstance(error, SyntaxError):
        frames.clear()  # it names its own file and line
    where = [f" ({frame.filename}:{frame.lineno})" for frame in frames if not frame.filename.startswith(_MACHINERY)]
    text = _text(error)
    said = f"{type(error).__name__}: {text}" if text else type(error).__name__
    return f"{said}{''.join(where[-1:])}"


def _text(error: BaseException) -> str:
    """Return the message of an exception; an empty one if the exception fails to make it."""
    try:
        return str(error)
    except BaseException:  # a third-party ``__str__`` may raise anything, KeyboardInterrupt too
        return ""
