"""The installed package is this repository: its packages, its entry points, its versions."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint, distribution, version
from pathlib import Path

import yaml
from packaging.requirements import Requirement

from mathnavi.renders.drawing import Drawing

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOLDERS = ("interfaces", "models", "controllers", "estimators", "sim", "renders", "studies")
ENTRY_POINTS = [
    EntryPoint(name, value, group)
    for group, members in {**PROJECT["entry-points"], "console_scripts": PROJECT["scripts"]}.items()
    for name, value in members.items()
]


def test_every_folder_is_imported_from_this_repository(tmp_path: Path) -> None:
    """A fresh interpreter in another folder, so that neither pytest nor the working directory helps."""
    script = (
        "import importlib, json; from pathlib import Path; print(json.dumps([str(Path(importlib.import_module("
        f"'mathnavi.' + f).__file__).resolve()) for f in {FOLDERS}]))"
    )
    shown = subprocess.check_output([sys.executable, "-P", "-c", script], cwd=tmp_path, text=True)
    assert [Path(file) for file in json.loads(shown)] == [ROOT / folder / "__init__.py" for folder in FOLDERS]


def test_folders_add_nothing_of_their_own() -> None:
    assert not [folder for folder in FOLDERS if (ROOT / folder / "__init__.py").read_text(encoding="utf-8").strip()]


def test_every_entry_point_is_installed_and_loads_and_there_is_no_other() -> None:
    installed = {(e.group, e.name): e for e in distribution("mathnavi").entry_points}
    assert {key: e.value for key, e in installed.items()} == {(e.group, e.name): e.value for e in ENTRY_POINTS}, (
        "re-install: make .venv"
    )
    for entry_point in installed.values():
        loaded = entry_point.load()
        assert callable(loaded) or isinstance(loaded.drawing, Drawing), entry_point


def test_installed_version_is_the_projects_and_in_the_changelog() -> None:
    assert version("mathnavi") == PROJECT["version"]
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    assert any(line.startswith("## ") and PROJECT["version"] in line for line in lines)


def test_every_dependency_is_in_its_tested_range() -> None:
    requirements = [Requirement(text) for text in PROJECT["dependencies"]]
    assert [each.name for each in requirements if version(each.name) not in each.specifier] == []


def test_the_citation_is_that_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (citation["title"], citation["version"], citation["license"]) == (
        PROJECT["name"],
        PROJECT["version"],
        PROJECT["license"],
    )
    assert citation["authors"] == PROJECT["authors"]
    assert citation["keywords"] == PROJECT["keywords"]
    (thesis,) = citation["references"]
    assert (thesis["type"], thesis["year"]) == ("thesis", 2006)
    assert thesis["title"] in (ROOT / "README.md").read_text(encoding="utf-8").replace("\n", " ")


def test_nothing_forbids_to_publish() -> None:
    assert not [classifier for classifier in PROJECT["classifiers"] if classifier.startswith("Private")]
