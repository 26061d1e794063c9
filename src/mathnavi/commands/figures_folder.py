"""A folder for matplotlib, where it has none of its own.

It keeps its list of fonts in the user's cache and looks for its settings in ~/.config. Where one of them cannot be
made, it warns, makes a new folder and lists the fonts again, in every process; a path that is not absolute it takes
from the current folder.
"""

from __future__ import annotations

import os


def place_matplotlib() -> None:
    """Have matplotlib, here and in the processes that this one starts, use mathnavi's cache folder if it needs one."""
    bases = (("XDG_CONFIG_HOME", "~/.config"), ("XDG_CACHE_HOME", "~/.cache"))
    if os.environ.get("MPLCONFIGDIR") or all(
        _can_be_made(os.path.join(os.environ.get(name) or os.path.expanduser(usual), "matplotlib"))
        for name, usual in bases
    ):
        return
    from mathnavi.interfaces.cache_folder import cache_folder  # not needed as a rule

    if (folder := cache_folder()) is not None:
        os.environ["MPLCONFIGDIR"] = str(folder / "matplotlib")


def _can_be_made(folder: str) -> bool:
    """Return True if a folder can be written to, or made in one that can."""
    if not os.path.isabs(folder):
        return False
    while not os.path.lexists(folder):
        folder = os.path.dirname(folder)
    return os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)
