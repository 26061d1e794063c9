"""The installed package is this repository: its packages, its entry points, its versions."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint, distribution, entry_points, version
from pathlib import Path

import pytest
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


@pytest.mark.parametrize("entry_point", ENTRY_POINTS, ids=lambda e: f"{e.group}:{e.name}")
def test_every_entry_point_is_installed_and_loads(entry_point: EntryPoint) -> None:
    installed = entry_points(group=entry_point.group, name=entry_point.name)
    assert [e.value for e in installed] == [entry_point.value], "re-install: make .venv"
    loaded = entry_point.load()
    assert callable(loaded) or isinstance(loaded.drawing, Drawing)


def test_nothing_else_is_installed_as_an_entry_point() -> None:
    installed = distribution("mathnavi").entry_points
    assert {(e.group, e.name) for e in installed} == {(e.group, e.name) for e in ENTRY_POINTS}


def test_installed_version_is_the_projects_and_in_the_changelog() -> None:
    assert version("mathnavi") == PROJECT["version"]
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    assert any(line.startswith("## ") and PROJECT["version"] in line for line in lines)


@pytest.mark.parametrize("requirement", [Requirement(text) for text in PROJECT["dependencies"]], ids=lambda r: r.name)
def test_every_dependency_is_in_its_tested_range(requirement: Requirement) -> None:
    assert version(requirement.name) in requirement.specifier


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
