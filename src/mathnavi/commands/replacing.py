"""Run in place of an earlier one in its folder: the earlier pictures and reports are removed, and a line says so."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from mathnavi.commands.errors import print_note
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.claimed_folder import ClaimedFolder
from mathnavi.sim.records.run_folder import SOMETIMES, SUMMARY

PICTURES = (".mp4", ".webm", ".gif", ".webp", ".png", ".jpg", ".jpeg")  # endings of what draws a run


def install_run(claim: ClaimedFolder, folder: Path, errors: Console, *, flown: bool = False) -> None:
    """Put a run in its folder, without the pictures and reports of an earlier one there, which it names as replaced.

    The code that draws the new run is trusted if it was ``flown``.
    """
    replaced = (folder / SUMMARY).exists()
    removed = _stale(folder, claim.new, flown=flown)
    claim.install(dropped=(*removed, *SOMETIMES))
    if replaced:
        gone = f", and removed its {', '.join(removed)}" if removed else ""
        print_note(errors, f"replaced the run in {folder}{gone}")


def _stale(folder: Path, new: Path, *, flown: bool) -> list[str]:
    """Return the names of an earlier run's pictures and reports in a folder, which must not stay with a new run."""
    pictures = {file.name for file in folder.glob("*") if file.suffix in (*PICTURES, ".html")}
    if not pictures:
        return []  # what draws takes a while to import
    stale = _drawn(folder)
    with trusting(flown):
        stale |= _drawn(new)
    return sorted(stale & pictures)


def _drawn(folder: Path) -> set[str]:
    """Return the names of the pictures and reports of a run like the one in a folder, if its drawing is known."""
    from mathnavi.renders.drawing import drawing_of

    try:
        cameras = drawing_of(folder).cameras
    except (OSError, ValueError):
        cameras = ()
    return {"report.html", *(f"{name}{ending}" for name in ("video", *cameras) for ending in PICTURES)}
