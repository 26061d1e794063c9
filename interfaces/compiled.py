"""Numba's compiler, with a folder that caches the compiled kernels.

Compiled code is kept in a folder of the user ($XDG_CACHE_HOME/mathnavi/kernels or ~/.cache/mathnavi/kernels; numba's
own variable NUMBA_CACHE_DIR names another) under a hash of all that it depends on: byte code and constants of the
kernel and of every kernel that it calls, types of its arguments, options, processor, versions. So checkouts and
installed wheels with the same kernels share one copy, and after a change of a kernel those of other files that call it
are compiled again, which numba's own cache misses. Without a folder to write to, every process compiles for itself.

Much of the compilation time of a kernel goes into its machine code, and into the code that lets Python call it. An
*inner* kernel, ``inner_njit``, is called only by other kernels: it has neither, and is optimised, translated and kept
as a part of those that call it.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
from numba.core.caching import _Cache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, compile_result
from numba.core.dispatcher import Dispatcher
from numba.core.types import ExternalFunction

_binding: Any = importlib.import_module("llvmlite.binding")
_runtime: Any = importlib.import_module("numba.core.runtime")
_config: Any = importlib.import_module("numba.core.config")
_serialize: Any = importlib.import_module("numba.core.serialize")
_llvmlite: Any = importlib.import_module("llvmlite")
_KEPT = 90 * 86400.0  # [s] since its last use, for which an entry is kept
_FORMAT = 3  # of a file of compiled code
_REMARKED = 86400.0  # [s] between two notes that an entry is in use

if TYPE_CHECKING:
    from numba import njit as njit

    inner_njit = njit
else:

    def njit(function=None, *, cache=False, inner=False, **options):
        """Decorate with ``numba.njit``; with ``cache`` kernels are kept by their content."""
        if function is None:
            return lambda function: njit(function, cache=cache, inner=inner, **options)
        if inner:
            options = {"no_cpython_wrapper": True, "pipeline_class": _InnerCompiler, **options}
        kernel = numba.njit(**{"no_cfunc_wrapper": True, **options})(function)  # none is called as a pointer from C
        if cache and isinstance(kernel, Dispatcher):  # it is a plain function if NUMBA_DISABLE_JIT is set
            kernel._cache = KernelCache(kernel)
        if inner and isinstance(kernel, Dispatcher):
            kernel.add_overload = lambda found: kernel.overloads.update({tuple(found.signature.args): found})
            kernel._compile_for_args = _refuse  # for any arguments from Python
        return kernel

    def inner_njit(function=None, **options):
        """Decorate an inner kernel with ``njit``; only kernels can call it."""
        return njit(function, inner=True, **options)


def _refuse(*arguments: Any, **keywords: Any) -> None:
    raise TypeError("an inner kernel was called from Python; allowed: a call by a kernel")


class _Unset:
    """Substitute for the code generator: the environment of an inner kernel is not in any machine code."""

    @staticmethod
    def set_env(name: str, environment: object) -> None:
        pass


class _InnerLibrary(JITCodeLibrary):
    """Library with the code of an inner kernel, from which the kernels that call it are compiled."""

    codegen = _Unset

    def _optimize_final_module(self) -> None:
        """Leave optimisation to the calling kernels, which are optimised together with this code."""

    def _finalize_final_module(self) -> None:
        """Stop without machine code."""
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return zero: without machine code there is no address."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0


class _InnerCompiler(Compiler):
    """Numba's compiler, which writes into the library of an inner kernel."""

    def compile_extra(self, func: Any) -> Any:
        self.state.library = _InnerLibrary(self.state.targetctx.codegen(), func.__qualname__)  # type: ignore[no-untyped-call]
        return super().compile_extra(func)  # type: ignore[no-untyped-call]


class _KeptLibrary(JITCodeLibrary):
    """Library with cached machine code, and its bitcode, which is read when a kernel that calls it is compiled.

    Bitcode takes longer to read than all else, and a kernel that Python calls does not need it.
    """

    def __init__(self, codegen: Any, kept: tuple[str, str, tuple[bytes, bytes]], symbols: frozenset[str]) -> None:
        name, _, (machine_code, bitcode) = kept
        self._read: Any = None
        self._bitcode = b""
        super().__init__(codegen, name)  # type: ignore[no-untyped-call]
        self._bitcode = bitcode
        self.enable_object_caching()  # type: ignore[no-untyped-call]
        self._set_compiled_object(machine_code)  # type: ignore[no-untyped-call]
        self._finalize_final_module()  # type: ignore[no-untyped-call]
        codegen._engine._defined_symbols |= symbols

    @property
    def _shared_module(self) -> Any:
        if self._read is None and self._bitcode:
            self._read = _binding.parse_bitcode(self._bitcode)
        return self._read

    @_shared_module.setter
    def _shared_module(self, module: Any) -> None:
        self._read = module


