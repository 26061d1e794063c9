"""Hostile inputs of every kind end well: one line that names the culprit, nothing lost, nothing written beside."""

from __future__ import annotations

import fcntl
import json
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.commands.known import COMMANDS
from tests.hostile.attacks.attack import bring
from tests.hostile.judge import Case, box, judged
from tests.hostile.originals import originals
from tests.hostile.program import findings, remove

SEED, COUNT, PARTS = 94, 240, 12  # every attack is among them; .ci/weekly makes thousands of others
EXAMPLES = 30

scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20)
documents = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=9), inner, max_size=4)
)
words = st.text(st.characters(exclude_characters="\0", exclude_categories=()), max_size=20)


@pytest.fixture(scope="session")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The good files, made once for all workers."""
    folder = tmp_path_factory.getbasetemp().parent / "hostile-originals"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return originals(folder)


@pytest.mark.parametrize("part", range(PARTS))
def test_hostile_inputs_end_well(part: int, shop: Path, tmp_path: Path) -> None:
    numbers = range(part * COUNT // PARTS, (part + 1) * COUNT // PARTS)
    failed = [
        f"python -m tests.hostile --seed {SEED} --only {found.number}: {'; '.join(found.outcome.faults)}: "
        f"{shlex.join(found.case.words)!r:.200}: {found.case.done}: {found.outcome.error[-300:]}"
        for found in findings(SEED, numbers, shop, tmp_path)
        if found.outcome.faults
    ]
    assert failed == []


@pytest.fixture(scope="module")
def place(shop: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a run, for inputs that leave it as it is."""
    folder = box(tmp_path_factory.mktemp("hostile"))
    bring(shop, folder / "work", "textbook", "study", "hills.npz")
    yield folder
    remove(folder)


@given(command=st.sampled_from(sorted(COMMANDS)), given_words=st.lists(words, max_size=4))
@settings(max_examples=EXAMPLES)
def test_any_words_are_refused_in_one_line(place: Path, command: str, given_words: list[str]) -> None:
    outcome = judged(Case(command, "words", (command, *given_words)), place)
    assert outcome.faults == (), outcome.error or outcome.trace


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("textbook/config.json", "run --from textbook --out new"),
        ("textbook/config.json", "compare textbook textbook --out new.html"),
        ("textbook/summary.json", "compare textbook textbook --out new.html"),
        ("textbook/events.jsonl", "view textbook"),
        ("study/noise.json", "compare study study --out new.html"),
    ],
)
@given(document=documents)
@settings(max_examples=EXAMPLES // 2)
def test_any_document_in_the_place_of_a_good_one_is_refused_in_one_line(
    place: Path, name: str, line: str, document: object
) -> None:
    path = place / "work" / name
    good = path.read_bytes()
    path.write_text(json.dumps(document))
    try:
        outcome = judged(Case(line, name, tuple(line.split()), writes=("new", "new.html")), place)
    finally:
        path.write_bytes(good)
        remove(place / "work/new")
        (place / "work/new.html").unlink(missing_ok=True)
    assert outcome.faults == (), outcome.error or outcome.trace
