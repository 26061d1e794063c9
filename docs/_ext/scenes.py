"""The scenes that pages embed, ``_static/scenes/NAME.html``: runs that are flown when the pages are built."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

from sphinx.application import Sphinx

from mathnavi.commands import cli

SCENES: dict[str, tuple[str, ...]] = {
    "flight": (
        "safe-flight", "--terrain", "jacksboro", "--start", "3000", "4000", "700", "--target", "11000", "12000", "900",
    ),
    "range": ("range-localisation", "--seed", "1", "--duration", "8"),
    "arm": ("arm-velocity", "--mechanism", "seven-joint", "--duration", "6"),
}  # fmt: skip


def fly(app: Sphinx) -> None:
    """Fly the run of each scene, and save its page."""
    if app.builder.format != "html":
        return
    folder = Path(app.srcdir) / "_static" / "scenes"
    folder.mkdir(parents=True, exist_ok=True)
    for name, words in SCENES.items():
        with tempfile.TemporaryDirectory() as scratch, contextlib.redirect_stdout(io.StringIO()):
            for command in (
                ("run", *words, "--out", scratch),
                ("view", scratch, "--save", str(folder / f"{name}.html")),
            ):
                if cli.main(command):
                    raise RuntimeError(f"mathnavi {' '.join(command)} failed")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", fly)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