def _symbols(library: JITCodeLibrary) -> frozenset[str]:
    """Return the symbols that a library defines."""
    module: Any = library._get_module_for_linking()  # type: ignore[no-untyped-call]
    return frozenset(
        each.name for kind in (module.functions, module.global_variables) for each in kind if not each.is_declaration
    )


def _rebuilt(context: Any, content: tuple[frozenset[str], tuple[Any, ...]]) -> Any:
    """Rebuild the compiled code that ``save_overload`` kept, as numba's own ``CompileResult._rebuild`` does."""
    symbols, (kept, descriptor, environment, signature, object_mode, lifted, annotation, _, environments) = content
    library: Any = _KeptLibrary(context.codegen(), kept, symbols)
    found = compile_result(  # type: ignore[no-untyped-call]
        target_context=context, typing_context=context.typing_context, library=library, environment=environment,
        entry_point=context.get_executable(library, descriptor, environment), fndesc=descriptor, signature=signature,
        type_annotation=annotation, objectmode=object_mode, lifted=lifted, reload_init=[],
        referenced_envs=environments,
    )  # fmt: skip
    for each in environments:
        library.codegen.set_env(each.env_name, each)
    return found


def _checksum(file: Path, kept: bytes) -> bytes:
    return hashlib.sha256(file.name.encode() + kept).digest()


def _read(file: Path) -> bytes | None:
    """Return the content of a file; None if it does not exist, or is not what was written under that name.

    Damaged machine code would crash, or compute something else.
    """
    try:
        content = file.read_bytes()
    except OSError:
        return None
    size = hashlib.sha256().digest_size
    kept = content[size:]
    return kept if content[:size] == _checksum(file, kept) else None


