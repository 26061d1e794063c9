"""Numba's compiler, with a folder that caches the compiled kernels.

Compiled code is kept in the folder ``kernels`` of the user's cache (``cache_folder``; numba's own variable
NUMBA_CACHE_DIR names another), in a file for each kernel and combination of argument types. The name of the file has a
hash of everything that its machine code depends on:

- the sources: that of the kernel's module, and those that this module imports at its top level from mathnavi or from
  its own package, directly or not. So a change of a kernel compiles those of other modules that call it again, which
  numba's own cache misses, and checkouts with the same sources share one copy (before numba 0.68, whose cache looks at
  the age of a source, it is the copy of the checkout that compiled last);
- the versions of Python, numba, llvmlite and NumPy;
- the processor, and numba's options for machine code, such as NUMBA_OPT.

A file holds what numba's cache wrote, behind a checksum, because numba would run damaged machine code. It is written
whole or not at all. To load a kernel, or to keep it, numba's cache is given a temporary folder that only this process
uses, so processes that compile at the same time do not meet. Without a folder to write to, every process compiles for
itself.

An *inner* kernel, ``inner_njit``, is called only by other kernels. It has no code that lets Python call it, and is kept
as a part of those that call it.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache as cached
from functools import partial
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any
from zipfile import ZipFile

import llvmlite.binding
import numba
import numpy as np
from numba.core.compiler_lock import global_compiler_lock

from mathnavi.interfaces.cache_folder import cache_folder

_UNUSED = 90 * 86400.0  # [s] since its last use, after which a file is removed
_REMARKED = 86400.0  # [s] between two notes that a file is in use
_IMPORT = re.compile(r"^from ([\w.]+) import ([\w, ]+|\([^)]*\))|^import ([\w.]+)", re.MULTILINE)
_OPTIONS = (
    "BOUNDSCHECK",
    "CPU_FEATURES",
    "CPU_NAME",
    "DEBUGINFO_DEFAULT",
    "DEBUG_JIT",
    "DEBUG_NRT",
    "DISABLE_INTEL_SVML",
    "ENABLE_AVX",
    "ENABLE_PROFILING",
    "EXTEND_VARIABLE_LIFETIMES",
    "JIT_COVERAGE",
    "LLVM_REFPRUNE_FLAGS",
    "LLVM_REFPRUNE_PASS",
    "LOOP_VECTORIZE",
    "NRT_STATS",
    "OPT",
    "SLP_VECTORIZE",
    "USING_SVML",  # a library that calls in machine code need
)
"""numba's options that change machine code"""
_CONFIGURING = Lock()
_CONFIG: Any = numba.config
_COMPILER_LOCK: Any = global_compiler_lock

if TYPE_CHECKING:
    from numba import njit as njit

    inner_njit = njit
else:

    def njit(function=None, *, cache=False, **options):
        """Decorate with ``numba.njit``; with ``cache`` the compiled code is kept."""
        if function is None:
            return lambda function: njit(function, cache=cache, **options)
        kernel = numba.njit(**{"no_cfunc_wrapper": True, **options})(function)  # none is called as a pointer from C
        sources = _digest(function.__module__) if cache else ""
        if sources and hasattr(kernel, "compile"):  # it is a plain function if NUMBA_DISABLE_JIT is set
            kernel.compile = KeptCompilation(kernel, sources)  # numba calls it for arguments of new types
        return kernel

    def inner_njit(function=None, **options):
        """Decorate an inner kernel; only kernels can call it."""
        if function is None:
            return lambda function: inner_njit(function, **options)
        kernel = njit(function, no_cpython_wrapper=True, **options)
        if hasattr(kernel, "compile"):
            kernel.compile = partial(_compile_inner, kernel.compile)
            # Numba would look no further for code that Python may call.
            kernel.add_overload = lambda found: kernel.overloads.update({tuple(found.signature.args): found})
        return kernel


def _compile_inner(compile: Callable[[Any], Any], arguments: Any) -> Any:
    if not _COMPILER_LOCK.is_locked():  # no other kernel is being compiled: the call comes from Python
        raise TypeError("an inner kernel was called from Python; allowed: a call by a kernel")
    return compile(arguments)


class KeptCompilation:
    """Compilation of one kernel, which loads from a file what was compiled before."""

    def __init__(self, kernel: Any, sources: str) -> None:
        self._kernel, self._compile, self._sources = kernel, kernel.compile, sources

    def __call__(self, arguments: Any) -> Any:
        """Compile or load the code for arguments of these types, and return its entry point."""
        if isinstance(arguments, tuple) and arguments not in self._kernel.overloads and (file := self.file(arguments)):
            # Without a temporary folder or without the source, numba has no cache to use, which is a RuntimeError.
            with suppress(OSError, RuntimeError), tempfile.TemporaryDirectory(prefix="mathnavi-kernel-") as folder:
                self._compile_in(folder, arguments, file)
        with suppress(OSError):
            return self._compile(arguments)
        return self._compile(arguments)  # it was compiled above, before there was no space to keep it

    def _compile_in(self, folder: str, arguments: tuple[Any, ...], file: Path) -> None:
        with _CONFIGURING:
            before = _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES
            # This folder or none: numba would go on to folders in which a change of a callee goes unnoticed.
            _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES = folder, "UserProvidedCacheLocator"
            try:
                self._kernel.enable_caching()
            finally:
                _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES = before
        place = Path(self._kernel.stats.cache_path)
        if kept := _read(file):
            ZipFile(BytesIO(kept)).extractall(place)
        self._compile(arguments)
        if self._kernel.stats.cache_misses.get(arguments):
            _write(file, place)

    def file(self, arguments: tuple[Any, ...]) -> Path | None:
        """Return the file of the code for arguments of these types; None if nothing can be kept."""
        folder, function = kernel_folder(), self._kernel.py_func
        content = compiler(), self._sources, function.__qualname__, repr(arguments), *_named_tuples(arguments)
        digest = hashlib.sha256(repr(content).encode()).hexdigest()
        return folder and folder / f"{function.__module__}.{function.__name__}-{digest[:32]}.kernel"


