"""Compiled kernels are kept by their content: shared by equal sources, and never used for others."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from numba import typeof
from numba.core import config
from numba.core.dispatcher import Dispatcher

import mathnavi
from mathnavi.interfaces.compiled import any_missing, kernel_digest, njit
from tests.one_name import FOLDERS

ROOT = Path(mathnavi.__file__).parent
CALLEE = """
from typing import NamedTuple
from mathnavi.interfaces.compiled import njit

class Pair(NamedTuple):
    a: float
    b: float

FACTOR, SIGNS = 2.0, (1.0, -1.0)

@njit(cache=True)
def inner(x):
    return FACTOR * x * SIGNS[0]
"""
CALLER = """
from mathnavi.interfaces.compiled import njit
import kernel_callee
from kernel_callee import inner

@njit(cache=True)
def outer(pair):
    return inner(pair.a) - pair.b
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of the kernels."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "kernels"))
    yield tmp_path / "kernels"
    for name in ("kernel_callee", "kernel_caller"):
        sys.modules.pop(name, None)


def written(folder: Path, callee: str = CALLEE, caller: str = CALLER) -> tuple[ModuleType, ModuleType]:
    """Both modules, written to a folder and imported from it, as from another checkout."""
    folder.mkdir(exist_ok=True)
    modules = []
    for name, source in (("kernel_callee", callee), ("kernel_caller", caller)):
        file = folder / f"{name}.py"
        file.write_text(source, encoding="utf-8")
        spec = importlib.util.spec_from_file_location(name, file)
        assert spec is not None
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        exec(compile(source, str(file), "exec"), module.__dict__)
        modules.append(module)
    return modules[0], modules[1]


def called(modules: tuple[ModuleType, ModuleType]) -> float:
    callee, caller = modules
    return float(caller.outer(callee.Pair(a=3.0, b=1.0)))


def hits(kernel: Dispatcher) -> int:
    return sum(kernel.stats.cache_hits.values())


def test_another_checkout_with_the_same_kernels_compiles_nothing(tmp_path: Path) -> None:
    assert called(written(tmp_path / "here")) == 5.0
    there = written(tmp_path / "there", caller="# moved down\n" + CALLER)
    assert called(there) == 5.0
    assert hits(there[1].outer) == 1


@pytest.mark.parametrize(
    ("old", "new", "result"),
    [
        ("FACTOR *", "FACTOR * FACTOR *", 11.0),
        ("FACTOR, SIGNS = 2.0", "FACTOR, SIGNS = 3.0", 8.0),
        ("(1.0, -1.0)", "(-1.0, 1.0)", -7.0),
        ("a: float\n    b: float", "b: float\n    a: float", 5.0),
    ],
)
def test_a_change_of_what_a_kernel_uses_compiles_it_anew(tmp_path: Path, old: str, new: str, result: float) -> None:
    """In another file, too: what is called, a constant, the order of a named tuple's fields."""
    called(written(tmp_path))
    assert old in CALLEE
    changed = written(tmp_path, CALLEE.replace(old, new))
    assert called(changed) == result
    assert hits(changed[1].outer) == 0


def test_a_kernel_that_is_called_by_its_modules_name_counts_too() -> None:
    """For modules of mathnavi, which alone change with its kernels."""
    digests = set()
    for callee in (CALLEE, CALLEE.replace("2.0", "3.0")):
        module = ModuleType("mathnavi.kernel_callee")
        exec(callee, module.__dict__)
        caller: dict[str, Any] = {"__name__": "kernel_caller", "called": module, "njit": njit}
        exec("@njit(cache=True)\ndef outer(x):\n    return called.inner(x)\n", caller)
        digests.add(kernel_digest(caller["outer"]))
    assert len(digests) == 2


def cut_short(files: list[Path]) -> None:
    for file in files:
        file.write_bytes(file.read_bytes()[:100])


def emptied(files: list[Path]) -> None:
    for file in files:
        file.write_bytes(b"")


def with_one_bit_changed(files: list[Path]) -> None:
    """In the middle, which is machine code or data: what follows from it may be a crash, or a wrong number."""
    for file in files:
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes(content)


def exchanged(files: list[Path]) -> None:
    """Each holds what another kernel's should."""
    contents = [file.read_bytes() for file in files]
    for file, content in zip(files, [*contents[1:], contents[0]], strict=True):
        file.write_bytes(content)


@pytest.mark.parametrize("damage", [cut_short, emptied, with_one_bit_changed, exchanged])
def test_a_damaged_file_is_compiled_anew(damage: Callable[[list[Path]], None], tmp_path: Path, folder: Path) -> None:
    called(written(tmp_path))
    files = sorted(folder.glob("*.nbc"))
    assert len(files) >= 2
    damage(files)
    again = written(tmp_path)
    assert called(again) == 5.0
    assert hits(again[1].outer) == 0
    once_more = written(tmp_path)
    assert called(once_more) == 5.0
    assert hits(once_more[1].outer) == 1


def test_without_a_folder_to_write_to_kernels_are_compiled_all_the_same(tmp_path: Path, folder: Path) -> None:
    folder.write_text("no folder", encoding="utf-8")
    assert called(written(tmp_path)) == 5.0


def test_a_global_without_a_known_content_is_named(tmp_path: Path) -> None:
    _, caller = written(tmp_path, caller=CALLER + "\ninner = object()\n")
    with pytest.raises(TypeError, match=r"kernel_caller\.inner = <object .*> in a kernel; allowed: kernels, "):
        kernel_digest(caller.outer)


def test_every_kernel_has_a_digest_and_is_kept() -> None:
    files = [file for name in FOLDERS for file in (ROOT / name).rglob("*.py") if "njit(cache=True" in file.read_text()]
    kernels = 0
    for file in files:
        module = importlib.import_module(".".join(("mathnavi", *file.relative_to(ROOT).with_suffix("").parts)))
        for kernel in vars(module).values():
            if isinstance(kernel, Dispatcher) and kernel.__module__ == module.__name__:
                assert len(kernel_digest(kernel)) == 64
                kernels += type(kernel._cache).__name__ == "KernelCache"
    assert kernels > 150


INNER = CALLEE.replace("import njit", "import inner_njit").replace("@njit(cache=True)", "@inner_njit")


def test_an_inner_kernel_is_kept_with_its_callers_only(folder: Path, tmp_path: Path) -> None:
    modules = written(tmp_path / "one", INNER)
    assert called(modules) == 5.0
    assert [file.name.split("-")[0] for file in folder.iterdir()] == ["kernel_caller.outer"]
    again = written(tmp_path / "two", INNER)
    assert called(again) == 5.0
    assert hits(again[1].outer) == 1
    assert not again[0].inner.signatures
    assert called(written(tmp_path / "three", INNER.replace("FACTOR, SIGNS = 2.0", "FACTOR, SIGNS = 3.0"))) == 8.0


def test_python_cannot_call_an_inner_kernel(tmp_path: Path) -> None:
    callee, _ = written(tmp_path / "one", INNER)
    with pytest.raises(TypeError, match="called from Python; allowed: a call by a kernel"):
        callee.inner(1.0)


def test_kernels_are_missing_until_they_are_compiled(tmp_path: Path) -> None:
    _, caller = written(tmp_path / "one", INNER)
    pair = typeof(sys.modules["kernel_callee"].Pair(a=3.0, b=1.0))
    assert any_missing([(caller.outer, (pair,))])
    caller.outer.compile((pair,))
    assert not any_missing([(caller.outer, (pair,))])
