"""What libraries keep has a folder, which is no part of the current one, also for a user without a home."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mathnavi.commands import library_folders
from mathnavi.interfaces import cache_folder

LIBRARIES = {
    "MPLCONFIGDIR": "matplotlib",
    "MESA_SHADER_CACHE_DIR": "",
    "MENAGERIE_CACHE_DIR": "mujoco_menagerie",
}
"""places within our folder by the variables that name them"""


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of what mathnavi keeps; a file is where the home should be."""
    for name in (*LIBRARIES, "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "")  # so that it is as before afterwards
        monkeypatch.delenv(name)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "file").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    monkeypatch.setattr(cache_folder, "cache_folder", lambda: tmp_path / "kept")
    return tmp_path / "kept"


@pytest.mark.parametrize(
    ("home", "cache", "own"),
    [("home", "", True), ("file", "", False), ("home", "{}/file", False), ("home", "cache", False), ("~", "", False)],
)
def test_each_has_its_own_where_it_can_be_made(
    home: str, cache: str, own: bool, kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", home if home == "~" else str(kept.parent / home))
    monkeypatch.setenv("XDG_CACHE_HOME", cache.format(kept.parent))
    library_folders.place_libraries()
    places = [os.environ.get(name) for name in LIBRARIES]
    assert places == [None if own else str(kept / name) for name in LIBRARIES.values()]


def test_one_that_is_named_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    library_folders.place_libraries()
    assert os.environ["MPLCONFIGDIR"] == str(tmp_path)


def test_without_a_home_matplotlib_says_nothing(kept: Path) -> None:
    """It would warn of its temporary folder."""
    library_folders.place_libraries()
    script = "import matplotlib; print(matplotlib.get_cachedir()); print(matplotlib.get_configdir())"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert (done.stdout.split(), done.stderr) == ([str(kept / "matplotlib")] * 2, "")
    assert list(Path().iterdir()) == []
