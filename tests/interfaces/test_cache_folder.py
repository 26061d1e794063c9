"""The cache folder: where the environment or the system says, or else one that no other user can have a hand in."""

from __future__ import annotations

import os
import pwd
import stat
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from mathnavi.interfaces import cache_folder as module
from mathnavi.interfaces.cache_folder import cache_folder


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for temporary files, the only one, beside the current one of a user without home."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(module, "_TEMPORARY", ())
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    for name in ("XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)

    def unknown(user: int) -> None:
        raise KeyError(user)

    monkeypatch.setattr(pwd, "getpwuid", unknown)
    return tmp_path / "temporary"


def private(place: Path) -> Path:
    return place / f"mathnavi-{os.geteuid()}"


@pytest.mark.parametrize(
    ("xdg", "home", "listed", "expected"),
    [
        ("{}/xdg", "{}/home", "{}/listed", "xdg/mathnavi"),
        ("xdg", "{}/home", "{}/listed", "home/.cache/mathnavi"),
        ("", "{}/home", "{}/listed", "home/.cache/mathnavi"),
        (None, "{}/home", "{}/listed", "home/.cache/mathnavi"),
        (None, None, "{}/listed", "listed/.cache/mathnavi"),
        (None, "", "{}/listed", "listed/.cache/mathnavi"),
        (None, "~", "{}/listed", "listed/.cache/mathnavi"),
        ("~/.cache", None, "", None),
        (None, None, None, None),
    ],
)
def test_it_is_where_the_environment_or_the_list_of_users_says(
    xdg: str | None,
    home: str | None,
    listed: str | None,
    expected: str | None,
    place: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is no absolute path does not count, and nothing is made in the current folder."""
    for name, value in (("XDG_CACHE_HOME", xdg), ("HOME", home)):
        if value is not None:
            monkeypatch.setenv(name, value.format(tmp_path))
    if listed is not None:
        monkeypatch.setattr(pwd, "getpwuid", lambda user: SimpleNamespace(pw_dir=listed.format(tmp_path)))
    folder = cache_folder()
    assert folder == (private(place) if expected is None else tmp_path / expected)
    assert folder.is_dir()
    assert list(Path().iterdir()) == []


def a_file(folder: Path) -> None:
    folder.touch()


def a_folder_that_only_others_write_to(folder: Path) -> None:
    (folder / "mathnavi").mkdir(parents=True)
    (folder / ".cache" / "mathnavi").mkdir(parents=True)


@pytest.mark.parametrize("name", ["XDG_CACHE_HOME", "HOME"])
@pytest.mark.parametrize("made", [a_file, a_folder_that_only_others_write_to])
def test_one_that_cannot_be_written_to_is_replaced_by_a_private_one(
    name: str, made: Callable[[Path], None], place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made(tmp_path / "named")
    monkeypatch.setenv(name, str(tmp_path / "named"))
    monkeypatch.setattr(module.os, "access", lambda path, mode: place in Path(path).parents)  # root may write anywhere
    folder = cache_folder()
    assert folder == private(place)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert cache_folder() == folder  # which exists by now


def a_link(place: Path, patch: pytest.MonkeyPatch) -> None:
    (place.parent / "mine").mkdir(mode=0o700)
    private(place).symlink_to(place.parent / "mine")


def open_to_others(place: Path, patch: pytest.MonkeyPatch) -> None:
    private(place).mkdir()
    private(place).chmod(0o750)


def of_another_user(place: Path, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    private(place).mkdir(mode=0o700)


def in_a_folder_of_everybody(place: Path, patch: pytest.MonkeyPatch) -> None:
    place.chmod(0o777)


def in_a_folder_of_another_user(place: Path, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "_ROOT", -1)
    patch.setattr(os, "geteuid", lambda: os.getuid() + 1)


@pytest.mark.parametrize(
    "made", [a_link, open_to_others, of_another_user, in_a_folder_of_everybody, in_a_folder_of_another_user]
)
def test_no_other_user_can_have_made_the_private_one(
    made: Callable[[Path, pytest.MonkeyPatch], None], place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made(place, monkeypatch)
    assert cache_folder() is None


def test_others_cannot_replace_a_private_one_where_everybody_owns_what_he_makes(place: Path) -> None:
    place.chmod(0o1777)  # as /tmp
    assert cache_folder() == private(place)