def kernel_folder() -> Path:
    """Return the folder of all compiled kernels."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(_config.CACHE_DIR or Path(home) / "mathnavi" / "kernels")


class KernelCache(_Cache):
    """Cache of the compiled code of one kernel, with a file for each combination of argument types."""

    def __init__(self, kernel: Dispatcher[Any]) -> None:
        self._kernel = kernel
        self._enabled = True

    @property
    def cache_path(self) -> str:
        """Folder of all kernels."""
        return str(kernel_folder())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the compiled code for arguments of the types ``sig``; None if it is missing or damaged."""
        if not self._enabled:
            return None
        # A loaded kernel needs numba's memory management; numba's compiler takes a while to import.
        _runtime.rtsys.initialize(target_context)
        file = self.file(sig, target_context.codegen())
        if (kept := _read(file)) is None:
            return None
        with suppress(OSError):
            if time.time() - file.stat().st_mtime > _REMARKED:
                os.utime(file)
        return _rebuilt(target_context, pickle.loads(kept))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compiled code, whole or not at all; nothing happens if it cannot be written."""
        if not self._enabled or data.library.has_dynamic_globals or data.lifted or data.reload_init:
            return
        file, kept = self.file(sig, data.codegen), _serialize.dumps((_symbols(data.library), data._reduce()))
        with suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            handle, partial = tempfile.mkstemp(dir=file.parent, prefix=".partial-")
            try:
                with os.fdopen(handle, "wb") as out:
                    out.write(_checksum(file, kept) + kept)
                os.replace(partial, file)
            except OSError:
                os.unlink(partial)
                return
            _forget_unused(file.parent)

    def keeps(self, sig: Any) -> bool:
        """Return True if compiled code for arguments of the types ``sig`` is kept."""
        context: Any = self._kernel.targetctx
        return self.file(sig, context.codegen()).exists()

    def enable(self) -> None:
        """Use the cache."""
        self._enabled = True

    def disable(self) -> None:
        """Bypass the cache: compile again, and do not change it."""
        self._enabled = False

    def flush(self) -> None:
        """Remove the compiled code of this kernel, of all versions."""
        for file in kernel_folder().glob(f"{self._name}-*.nbc"):
            file.unlink(missing_ok=True)

    @property
    def _name(self) -> str:
        return f"{self._kernel.__module__}.{self._kernel.py_func.__name__}"

    def file(self, sig: Any, codegen: Any) -> Path:
        """Return the file of compiled code for arguments of the types ``sig``."""
        versions = _FORMAT, sys.implementation.cache_tag, sys.abiflags, numba.__version__, _llvmlite.__version__
        types = [repr(sig), *map(repr, _fields(sig))]
        content = versions, codegen.magic_tuple(), types, kernel_digest(self._kernel)
        return kernel_folder() / f"{self._name}-{hashlib.sha256(repr(content).encode()).hexdigest()[:32]}.nbc"


Signature = tuple[Any, tuple[Any, ...]]
"""pair of a kernel and the types of its arguments"""


def any_missing(kernels: Iterable[Signature]) -> bool:
    """Return True if kernels can be kept, and one of these is not."""
    folder = kernel_folder()
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.W_OK) and any(
        isinstance(cache := getattr(kernel, "_cache", None), KernelCache) and not cache.keeps(arguments)
        for kernel, arguments in kernels
    )


def kernel_digest(kernel: Dispatcher[Any]) -> str:
    """Return the hash of all code of mathnavi that the machine code of a kernel depends on.

    Raises:
        TypeError: the kernel uses a global that has no known content.
    """
    digest = hashlib.sha256()
    for part in _content(kernel, set()):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def _content(kernel: Dispatcher[Any], seen: set[Any]) -> Iterator[str]:
    """Return the parts of the content of a kernel and of those that it calls, each kernel once."""
    seen.add(kernel)
    function = kernel.py_func
    yield repr(
        (function.__module__, function.__qualname__, sorted(kernel.targetoptions.items()), function.__defaults__)
    )
    used = {**function.__globals__, **_cells(function)}
    for code in _codes(function.__code__):
        constants = [c for c in code.co_consts if not isinstance(c, CodeType) and c != function.__doc__]
        yield repr((code.co_code, constants, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
        for name in (*code.co_names, *code.co_freevars):
            if name in used:
                yield from _value(f"{function.__module__}.{name}", used[name], code.co_names, seen)


def _value(name: str, value: Any, names: tuple[str, ...], seen: set[Any]) -> Iterator[str]:
    """Return the content of a global of a kernel; of a module its values under ``names``, those in the kernel's code.

    Names of attributes are among them too, so that a global may be read needlessly, but none is missed.
    """
    if isinstance(value, Dispatcher):
        if value not in seen:
            yield from _content(value, seen)
    elif isinstance(value, np.ndarray):
        yield repr((name, value.dtype.str, value.shape, value.tobytes()))
    elif isinstance(value, tuple):
        for k, each in enumerate(value):
            yield from _value(f"{name}[{k}]", each, (), seen)
    elif isinstance(value, bool | int | float | str | np.generic | None):
        yield repr((name, value))
    elif isinstance(value, type):
        yield repr((name, value.__module__, value.__qualname__, getattr(value, "_fields", ())))
    elif isinstance(value, ExternalFunction):
        yield repr((name, value.symbol, value.sig))
    elif isinstance(value, ModuleType) and value.__name__.startswith("mathnavi."):
        for inside in names:
            if hasattr(value, inside):
                yield from _value(f"{value.__name__}.{inside}", getattr(value, inside), (), seen)
    elif isinstance(value, ModuleType | FunctionType | BuiltinFunctionType):
        yield repr((name, value.__name__))
    else:
        raise TypeError(f"{name} = {value!r} in a kernel; allowed: kernels, modules, classes, numbers, strings, arrays")


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Return a function's code, and that of the comprehensions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _cells(function: Any) -> dict[str, Any]:
    """Return the variables that a function takes from the enclosing one."""
    cells = function.__closure__ or ()
    return {name: cell.cell_contents for name, cell in zip(function.__code__.co_freevars, cells, strict=True)}


def _fields(types: Any) -> Iterator[tuple[str, ...]]:
    """Return the names of the fields of all named tuples among types; the names of the types do not contain them."""
    for kind in types:
        yield from filter(None, [getattr(kind, "fields", None)])
        yield from _fields(getattr(kind, "types", ()))


def _forget_unused(folder: Path) -> None:
    """Remove entries that have not been used for a season."""
    now = time.time()
    for entry in os.scandir(folder):
        with suppress(OSError):
            if now - entry.stat().st_mtime > _KEPT:
                os.unlink(entry)
