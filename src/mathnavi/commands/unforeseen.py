"""End of a command by an unforeseen error: one line, and a file with the traceback to send."""

from __future__ import annotations

import errno
import io
import os
import platform
import select
import sys
import tempfile
import traceback
from collections.abc import Sequence
from importlib.metadata import version

from mathnavi.commands.errors import one_line, worded

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # errors of writing
DEVELOPERS = "MATHNAVI_TRACEBACK"  # environment variable: with any value but "" the traceback ends the command


def report(error: Exception, arguments: Sequence[str]) -> str:
    """Return one line on an unforeseen error; write its traceback, with the command and the versions, to a new file in
    the system's folder for temporary files.
    """
    if isinstance(error, MemoryError):
        reason = "the memory of this machine does not suffice"
    elif isinstance(error, RecursionError):
        reason = "something is nested too deeply"
    else:
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
    lines = [f"mathnavi {version('mathnavi')}, Python {platform.python_version()}, {platform.platform()}", "arguments"]
    lines += [f"    {word!a}" for word in arguments]
    lines += ["", "".join(traceback.format_exception(error))]
    try:
        handle, path = tempfile.mkstemp(prefix="mathnavi-error-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write("\n".join(lines))
    except OSError as full:
        kept = f"its traceback cannot be written ({full.strerror}); {DEVELOPERS}=1 prints it"
    else:
        kept = f"please send {path}, which holds the traceback"
    return one_line(f"an error that was not foreseen, {reason}; {kept}")


def traceback_is_shown() -> bool:
    """Return True if tracebacks are requested, for developers."""
    return bool(os.environ.get(DEVELOPERS))


def not_written(error: Exception) -> str | None:
    """Return one line on a file that the operating system refuses, or a full disk; None for any other error."""
    if not isinstance(error, OSError):
        return None
    if error.filename is not None:
        return one_line(worded(error))
    return one_line(f"standard output: {error.strerror}") if error.errno in NO_ROOM else None  # files name themselves


def reader_has_gone() -> bool:
    """Return True if the reader of the standard output has closed it."""
    try:
        watch = select.poll()
        watch.register(sys.stdout.fileno(), 0)
    except (AttributeError, io.UnsupportedOperation):  # it is closed, or no file
        return False
    return any(state & select.POLLERR for _, state in watch.poll(0))
