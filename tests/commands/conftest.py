from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.commands.cli import main

ROBOT = ("range-localisation", "--duration", "0.5", "--sensors", "0", "90")
NUMBERS = ("textbook-observer", "--duration", "0.2", "--tolerance", "1000")


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The runs ``robot``, which has a body, and ``numbers``, which has none."""
    folder = tmp_path_factory.mktemp("runs")
    for name, words in (("robot", ROBOT), ("numbers", NUMBERS)):
        assert main(["run", *words, "--out", str(folder / name)]) in (0, 1)
    return folder
