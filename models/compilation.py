"""CasADi functions as machine code: compiled once per source text, kept in the user's cache folder."""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

import casadi as ca

from mathnavi.interfaces.cache_folder import cache_folder
from mathnavi.interfaces.reading.files import MOST_TEXT, read_bytes

_DIGITS = 32  # of a hash, in the name of a file


def compiler() -> str | None:
    """Path of the C compiler; None if absent."""
    return shutil.which("cc")


def compiled(solver: ca.Function) -> Path:
    """Compile the functions that an NLP solver evaluates to a shared library.

    Raises FileNotFoundError if there is no C compiler named cc, and OSError, with its message, if it fails.
    """
    cc = compiler()
    if cc is None:
        raise FileNotFoundError("no C compiler named cc was found; install one, or use the virtual machine")
    cache = cache_folder() or _folder_of_this_process()
    with tempfile.TemporaryDirectory(dir=cache) as folder:
        source, built = Path(folder) / "nlp.c", Path(folder) / "nlp.so"
        with contextlib.chdir(folder):  # CasADi takes no folder here
            solver.generate_dependencies(source.name)
        # Several machines may share a user's folder.
        text = platform.machine().encode() + read_bytes(source, ValueError, MOST_TEXT)
        key = hashlib.sha256(text).hexdigest()[:_DIGITS]
        for library in sorted(cache.glob(f"{key}-*.so")):
            if _is_whole(library):  # damaged machine code would crash
                return library
        # As fast as -O2 here, and compiled in half the time.
        command = [cc, "-O1", "-fPIC", "-shared", str(source), "-o", str(built), "-lm"]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        if made.returncode != 0:
            said = " ".join(made.stderr.split())[-400:] or "nothing"
            raise OSError(f"the C compiler {cc} ended with {made.returncode} and said: {said}")
        library = cache / f"{key}-{_checksum(built)}.so"
        built.replace(library)  # at once, so that another process never loads half a file
    return library


@functools.cache
def _folder_of_this_process() -> Path:
    """Make a folder for what cannot be kept; it is removed when this process ends."""
    folder = tempfile.mkdtemp(prefix="mathnavi-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _is_whole(library: Path) -> bool:
    try:
        return library.stem.endswith(f"-{_checksum(library)}")
    except (OSError, ValueError):  # unreadable, or no file, or far too large
        return False


def _checksum(library: Path) -> str:
    return hashlib.sha256(read_bytes(library, ValueError, MOST_TEXT)).hexdigest()[:_DIGITS]
