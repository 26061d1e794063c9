"""Compiled kernels are kept by the sources that they depend on: shared by equal ones, and never used for others."""

from __future__ import annotations

import errno
import importlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import mathnavi
from mathnavi.interfaces import compiled
from mathnavi.interfaces.compiled import KeptCompilation, any_missing
from tests.one_name import FOLDERS

ROOT = Path(mathnavi.__file__).parent
CONSTANTS = "FACTOR = 2.0\n"
CALLEE = """
from typing import NamedTuple
from mathnavi.interfaces.compiled import njit
from kernels_of_a_test.constants import (
    FACTOR,
)

class Pair(NamedTuple):
    a: float
    b: float

SIGNS = (1.0, -1.0)

@njit(cache=True)
def inner(x):
    return FACTOR * x * SIGNS[0]
"""
CALLER = """
from mathnavi.interfaces.compiled import njit
from kernels_of_a_test import callee

inner = callee.inner

@njit(cache=True)
def outer(pair):
    return inner(pair.a) - pair.b
"""
INNER = CALLEE.replace("import njit", "import inner_njit").replace("@njit(cache=True)", "@inner_njit")
FIELDS = "a: float\n    b: float", "b: float\n    a: float"
PACKAGE = "kernels_of_a_test"
LATER = 2.0  # [s] after which two processes compile: both have imported numba by then


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of the kernels."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kernels"))
    yield tmp_path / "kernels"
    forget_modules()


def forget_modules() -> None:
    for name in [name for name in sys.modules if name.startswith(PACKAGE)]:
        del sys.modules[name]
    compiled._source.cache_clear()
    compiled._digest.cache_clear()


def written(
    folder: Path, callee: str = CALLEE, caller: str = CALLER, constants: str = CONSTANTS
) -> tuple[ModuleType, ModuleType]:
    """Callee and caller, written to a folder and imported from it, as by a new process from another checkout."""
    forget_modules()
    sys.modules[PACKAGE] = ModuleType(PACKAGE)
    modules = []
    folder.mkdir(exist_ok=True)
    for name, source in {"constants": constants, "callee": callee, "caller": caller}.items():
        file = folder / f"{name}.py"
        file.write_text(source, encoding="utf-8")
        os.utime(file, (0.0, 0.0))  # before 0.68, numba takes a file of another age for another one
        module = ModuleType(f"{PACKAGE}.{name}")
        module.__file__ = str(file)
        sys.modules[module.__name__] = module
        setattr(sys.modules[PACKAGE], name, module)
        exec(compile(source, str(file), "exec"), module.__dict__)
        modules.append(module)
    return modules[1], modules[2]


def called(modules: tuple[ModuleType, ModuleType]) -> float:
    callee, caller = modules
    return float(caller.outer(callee.Pair(a=3.0, b=1.0)))


def hits(modules: tuple[ModuleType, ModuleType]) -> int:
    return sum(modules[1].outer.stats.cache_hits.values())


def test_another_checkout_with_the_same_sources_compiles_nothing(tmp_path: Path) -> None:
    assert called(written(tmp_path / "here")) == 5.0
    there = written(tmp_path / "there")
    assert called(there) == 5.0
    assert hits(there) == 1


@pytest.mark.parametrize(
    ("changed", "result"),
    [
        ({"callee": CALLEE.replace("FACTOR *", "FACTOR * FACTOR *")}, 11.0),
        ({"callee": CALLEE.replace("(1.0, -1.0)", "(-1.0, 1.0)")}, -7.0),
        ({"callee": CALLEE.replace(*FIELDS)}, 5.0),
        ({"callee": INNER.replace("FACTOR *", "FACTOR * FACTOR *")}, 11.0),
        ({"constants": "FACTOR = 3.0\n"}, 8.0),
        ({"caller": CALLER.replace("- pair.b", "+ pair.b")}, 7.0),
    ],
)
def test_a_change_of_a_source_compiles_its_callers_again(
    tmp_path: Path, changed: dict[str, str], result: float
) -> None:
    """In other modules too: what is called, a constant, the order of a named tuple's fields."""
    called(written(tmp_path))
    modules = written(tmp_path, **changed)
    assert called(modules) == result
    assert hits(modules) == 0


def test_a_named_tuple_with_other_fields_is_another_type(tmp_path: Path) -> None:
    """Also where the kernel's module does not import that of the tuple."""
    caller = "from mathnavi.interfaces.compiled import njit\n@njit(cache=True)\ndef outer(x):\n    return x.a - x.b\n"
    assert called(written(tmp_path, caller=caller)) == 2.0
    assert called(written(tmp_path, CALLEE.replace(*FIELDS), caller)) == 2.0


