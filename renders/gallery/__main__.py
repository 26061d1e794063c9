"""``make gallery``: the committed pictures made again, by the commands that README.md names for each.

    python -m mathnavi.renders.gallery [NAME ...]

Without a name all of them, which takes hours: pictures of studies are those of whole studies. A name is given with or
without its ending, or is a pattern: ``safe_flight``, ``safe_flight.png``, ``"*.webp"``. Exit code 0: all were made;
1: some were not, each reported in one line; 2: there is no such picture.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from mathnavi.interfaces.reading.files import read_text
from mathnavi.renders.gallery.table import HERE, README, Command, GalleryPicture, chosen, entries

ROOT = HERE.parent.parent
MISSIONS = 0, 1  # exit codes of a command that ran, for any result of the mission or the claims


def main(wanted: Sequence[str]) -> int:
    try:
        todo = chosen(wanted, entries(read_text(README, ValueError)))
    except ValueError as error:
        print(f"gallery: {error}", file=sys.stderr)
        return 2
    done: dict[Command, str] = {}  # what each command printed: pictures of the same run share it
    failed = 0
    for entry in todo:
        try:
            picture = _make(entry, done)
        except (OSError, RuntimeError) as error:
            failed += 1
            print(f"gallery: {entry.name} not made: {error}", file=sys.stderr)
        else:
            print(f"{picture}  {picture.stat().st_size / 1000:.0f} kB", flush=True)
    return 1 if failed else 0


def _make(entry: GalleryPicture, done: dict[Command, str]) -> Path:
    """Run the commands of a picture that have not been run, and put it here."""
    for command in entry.commands:
        _check(command)
        if command not in done:
            print(f"$ {shlex.join(command)}", flush=True)
            ran = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
            if ran.returncode not in MISSIONS:
                raise RuntimeError(f"{shlex.join(command)} ended with exit code {ran.returncode}")
            done[command] = ran.stdout
    made = ROOT / entry.made(done[entry.commands[-1]])
    if not made.is_file():
        raise RuntimeError(f"{shlex.join(entry.commands[-1])} left no picture at {made}")
    target = HERE / entry.name
    partial = target.with_name(f".{target.name}.partial")
    shutil.copyfile(made, partial)
    partial.replace(target)
    return target


def _check(command: Command) -> None:
    """Raise an error for a command whose requirements are missing, before it begins."""
    if shutil.which(command[0]) is None and not (ROOT / command[0]).is_file():
        raise FileNotFoundError(f"{command[0]} is not installed")
    for word in command:
        if word.endswith(".npz") and not (ROOT / word).is_file():
            raise FileNotFoundError(f"{word}, a map that is not in the repository, is not in {ROOT}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
