"""Atomic writing of files, whole or not at all: no reader sees a part of one, and a full disk leaves the former one."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

LONGEST = 60  # characters of a name that a scratch file repeats, so that its name does not become too long


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Raise an OSError of the block, which may name no file or a scratch file, as one of ``path``."""
    try:
        yield
    except OSError as error:
        if error.errno is None:  # not an error of the operating system
            raise
        raise OSError(error.errno, error.strerror or os.strerror(error.errno), str(path)) from error


@contextmanager
def whole_files(*paths: Path) -> Iterator[list[Path]]:
    """Open scratch files, each next to its path, which take their places together when the block has ended.

    If the block raises, or one of the files cannot be written, nothing is changed. Raises OSError that names one of
    ``paths``.
    """
    scratch: list[Path] = []
    try:
        for path in paths:
            with naming(path):
                descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:LONGEST]}.")
                scratch.append(Path(name))
                os.close(descriptor)
                if path.is_dir():
                    raise IsADirectoryError(errno.EISDIR, "")
        yield scratch
        for path, made in zip(paths, scratch, strict=True):
            with naming(path):
                os.chmod(made, 0o644)
                os.replace(made, path)
    finally:
        for made in scratch:
            made.unlink(missing_ok=True)


def write_together(contents: Mapping[Path, bytes]) -> None:
    """Write all files or none, each whole or not at all; OSError names the one that could not be written."""
    with whole_files(*contents) as scratch:
        for (path, content), made in zip(contents.items(), scratch, strict=True):
            with naming(path):
                made.write_bytes(content)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; OSError names it."""
    write_together({path: content})


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all; OSError names it."""
    write_bytes(path, text.encode("utf-8"))
