"""Survival means that every table is the same, after every kill that was asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.sweep_survival import ALONE, KILLED, STORES, UNDISTURBED, Arguments, Left, verdict

WHOLE = Left(seconds=1.0, kills=0, rows=20, digest="a", integrity="ok")


def arguments(folder: Path) -> Arguments:
    return Arguments(trials=20, kills=3, folder=folder)


@pytest.mark.parametrize("store", STORES.values())
def test_stores_of_an_earlier_comparison_are_refused(tmp_path: Path, store: str) -> None:
    arguments(tmp_path)
    (tmp_path / store).touch()
    with pytest.raises(ValueError, match=f"folder = .*{store} exists; allowed"):
        arguments(tmp_path)


def test_everything_has_to_be_the_same_and_whole_and_killed_as_often_as_asked(tmp_path: Path) -> None:
    asked = arguments(tmp_path)
    good = {ALONE: WHOLE, UNDISTURBED: WHOLE, KILLED: replace(WHOLE, kills=3)}
    assert all(verdict(good, asked).values())
    for bad in (
        {KILLED: replace(WHOLE, kills=2)},
        {KILLED: replace(WHOLE, kills=3, digest="b")},
        {ALONE: replace(WHOLE, integrity="row 3 missing")},
        {name: replace(left, rows=19) for name, left in good.items()},
    ):
        assert not all(verdict(good | bad, asked).values())
