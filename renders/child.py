"""Child processes that draw: the command that starts one, and its last error."""

from __future__ import annotations

import sys
from typing import IO

_START = "import sys; sys.path[:] = sys.argv[1:]; from {} import main; main()"


class DrawingFailedError(RuntimeError):
    """End of a drawing process before its pictures were complete; the message has its reason."""


def child_command(module: str) -> list[str]:
    """Return the command that runs ``main()`` of a module with this process' path.

    -P and a path that the process sets itself: no numpy.py of the current folder is taken for the library.
    """
    return [sys.executable, "-P", "-c", _START.format(module), *filter(None, sys.path)]


def last_line(errors: IO[bytes]) -> str:
    """Return the last line that a process wrote to its file of errors."""
    errors.seek(0)
    lines = errors.read().decode(errors="replace").strip().splitlines() or ["it gave no reason"]
    return lines[-1]
