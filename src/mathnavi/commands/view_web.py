"""``mathnavi view --web`` and ``--save``: the scene of a run, or of several, as a page, served or written to a file."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from mathnavi.commands.errors import bad_input
from mathnavi.commands.web_server import PageServer
from mathnavi.interfaces.writing import write_text
from mathnavi.sim.records.folder_names import names_of


def page_of(folders: Sequence[Path], speed: float | None) -> str:
    """Return the page of the run in a folder, or of the runs in several; BadInputError if one cannot be shown."""
    from mathnavi.renders.scene.side_by_side import side_by_side  # what draws takes a while to import
    from mathnavi.renders.web.document import document
    from mathnavi.renders.web.scene import read_scene

    with bad_input():
        scenes = {name: read_scene(folder) for name, folder in zip(names_of(folders), folders, strict=True)}
        scene = next(iter(scenes.values())) if len(scenes) == 1 else side_by_side(scenes)
        return document(replace(scene, speed=speed))


def show(folders: Sequence[Path], speed: float | None, save: Path | None, address: tuple[str, int] | None) -> int:
    """Write the page to a file, and serve it at an address until Ctrl-C, each if requested."""
    errors = Console(stderr=True, markup=False, emoji=False)
    what = ", ".join(map(str, folders))
    server = None if address is None else PageServer(*address, lambda: page)
    try:
        with errors.status(f"reading {what}"):  # visible only at a terminal
            page = page_of(folders, speed)
        if save is not None:
            with bad_input():
                write_text(save, page)
            print(save)
        if server is not None:
            serve(server, what)
    finally:
        if server is not None:
            server.server_close()
    return 0


def serve(server: PageServer, what: str) -> None:
    """Print the address of the page, and serve it until Ctrl-C."""
    print(f"{what} is shown at {server.url} until Ctrl-C", flush=True)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        print("", file=sys.stderr)