@pytest.mark.parametrize("package", [numba, llvmlite, np])
def test_another_version_of_the_compiler_compiles_again(
    package: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    called(written(tmp_path))
    monkeypatch.setattr(package, "__version__", "0.0.1")
    modules = written(tmp_path)
    assert called(modules) == 5.0
    assert hits(modules) == 0


OPTIONS = """BOUNDSCHECK=1 CPU_FEATURES= CPU_NAME=generic DEBUGINFO=1 DISABLE_INTEL_SVML=1 ENABLE_AVX=0
EXTEND_VARIABLE_LIFETIMES=1 LLVM_REFPRUNE_PASS=0 LOOP_VECTORIZE=0 OPT=0 SLP_VECTORIZE=1"""


@pytest.mark.parametrize("option", OPTIONS.split())
def test_what_an_option_of_numba_makes_is_not_used_without_it(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would be slower, or other machine code, in every later process."""
    kernel = written(tmp_path)[1].outer
    before = kernel.compile.file(())
    monkeypatch.setenv(*f"NUMBA_{option}".split("="))
    numba.config.reload_config()
    try:
        assert kernel.compile.file(()) != before
    finally:
        monkeypatch.undo()
        numba.config.reload_config()


def test_another_processor_compiles_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = written(tmp_path)[1].outer
    assert any_missing([(kernel, ())])
    kernel.compile.file(()).parent.mkdir(exist_ok=True)
    kernel.compile.file(()).touch()
    assert not any_missing([(kernel, ())])
    monkeypatch.setattr(compiled, "_processor", lambda: ("another", ""))
    assert any_missing([(kernel, ())])


def cut_short(files: list[Path]) -> None:
    for file in files:
        file.write_bytes(file.read_bytes()[:100])


def emptied(files: list[Path]) -> None:
    for file in files:
        file.write_bytes(b"")


def with_random_bytes(files: list[Path]) -> None:
    for file in files:
        file.write_bytes(os.urandom(file.stat().st_size))


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


@pytest.mark.parametrize("damage", [cut_short, emptied, with_random_bytes, with_one_bit_changed, exchanged])
def test_a_damaged_file_is_compiled_again_and_replaced(
    damage: Callable[[list[Path]], None], tmp_path: Path, folder: Path
) -> None:
    called(written(tmp_path))
    files = sorted(folder.iterdir())
    assert len(files) == 2
    damage(files)
    for expected in (0, 1):
        modules = written(tmp_path)
        assert called(modules) == 5.0
        assert hits(modules) == expected


def folders_in_place_of_files(folder: Path, patch: pytest.MonkeyPatch) -> None:
    for file in folder.iterdir():
        file.unlink()
        file.mkdir()


def unreadable_files(folder: Path, patch: pytest.MonkeyPatch) -> None:
    for file in folder.iterdir():
        file.chmod(0)


def read_only_folder(folder: Path, patch: pytest.MonkeyPatch) -> None:
    for file in folder.iterdir():
        file.unlink()
    folder.chmod(0o555)


def no_folder(folder: Path, patch: pytest.MonkeyPatch) -> None:
    """A file where the folder should be; the same error as in a home that cannot be written to."""
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    folder.write_bytes(b"")


def no_temporary_folder(folder: Path, patch: pytest.MonkeyPatch) -> None:
    def full(*arguments: Any, **options: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    patch.setattr(tempfile, "mkdtemp", full)


def nothing_can_be_kept(folder: Path, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(compiled, "kernel_folder", lambda: None)


@pytest.mark.parametrize(
    "hinder",
    [
        folders_in_place_of_files,
        unreadable_files,
        read_only_folder,
        no_folder,
        nothing_can_be_kept,
        no_temporary_folder,
    ],
)
def test_what_cannot_be_read_or_written_is_compiled(
    hinder: Callable[[Path, pytest.MonkeyPatch], None], tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    called(written(tmp_path))
    hinder(folder, monkeypatch)
    try:
        assert called(written(tmp_path)) == 5.0
    finally:
        folder.chmod(0o755)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_a_full_disk_is_no_obstacle(tmp_path: Path, folder: Path) -> None:
    """Every write fails, those of numba too, for one combination of types and the next."""
    import resource

    callee, caller = written(tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        results = [caller.outer(callee.Pair(a=a, b=1.0)) for a in (3.0, 3)]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert results == [5.0, 5.0]
    assert not folder.exists() or not list(folder.iterdir())


def test_processes_that_compile_at_once_leave_whole_files(tmp_path: Path, folder: Path) -> None:
    """One kernel with the same types, and with types of each process's own."""
    called(written(tmp_path))
    for file in folder.iterdir():
        file.unlink()
    begin = time.time() + LATER
    script = f"""if True:
        import sys, time
        import numba
        from pathlib import Path
        from tests.interfaces.test_compiled import written
        numba.config.CACHE_DIR = {str(folder)!r}
        own = {{"0": 3, "1": 3.0 + 0.0j}}[sys.argv[1]]
        callee, caller = written(Path({str(tmp_path)!r}, sys.argv[1]))
        time.sleep(max(0.0, {begin} - time.time()))
        assert [caller.outer(callee.Pair(a=a, b=1.0)) for a in (3.0, own)] == [5.0, 5.0]
    """
    running = [subprocess.Popen([sys.executable, "-c", script, number]) for number in "01"]
    assert [process.wait() for process in running] == [0, 0]
    callee, caller = written(tmp_path)
    for a in (3.0, 3, 3.0 + 0.0j):
        assert caller.outer(callee.Pair(a=a, b=1.0)) == 5.0
    assert hits((callee, caller)) == 3
    assert {file.suffix for file in folder.iterdir()} == {".kernel"}


def test_files_unused_for_90_days_are_removed(tmp_path: Path, folder: Path) -> None:
    called(written(tmp_path))
    old, recent, used = folder / "old.kernel", folder / "recent.kernel", next(folder.glob("*caller*"))
    for file, days in ((old, 91), (recent, 89), (used, 89)):
        file.touch()
        os.utime(file, (time.time() - days * 86400.0,) * 2)
    modules = written(tmp_path)
    called(modules)  # which is noted
    modules[1].outer(modules[0].Pair(a=3, b=1.0))  # which is kept, and so the folder is looked through
    assert not old.exists()
    assert recent.exists()
    assert time.time() - used.stat().st_mtime < 86400.0


def test_without_a_source_a_kernel_is_compiled_in_every_process(folder: Path) -> None:
    module = {"__name__": f"{PACKAGE}.typed"}
    exec("from mathnavi.interfaces.compiled import njit\n@njit(cache=True)\ndef f(x):\n    return x + 1\n", module)
    kernel: Any = module["f"]
    assert kernel(1) == 2
    assert not folder.exists()


def test_other_peoples_kernels_are_cached_where_numba_caches_them(tmp_path: Path) -> None:
    before = numba.config.CACHE_DIR
    called(written(tmp_path))
    assert before == numba.config.CACHE_DIR


def test_every_kernel_of_ours_is_kept() -> None:
    files = [file for name in FOLDERS for file in (ROOT / name).rglob("*.py") if "njit(cache=True" in file.read_text()]
    kernels = 0
    for file in files:
        module = importlib.import_module(".".join(("mathnavi", *file.relative_to(ROOT).with_suffix("").parts)))
        for kernel in vars(module).values():
            if isinstance(kernel, Dispatcher) and kernel.__module__ == module.__name__:
                kernels += isinstance(kernel.compile, KeptCompilation)
    assert kernels > 150


def test_an_inner_kernel_is_kept_with_its_callers_only(folder: Path, tmp_path: Path) -> None:
    assert called(written(tmp_path / "one", INNER)) == 5.0
    assert [file.name.split("-")[0] for file in folder.iterdir()] == [f"{PACKAGE}.caller.outer"]
    again = written(tmp_path / "two", INNER)
    assert called(again) == 5.0
    assert hits(again) == 1


@pytest.mark.parametrize("compiled_before", [True, False])
def test_python_cannot_call_an_inner_kernel(compiled_before: bool, tmp_path: Path) -> None:
    modules = written(tmp_path, INNER)
    if compiled_before:
        called(modules)
    with pytest.raises(TypeError, match="called from Python; allowed: a call by a kernel"):
        modules[0].inner(1.0)


def test_kernels_are_missing_until_they_are_compiled(tmp_path: Path) -> None:
    callee, caller = written(tmp_path, INNER)
    pair = numba.typeof(callee.Pair(a=3.0, b=1.0))
    assert any_missing([(caller.outer, (pair,))])
    caller.outer.compile((pair,))
    assert not any_missing([(caller.outer, (pair,))])
