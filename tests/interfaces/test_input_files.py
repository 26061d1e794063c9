"""A field that names a file counts by what is in the file, whoever declares it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import pytest

from mathnavi.interfaces.field_table import Field, Form, leaves_of
from mathnavi.interfaces.input_files import (
    InputFile,
    PluginName,
    argument_digests,
    content_digest,
    declared_inputs,
    input_digests,
)
from mathnavi.sim.plugin.groups import GROUPS, installed
from mathnavi.sim.plugin.registry import load

TEXTS = {  # fields that hold texts and name neither a file nor a plug-in
    ("scenarios", "simultaneous-arrival", "name"),
    ("scenarios", "simultaneous-arrival", "edge"),
    ("scenarios", "simultaneous-arrival", "consensus_with"),
    ("studies", "real", "data"),  # a folder; the files that it has are declared by the computations over them
}


@dataclass(frozen=True)
class Table:
    """A nested group of fields."""

    file: Annotated[str, InputFile()] = ""
    rows: int = 3


@dataclass(frozen=True)
class Config:
    """Fields of every form that a file may have."""

    table: Table = field(default_factory=Table)
    weights: Annotated[Path | None, InputFile()] = None
    more: Annotated[tuple[str, ...], InputFile()] = ()
    bare: Path | None = None
    word: str = "word"
    words: tuple[str, ...] = ()


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    made = [str(tmp_path / name) for name in "abc"]
    for place in made:
        Path(place).write_text(place)
    return made


def test_every_form_of_field_is_found(files: list[str]) -> None:
    a, b, c = files
    config = Config(Table(a), Path(b), (a, c), Path(c), a)
    digests = {place: content_digest(place) for place in files}
    expected = {
        "weights": digests[b],
        "table.file": digests[a],
        "more": f"{digests[a]},{digests[c]}",
        "bare": digests[c],
        "word": digests[a],
    }
    assert input_digests(config) == expected
    assert input_digests(Config()) == {}
    assert input_digests(Table(a), "planner.") == {"planner.file": digests[a]}


def test_what_is_in_the_file_counts_and_not_its_place(files: list[str], tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.write_bytes(Path(files[0]).read_bytes())
    before = input_digests(Table(files[0]))
    assert input_digests(Table(str(copy))) == before
    copy.write_text("changed")
    assert input_digests(Table(str(copy))) != before


def test_a_folder_counts_with_everything_in_it(tmp_path: Path) -> None:
    (tmp_path / "deep" / "er").mkdir(parents=True)
    inner = tmp_path / "deep" / "er" / "file"
    inner.write_text("one")
    before = content_digest(tmp_path)
    inner.write_text("other")
    changed = content_digest(tmp_path)
    inner.rename(inner.with_name("renamed"))
    assert len({before, changed, content_digest(tmp_path)}) == 3


def test_a_file_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere: no such file"):
        input_digests(Table(str(tmp_path / "nowhere")))
    assert input_digests(Config(bare=tmp_path / "nowhere")) == {}  # it may be written to


def test_arguments_of_a_call_name_files_too(files: list[str]) -> None:
    a, b, c = files
    found = argument_digests(((Table(a), {"there": Path(b)}), c, "text", 1))
    assert found == [content_digest(each) for each in files]


def test_a_path_without_a_mark_counts_where_there_is_a_file(files: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    a, b, _ = files
    config = Config(Table(a), words=("red", b), word="x" * 5000 + ".", bare=Path(b))
    assert input_digests(config) == {
        "table.file": content_digest(a),
        **dict.fromkeys(("bare", "words"), content_digest(b)),
    }
    assert declared_inputs(config) == {"table.file"}
    monkeypatch.chdir(Path(a).parent)
    assert input_digests(Config(bare=Path("a"))) == {"bare": content_digest(a)}
    assert input_digests(Config(word="a")) == {}  # a name, and by chance that of a file


def _texts(form: Form) -> bool:
    """True for a type that any text may be a value of."""
    return form.kind is str or any(_texts(each) for each in form.members)


def _undeclared(field: Field) -> bool:
    """True for a field that may name a file or a plug-in and does not say so by its type."""
    form = field.form
    return (_texts(form) and form.mark(InputFile) is None and form.mark(PluginName) is None) or (
        "Path" in str(form.kind) and form.mark(InputFile) is None
    )


def test_every_installed_configuration_declares_the_files_that_it_names() -> None:
    kinds = [kind for kind in GROUPS if kind not in ("terrains", "drawings", "logs")]  # whose fields are of no run
    found = {
        (kind, point.name, leaf.path)
        for kind in kinds
        for point in installed(kind)
        for leaf in leaves_of(load(kind, point.name).Config)
        if _undeclared(leaf)
    }
    assert found == TEXTS
    bare = {leaf.path for leaf in leaves_of(Config) if _undeclared(leaf)}
    assert bare == {"bare", "word", "words"}  # such fields would be found
