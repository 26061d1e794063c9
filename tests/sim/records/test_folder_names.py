"""Names of folders: as short as tells them apart."""

from __future__ import annotations

from pathlib import Path

from mathnavi.sim.records.folder_names import names_of


def test_a_name_is_as_short_as_tells_a_folder_from_the_others(tmp_path: Path) -> None:
    a, b, c = tmp_path / "a" / "run", tmp_path / "b" / "run", tmp_path / "c"
    assert names_of([a]) == ["run"]
    assert names_of([a, c]) == ["run", "c"]
    assert names_of([a, b, c]) == ["a/run", "b/run", "c"]
    assert names_of([a, a, c]) == ["run", "run (2)", "c"]
