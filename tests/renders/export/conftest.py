"""Runs to export, shared by the tests of all formats."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.commands.cli import main

ROBOT = ("range-localisation", "--duration", "0.4", "--sensors", "0", "90", "--estimator", "range_ekf")
NUMBERS = ("textbook-observer", "--duration", "0.2", "--tolerance", "1000")


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory, run_dir: Path) -> dict[str, Path]:
    """Folders of a flight, of a robot that localises itself, and of a run of numbers alone."""
    folder = tmp_path_factory.mktemp("exported")
    for name, words in (("robot", ROBOT), ("numbers", NUMBERS)):
        assert main(["run", *words, "--out", str(folder / name)]) in (0, 1)
    return {"flight": run_dir, "robot": folder / "robot", "numbers": folder / "numbers"}
