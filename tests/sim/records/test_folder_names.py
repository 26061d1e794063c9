"""Names of folders: as short as tells them apart."""

from __future__ import annotations

from pathlib import Path

from mathnavi.renders.comparison.comparison import shortened
from mathnavi.sim.records.folder_names import names_of


def test_a_name_is_as_short_as_tells_a_folder_from_the_others(tmp_path: Path) -> None:
    a, b, c = tmp_path / "a" / "run", tmp_path / "b" / "run", tmp_path / "c"
    assert names_of([a]) == ["run"]
    assert names_of([a, c]) == ["run", "c"]
    assert names_of([a, b, c]) == ["a/run", "b/run", "c"]
    assert names_of([a, a, c]) == ["run", "run (2)", "c"]


def test_long_names_of_two_runs_keep_what_tells_them_apart() -> None:
    """A column of a terminal cuts the end of a name, where two of them often differ."""
    assert shortened("out", "out-kalman") == ("out", "out-kalman")
    assert shortened("rover.scenario-seed3-wide", "rover.scenario-seed4-wide") == ("…o-seed3-wide", "…o-seed4-wide")
    assert shortened("safe-flight-with-gusts-seed1", "safe-flight-with-gusts-seed1-kalman") == (
        "…-seed1",
        "…-seed1-kalman",
    )
    assert shortened("a" * 30, "a" * 30) == ("a" * 30, "a" * 30)
