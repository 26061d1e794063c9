"""Helps in a terminal of 80 columns: every line fits, and no word is broken."""

from __future__ import annotations

import pytest

from mathnavi.commands.cli import main
from mathnavi.commands.known import COMMANDS

WORDS = [
    (),
    *((name,) for name in COMMANDS),
    ("run", "safe-flight"),
    ("study", "safety"),
    ("store", "export"),
    ("terrain", "import"),
]


@pytest.mark.parametrize("words", WORDS, ids=" ".join)
def test_a_help_fits_into_80_columns(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def printed(columns: int) -> str:
        monkeypatch.setenv("COLUMNS", str(columns))
        assert main([*words, "--help"]) == 0
        return capsys.readouterr().out

    narrow, wide = printed(80), printed(2000)
    assert [line for line in narrow.splitlines() if len(line) > 80] == []
    broken = set(narrow.split()) - set(wide.split())
    assert {word for word in broken if word.strip("-─")} == set()
