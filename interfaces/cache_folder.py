"""The folder in which everything that mathnavi keeps for later runs lies: kernels, solvers, descriptions of plug-ins.

It is ``mathnavi`` in $XDG_CACHE_HOME, which counts if it is an absolute path, or else in ``.cache`` of the home: $HOME,
or what the system's list of users says where $HOME is not set. Where there is no home, or nothing can be written there,
it is a folder of this user alone in $TMPDIR, /tmp or /var/tmp. What is kept is loaded as machine code, so that folder
counts only if no other user can have made it, can write to it, or can put another one in its place.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_OTHERS_READ_AND_WRITE = 0o077
_OTHERS_WRITE = 0o022
_ROOT = 0
_TEMPORARY = "/tmp", "/var/tmp"


def cache_folder() -> Path | None:
    """Return the folder, which exists and can be written to; None if it cannot, and nothing is kept."""
    named = _named()
    if named is not None:
        with suppress(OSError):
            named.mkdir(parents=True, exist_ok=True)
            if os.access(named, os.W_OK | os.X_OK):
                return named
    return next(_private(), None)


def _named() -> Path | None:
    """Return the folder that the environment or the system names."""
    if os.path.isabs(cache := os.environ.get("XDG_CACHE_HOME", "")):
        return Path(cache, "mathnavi")
    home = os.environ.get("HOME", "")
    if not os.path.isabs(home):
        import pwd  # as a rule $HOME is set

        try:
            home = pwd.getpwuid(os.getuid()).pw_dir
        except KeyError:  # a container may run as any number
            return None
    return Path(home, ".cache", "mathnavi") if os.path.isabs(home) else None


def _private() -> Iterator[Path]:
    """Yield the folders of this user alone below those for temporary files."""
    user = os.geteuid()
    for parent in filter(os.path.isabs, (os.environ.get("TMPDIR", ""), *_TEMPORARY)):
        folder = Path(parent, f"mathnavi-{user}")
        with suppress(OSError):
            above = os.stat(parent)
            open_to_all = above.st_mode & _OTHERS_WRITE and not above.st_mode & stat.S_ISVTX
            if open_to_all or above.st_uid not in (_ROOT, user):
                continue  # others could put another folder in its place
            with suppress(FileExistsError):
                folder.mkdir(mode=0o700)
            made = os.lstat(folder)  # a link may lead anywhere
            whole = stat.S_ISDIR(made.st_mode) and made.st_uid == user and not made.st_mode & _OTHERS_READ_AND_WRITE
            if whole and os.access(folder, os.W_OK | os.X_OK):
                yield folder
