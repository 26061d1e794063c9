"""CasADi functions as shared libraries: kept, whole, and by their content."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import casadi as ca
import pytest

from mathnavi.models import compilation
from mathnavi.models.compilation import compiled, compiler

pytestmark = pytest.mark.skipif(compiler() is None, reason="there is no C compiler named cc")


def solver(weight: float) -> ca.Function:
    x = ca.SX.sym("x")
    return ca.nlpsol("solver", "ipopt", {"x": x, "f": weight * (x - 3.0) ** 2}, {"print_time": False})


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the libraries."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "mathnavi"


def test_functions_are_compiled_once_and_others_beside_them(cache: Path) -> None:
    library = compiled(solver(1.0))
    written = library.stat().st_mtime_ns
    assert compiled(solver(1.0)) == library
    assert library.stat().st_mtime_ns == written
    assert compiled(solver(2.0)) != library
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damaged", ["cut short", "changed", "exchanged"])
def test_a_damaged_library_is_compiled_anew(damaged: str) -> None:
    library, other = compiled(solver(1.0)), compiled(solver(2.0))
    good = library.read_bytes()
    at = len(good) // 3
    content = {
        "cut short": good[:at],
        "changed": good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :],
        "exchanged": other.read_bytes(),
    }
    library.write_bytes(content[damaged])
    again = compiled(solver(1.0))
    assert again.read_bytes() == good
    assert compiled(solver(1.0)) == again


def test_what_is_no_library_is_passed_over(cache: Path) -> None:
    library = compiled(solver(1.0))
    key = library.stem.partition("-")[0]
    (cache / f"{key}-0.so").mkdir()  # before the library in their order
    os.mkfifo(cache / f"{key}-1.so")
    with (cache / f"{key}-2.so").open("wb") as large:
        large.truncate(2**30)
    assert compiled(solver(1.0)) == library


def test_where_nothing_can_be_kept_a_process_keeps_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "cache_folder", lambda: None)
    library = compiled(solver(1.0))
    assert compiled(solver(1.0)) == library
    assert stat.S_IMODE(library.parent.stat().st_mode) == 0o700


def test_what_the_compiler_says_against_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    failing = tmp_path / "cc"
    failing.write_text("#!/bin/sh\necho no room left >&2\nexit 3\n", encoding="utf-8")
    failing.chmod(failing.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with pytest.raises(OSError, match=r"ended with 3 and said: no room left"):
        compiled(solver(1.0))
