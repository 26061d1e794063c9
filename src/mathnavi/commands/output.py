"""Output folders of the commands."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from mathnavi.commands.errors import BadInputError
from mathnavi.interfaces.errors import RunFolderError
from mathnavi.sim.records.claimed_folder import ClaimedFolder, claimed


@contextmanager
def output_folder(folder: Path, flag: str = "--out") -> Iterator[None]:
    """Make the folder of a flag and check that it can be written to; if the block fails, remove what was made."""
    made: list[Path] = []
    try:
        try:
            made += [path for path in (folder, *folder.parents) if not path.exists()]
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise _refused(folder, error, flag) from error
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


@contextmanager
def run_folder(folder: Path) -> Iterator[ClaimedFolder]:
    """Claim the folder of a run before anything is flown; BadInputError if that is not possible."""
    from mathnavi.sim.records.run_folder import CONFIG, RECORDED  # takes a while to import

    with ExitStack() as opened:
        try:
            found = {entry.name for entry in folder.iterdir()} if folder.is_dir() else set()
            if CONFIG not in found and found - set(RECORDED):
                raise RunFolderError(
                    f"{folder} holds other files than a run's; allowed: a new folder, or that of a run"
                )
            claim = opened.enter_context(claimed(folder))
        except RunFolderError as error:
            raise BadInputError(f"--out = {error}") from error
        except OSError as error:
            raise _refused(folder, error) from error
        yield claim


def _refused(folder: Path, error: OSError, flag: str = "--out") -> BadInputError:
    return BadInputError(f"{flag} = {folder}: {error.strerror}; allowed: a folder that can be made or written to")