def kernel_folder() -> Path | None:
    """Return the folder of all compiled kernels, which need not exist; None if nothing can be kept."""
    if named := _CONFIG.CACHE_DIR:
        return Path(named)
    folder = cache_folder()
    return folder and folder / "kernels"


def compiler() -> tuple[str, ...]:
    """Return all that machine code depends on, sources excepted: versions, processor and options of the compiler."""
    versions = numba.__version__, llvmlite.__version__, np.__version__, str(sys.implementation.cache_tag), sys.abiflags
    return *versions, *_processor(), *(repr(getattr(_CONFIG, name, None)) for name in _OPTIONS)


@cached
def _processor() -> tuple[str, str]:
    """Return name and features of this processor."""
    return llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten()


Signature = tuple[Any, tuple[Any, ...]]
"""pair of a kernel and the types of its arguments"""


def any_missing(kernels: Iterable[Signature]) -> bool:
    """Return True if kernels can be kept, and one of these is not."""
    folder = kernel_folder()
    if folder is None:
        return False
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.W_OK) and any(
        isinstance(kept := getattr(kernel, "compile", None), KeptCompilation)
        and (file := kept.file(arguments))
        and not file.exists()
        for kernel, arguments in kernels
    )


@cached
def _digest(module: str) -> str:
    """Return the hash of all sources that a kernel of a module may depend on; empty if the module has no source."""
    seen, waiting = {module}, [module]
    while waiting:
        new = {name for name in _source(waiting.pop())[1] if name.split(".")[0] in ("mathnavi", module.split(".")[0])}
        waiting += new - seen
        seen |= new
    if not _source(module)[0]:
        return ""
    return hashlib.sha256(repr([(name, _source(name)[0]) for name in sorted(seen)]).encode()).hexdigest()


@cached
def _source(module: str) -> tuple[str, frozenset[str]]:
    """Return the hash of the source of a loaded module, and the loaded modules that it imports."""
    try:
        file = Path(sys.modules[module].__file__ or "")
        content = file.read_bytes()
    except (KeyError, AttributeError, OSError):
        return "", frozenset()
    found = set()
    for package, names, whole in _IMPORT.findall(content.decode()):
        found |= {whole or package, *(f"{package}.{name}" for name in re.findall(r"\w+", names))}
    return hashlib.sha256(content).hexdigest(), frozenset(found & set(sys.modules))


def _named_tuples(types: Iterable[Any]) -> Iterator[tuple[str, ...]]:
    """Return module, name and fields of all named tuples among types; the names of the types do not contain them."""
    for each in types:
        if kind := getattr(each, "instance_class", None):
            yield kind.__module__, kind.__qualname__, *getattr(kind, "_fields", ())
        yield from _named_tuples(getattr(each, "types", ()))


def _checksum(file: Path, content: bytes) -> bytes:
    return hashlib.sha256(file.name.encode() + content).digest()


def _read(file: Path) -> bytes:
    """Return the content of a file; nothing if it does not exist, or is not what was written under that name."""
    try:
        whole = file.read_bytes()
        if time.time() - file.stat().st_mtime > _REMARKED:
            os.utime(file)
    except OSError:
        return b""
    size = hashlib.sha256().digest_size
    content = whole[size:]
    return content if whole[:size] == _checksum(file, content) else b""


def _write(file: Path, place: Path) -> None:
    """Keep the files in a folder as one file, whole or not at all; nothing happens if it cannot be written."""
    content = BytesIO()
    with ZipFile(content, "w") as archive:
        for each in sorted(place.iterdir()):
            archive.write(each, each.name)
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, partial = tempfile.mkstemp(dir=file.parent, prefix=".partial-")
        try:
            with os.fdopen(handle, "wb") as out:
                out.write(_checksum(file, content.getvalue()) + content.getvalue())
            os.replace(partial, file)
        except OSError:
            os.unlink(partial)
            raise
        _remove_unused(file.parent)


def _remove_unused(folder: Path) -> None:
    """Remove the files that have not been used for 90 days."""
    now = time.time()
    for each in os.scandir(folder):
        with suppress(OSError):
            if now - each.stat().st_mtime > _UNUSED:
                os.unlink(each)
