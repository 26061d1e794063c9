"""Atomic replacement of a folder: the new one is written next to its place, and put there in one step when complete.

    PARENT/NAME          the former folder, unchanged until then
    PARENT/.NAME.new     the folder that is being written
    PARENT/.NAME.lock    locked by the process that writes it, and free as soon as that process ends in any way
    PARENT/.NAME.old     the former folder, for a moment, on file systems that cannot exchange two folders

The next process that claims the folder removes or restores what a killed process has left of these.

Locks that end with the process that holds them, so that a killed process leaves nothing locked.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import hashlib
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
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


AT_FDCWD, RENAME_EXCHANGE = -100, 2  # of Linux: linux/fcntl.h, linux/fs.h
NO_EXCHANGE = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EXDEV)  # file systems that cannot


@dataclass(frozen=True)
class ClaimedFolder:
    """Folder that no other process writes, and the new one next to it that will take its place."""

    place: Path  # without symbolic links
    new: Path  # empty at first

    def install(self, dropped: Collection[str] = ()) -> None:
        """Put the new folder in its place.

        Files of the former one that the new one lacks are kept, except the names ``dropped``.
        """
        if not self.place.exists():
            os.rename(self.new, self.place)
            return
        for entry in self.place.iterdir():
            if entry.name not in dropped and not os.path.lexists(self.new / entry.name):
                _keep(entry, self.new / entry.name)
        shutil.copymode(self.place, self.new)
        _exchange(self.new, self.place)
        shutil.rmtree(self.new, ignore_errors=True)


@contextmanager
def claimed(folder: Path) -> Iterator[ClaimedFolder]:
    """Claim a folder for as long as the block lasts; without ``install``, existing files are not changed.

    Raises RunFolderError for a folder that another process writes, or that cannot be replaced whole: a mount point, the
    current folder, one with folders in it. Raises OSError, which names the file, if nothing can be written.
    """
    with naming(folder):
        place = _place(folder)
        made = [parent for parent in place.parents if not parent.exists()]
    try:
        with naming(folder):
            place.parent.mkdir(parents=True, exist_ok=True)
        with locked(place, folder):
            with naming(folder):
                new = beside(place, "new")
                _put_right(place)
                new.mkdir()
            try:
                with _named_as_in(folder, new):
                    yield ClaimedFolder(place, new)
            finally:
                shutil.rmtree(new, ignore_errors=True)
    except BaseException:
        for parent in made:
            with suppress(OSError):
                parent.rmdir()
        raise


@contextmanager
def kept_in_place(folder: Path) -> Iterator[None]:
    """Keep a folder from being replaced while something is written into it; RunFolderError if it is being replaced.

    If nothing can be written next to it, it cannot be replaced anyway.
    """
    place = folder.resolve()
    with locked(place, folder) if os.access(place.parent, os.W_OK) else nullcontext():
        yield


def _place(folder: Path) -> Path:
    """Return the folder without symbolic links, if it can be replaced whole."""
    if any(path.is_symlink() and not path.exists() for path in (folder, *folder.parents)):
        raise FileNotFoundError(errno.ENOENT, "a link that leads nowhere")
    place = folder.resolve()
    if not place.exists():
        return place
    if not place.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
    if not os.access(place, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    if os.path.ismount(place):
        raise RunFolderError(f"{folder} is a mount point and cannot be replaced whole; allowed: a folder in it")
    if Path.cwd().is_relative_to(place):
        raise RunFolderError(f"{folder} is the current folder, or around it; allowed: a folder that can be replaced")
    if inner := sorted(entry.name for entry in os.scandir(place) if entry.is_dir(follow_symlinks=False)):
        raise RunFolderError(f"{folder} holds the folder {inner[0]!r}; allowed: a folder without folders in it")
    return place


def _put_right(place: Path) -> None:
    """Remove what a killed process has left, or restore the folder that it was about to replace."""
    former = beside(place, "old")
    if former.exists() and not place.exists():
        os.rename(former, place)
    for left in (former, beside(place, "new")):
        if left.exists():
            shutil.rmtree(left)


@contextmanager
def _named_as_in(folder: Path, new: Path) -> Iterator[None]:
    """Raise an OSError on a file in ``new`` as one on that file in ``folder``."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is None or not Path(os.fsdecode(error.filename)).is_relative_to(new):
            raise
        shown = folder / Path(os.fsdecode(error.filename)).relative_to(new)
        raise OSError(error.errno, error.strerror, str(shown)) from error


def _keep(file: Path, kept: Path) -> None:
    """Put a file in a second place too, as a link if the file system has links, else as a copy."""
    try:
        os.link(file, kept, follow_symlinks=False)
    except OSError:
        shutil.copy2(file, kept, follow_symlinks=False)


def _exchange(new: Path, place: Path) -> None:
    """Exchange two folders, in one step if the file system can."""
    library = ctypes.CDLL(None, use_errno=True)
    if hasattr(library, "renameat2"):
        one, other = os.fsencode(new), os.fsencode(place)
        if library.renameat2(AT_FDCWD, one, AT_FDCWD, other, RENAME_EXCHANGE) == 0:
            return
        if (number := ctypes.get_errno()) not in NO_EXCHANGE:
            raise OSError(number, os.strerror(number), str(place))
    former = beside(place, "old")
    try:
        os.rename(place, former)
        os.rename(new, place)
    except BaseException:
        if not place.exists():
            os.rename(former, place)
        raise
    os.rename(former, new)
