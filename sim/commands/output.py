"""The folder that a command writes to."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mathnavi.sim.commands.errors import BadInputError


@contextmanager
def output_folder(folder: Path) -> Iterator[None]:
    """Make the folder and try to write into it; if what follows fails, what was made goes again."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise BadInputError(
                f"--out = {folder}: {error.strerror}; allowed: a folder that can be made or written to"
            ) from error
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise
