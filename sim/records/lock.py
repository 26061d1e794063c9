"""Locks that end with the process that holds them, so that a killed process leaves nothing locked."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.writing import naming

LONGEST = 200  # bytes of a name that the names of the files next to it repeat


def beside(place: Path, ending: str) -> Path:
    """Return the hidden path ``.NAME.ending`` next to a file or a folder, with a name that is not too long."""
    name = place.name
    if len(os.fsencode(name)) > LONGEST:
        name = hashlib.sha256(os.fsencode(name)).hexdigest()
    return place.with_name(f".{name}.{ending}")


@contextmanager
def locked(place: Path, shown: Path) -> Iterator[None]:
    """Lock a file or a folder, which need not exist, by a temporary file next to it.

    Raises RunFolderError, which calls it ``shown``, if another process has locked it, and OSError if a lock is not
    possible.
    """
    path = beside(place, "lock")
    while True:
        with naming(shown):
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise RunFolderError(
                f"{shown} is in use: another process is writing it; allowed: another one, or after its end"
            ) from None
        except BaseException:
            os.close(descriptor)
            raise
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), os.stat(path)):
                break
        os.close(descriptor)  # the process that held it has removed it meanwhile
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)
