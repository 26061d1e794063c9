"""The version of the code counts everything that a stranger's plug-in is made of."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from mathnavi.sim.plugin import code_version as counted
from mathnavi.sim.plugin.code_version import code_version


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A plug-in in a single module, that imports a module beside it, a package and an installed one."""
    name = tmp_path.name
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / f"{name}_own.py").write_text(
        f"import json, numpy as np\nif True:\n    from {name}_helper import number\n\nclass Mine:\n    pass\n"
    )
    (tmp_path / f"{name}_helper.py").write_text(f"import {name}_package.deep as deep\nnumber = 1\n")
    (tmp_path / f"{name}_package").mkdir()
    (tmp_path / f"{name}_package" / "__init__.py").write_text("import nowhere_to_be_found\n")
    (tmp_path / f"{name}_package" / "deep.py").write_text("")
    (tmp_path / f"{name}_package" / "weights.json").write_text("[1]")
    (tmp_path / f"{name}_unused.py").write_text("")
    made = type("Mine", (), {})
    made.__module__ = f"{name}_own"
    return made


def fresh(plugin: Any) -> str:
    counted._stranger.cache_clear()
    return code_version(plugin)


@pytest.mark.honoured("plug-in", "code of the module and of what it imports, as part of the version")
def test_what_a_module_imports_counts_and_what_it_does_not_does_not(plugin: Any, tmp_path: Path) -> None:
    name = tmp_path.name
    versions = [fresh(plugin)]
    for file in (f"{name}_own.py", f"{name}_helper.py", f"{name}_package/deep.py", f"{name}_package/weights.json"):
        with (tmp_path / file).open("a") as opened:
            opened.write("\n")
        versions.append(fresh(plugin))
    assert len(set(versions)) == len(versions)
    (tmp_path / f"{name}_unused.py").write_text("changed = True")
    (tmp_path / f"{name}_package" / "__pycache__").mkdir()
    (tmp_path / f"{name}_package" / "__pycache__" / "deep.pyc").write_text("cached")
    assert fresh(plugin) == versions[-1]


def test_the_version_of_an_installed_package_counts(plugin: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    before = fresh(plugin)
    monkeypatch.setattr(counted, "version", lambda name: "9.9" if name == "numpy" else version(name))
    assert fresh(plugin) != before


@pytest.mark.refused("plug-in", "a module without sources")
def test_a_module_without_sources_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "made_in_memory", ModuleType("made_in_memory"))
    made = type("Mine", (), {"__module__": "made_in_memory"})
    with pytest.raises(ValueError, match="'made_in_memory' have no file"):
        fresh(made)
