"""Folders for what libraries keep, where they have none.

matplotlib lists the fonts and looks for its settings, Mesa compiles shaders, and mujoco_menagerie keeps robots, in
~/.cache and ~/.config. Where these cannot be made, matplotlib warns and lists the fonts again in every process, and no
robot can be had; where a variable names them by a path that is not absolute, all write to the current folder.
"""

from __future__ import annotations

import os


def place_libraries() -> None:
    """Have libraries, here and in the processes that this one starts, use mathnavi's cache folder if they need one."""
    bases = (("XDG_CONFIG_HOME", "~/.config"), ("XDG_CACHE_HOME", "~/.cache"))
    if all(_can_be_made(os.environ.get(name) or os.path.expanduser(usual)) for name, usual in bases):
        return
    from mathnavi.interfaces.cache_folder import cache_folder  # not needed as a rule

    if (folder := cache_folder()) is not None:
        os.environ.setdefault("MPLCONFIGDIR", str(folder / "matplotlib"))
        os.environ.setdefault("MESA_SHADER_CACHE_DIR", str(folder))
        os.environ.setdefault("MENAGERIE_CACHE_DIR", str(folder / "mujoco_menagerie"))


def _can_be_made(folder: str) -> bool:
    """Return True if a folder can be written to, or made in one that can."""
    if not os.path.isabs(folder):
        return False
    while not os.path.lexists(folder):
        folder = os.path.dirname(folder)
    return os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)
