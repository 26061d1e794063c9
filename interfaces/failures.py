"""Conversion of exceptions: those of a plug-in's code to one that names the plug-in, others to one of a named kind."""

from __future__ import annotations

import contextlib
import importlib
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata

from mathnavi.interfaces import errors

_MACHINERY = ("<frozen", __file__, importlib.__file__, metadata.__file__, contextlib.__file__)

_NAMED = tuple(
    kind
    for kind in vars(errors).values()
    if isinstance(kind, type) and issubclass(kind, ValueError) and kind is not errors.ArgumentError
)  # an inner function's argument is not the script's


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


@contextmanager
def raising(kind: type[ValueError]) -> Iterator[None]:
    """Raise a ValueError of no more specific kind within the block as one of ``kind``."""
    try:
        yield
    except ValueError as error:
        if isinstance(error, _NAMED):
            raise
        raise kind(str(error)) from error


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
