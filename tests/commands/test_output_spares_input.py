"""No command writes over what it reads, by whatever name it is given: refused before anything is touched."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.interfaces.errors import FieldError
from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.records.store import Record, Store

Refused = Callable[..., str]
LINKS: dict[str, Callable[[Path, Path], object]] = {
    "hard": lambda source, link: os.link(source, link),
    "symbolic": lambda source, link: link.symlink_to(source),
}
RUN = ["textbook-observer", "--duration", "1"]


def a_map() -> HeightField:
    return HeightField(np.zeros((8, 8)), 100.0, "plain")


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """The line with which a command is refused; every file is as it was, with its time."""
    monkeypatch.chdir(tmp_path)
    with Store.open("s.csv") as store:
        store.add(Record("k", "hover", {}, 0, "1", "ok", True, {"figure": 1.0}))
    (tmp_path / "s.jsonl").write_bytes(Path("s.csv").read_bytes())
    (tmp_path / "s.html").write_bytes(Path("s.csv").read_bytes())
    (tmp_path / "folder").mkdir()

    def refuse(*argv: str) -> str:
        before = {path: (path.lstat().st_mtime_ns, path.lstat().st_ino) for path in tmp_path.rglob("*")}
        contents = {path: path.read_bytes() for path in before if path.is_file()}
        capsys.readouterr()
        assert main(argv) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert {path: (path.lstat().st_mtime_ns, path.lstat().st_ino) for path in tmp_path.rglob("*")} == before
        assert all(path.read_bytes() == content for path, content in contents.items())
        return err

    return refuse


@pytest.mark.parametrize("name", ["s.csv", "s.jsonl"])
@pytest.mark.parametrize("way", ["{0}", "./{0}", "folder/../{0}", "{1}/{0}"])
def test_a_store_is_not_exported_over_itself(refused: Refused, tmp_path: Path, name: str, way: str) -> None:
    out = way.format(name, tmp_path)
    assert f"--out = {Path(out)} is what is read" in refused("store", "export", name, "--out", out)


@pytest.mark.parametrize("kind", LINKS)
def test_nor_through_a_link_from_either_side(refused: Refused, tmp_path: Path, kind: str) -> None:
    LINKS[kind](tmp_path / "s.csv", tmp_path / "other.csv")
    for source, out in (("s.csv", "other.csv"), ("other.csv", "s.csv")):
        assert f"--out = {out} is what is read, {source}" in refused("store", "export", source, "--out", out)


def test_a_name_in_other_letters_is_the_store_only_where_the_folder_says_so(refused: Refused, tmp_path: Path) -> None:
    os.rename("s.csv", "S.csv")
    insensitive = Path("s.csv").exists()
    if insensitive:
        assert "is what is read" in refused("store", "export", "S.csv", "--out", "s.csv")
    else:
        assert main(["store", "export", "S.csv", "--out", "s.csv"]) == 0
        with Store.existing("S.csv") as store:
            assert len(store.records()) == 1


def test_the_store_itself_refuses_it_too(refused: Refused) -> None:
    with Store.existing("s.csv") as store:
        for export in (store.export_csv, store.export_jsonl):
            with pytest.raises(FieldError, match=r"out = s\.csv is what is read"):
                export(Path("s.csv"))
        assert len(store.records()) == 1


def test_a_comparison_is_not_written_over_what_it_compares(refused: Refused) -> None:
    assert "--out = s.html is what is read" in refused("compare", "s.html", "s.csv", "--out", "s.html")
    os.symlink("s.csv", "page.html")
    assert "--out = page.html is what is read, s.csv" in refused("compare", "s.html", "s.csv", "--out", "page.html")


@pytest.mark.parametrize("kind", ["same", *LINKS])
def test_an_elevation_model_is_not_imported_over_itself(refused: Refused, tmp_path: Path, kind: str) -> None:
    write_npz(a_map(), tmp_path / "map.npz")
    out = "map.npz" if kind == "same" else "other.npz"
    if kind != "same":
        LINKS[kind](tmp_path / "map.npz", tmp_path / out)
    words = ["terrain", "import", "map.npz", "--out", out, "--crop", "0", "0", "40", "40"]
    assert f"--out = {out} is what is read" in refused(*words)
    with pytest.raises(FieldError, match="out = "):
        import_dem("map.npz", out)


def test_a_picture_does_not_replace_the_map_it_shows(refused: Refused, tmp_path: Path) -> None:
    write_npz(a_map(), tmp_path / "map.npz")
    os.link("map.npz", "map.png")
    assert "--out = map.png is what is read, map.npz" in refused("terrain", "show", "map.npz", "--out", "map.png")


def test_a_run_does_not_replace_the_one_that_it_repeats(refused: Refused) -> None:
    assert main(["run", *RUN, "--out", "renders/out/textbook-observer-seed0"]) in (0, 1)
    folder = Path("renders/out/textbook-observer-seed0")
    os.symlink(folder, "link")
    assert "allowed: another name" in refused("run", "--from", str(folder)), "its folder where --out is not given"
    for source, out in ((folder, folder), (folder, "link"), ("link", folder), ("link", "folder/../link")):
        assert "is what is read" in refused("run", "--from", str(source), "--out", str(out))
    assert "is what is read" in refused("estimate", "textbook_ekf", str(folder), "--out", "link")


def test_a_run_does_not_take_a_folder_that_holds_a_file_it_reads(refused: Refused, tmp_path: Path) -> None:
    assert main(["run", *RUN, "--out", "run"]) in (0, 1)
    write_npz(a_map(), tmp_path / "run" / "map.npz")
    for place in ("run/map.npz", "folder/../run/map.npz"):
        line = refused("run", "safe-flight", "--terrain", place, "--out", "run")
        assert f"--out = run holds {place}, which the run reads" in line


@pytest.mark.parametrize("words", ["sweep safe-flight --trials 1", "search safe-flight --minimise clearance_margin_m"])
def test_a_page_does_not_replace_the_store_or_a_file_that_is_read(refused: Refused, tmp_path: Path, words: str) -> None:
    write_npz(a_map(), tmp_path / "map.npz")
    os.link("map.npz", "new.html")
    line = refused(*words.split(), "--terrain", "map.npz", "--store", "new.db", "--report")
    assert "--report = new.html is what is read, map.npz" in line
    os.link("s.csv", "s.db")
    os.unlink("s.html")
    os.link("s.db", "s.html")
    assert "--report = s.html is what is read, s.db" in refused(*words.split(), "--store", "s.db", "--report")
