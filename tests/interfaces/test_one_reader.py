"""Every file is read in one place, ``mathnavi.interfaces.reading``, and nowhere else."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import mathnavi
from tests.one_name import FOLDERS

ROOT = Path(mathnavi.__file__).parent
READING = "interfaces/reading/"
# Where a module stands that reads, and what it reads: no file of a user's, or not as a file.
ALLOWED = {
    ("sim/records/store.py", "sqlite3.connect"),  # checks header, schema, columns and every row
    ("interfaces/compiled.py", "ZipFile"),  # what numba compiled for this user
    ("interfaces/compiled.py", "file.read_bytes"),
    ("sim/sweep/serve.py", "pickle.loads"),  # what its own parent sends
    ("sim/plugin/index.py", "Path(_file(module)).read_text"),  # a source of an installed package, as Python reads it
    ("renders/worker.py", "json.load"),  # likewise
    ("renders/snapshots.py", "pickle.load"),
    ("renders/export/contents.py", "Image.open"),  # a picture that a scene has made
    ("renders/scene/ground.py", "Image.open"),  # likewise
    ("commands/interruption.py", "open"),  # a pipe of its own
    ("models/unicycle/entity.py", "mjcf.from_path"),  # parts of the package
    ("models/missile/entity.py", "mjcf.from_path"),
    ("models/aerial/entity.py", "mjcf.from_path"),
    ("models/terrain/raster_file.py", "rasterio.open"),  # GDAL opens files itself: one format, size and places checked
    ("models/terrain/netcdf.py", "rasterio.open"),  # variables of a file that it has opened
    ("studies/flight/faithful.py", "rasterio.open"),  # what it has written
    ("models/terrain/packed_files.py", "zipfile.ZipFile"),  # what it expands to is counted
    ("models/terrain/packed_files.py", "archive.open"),
    ("models/terrain/packed_files.py", "gzip.open"),
    ("commands/search.py", "Store.open"),  # the store, no file
    ("commands/study.py", "Store.open"),
    ("commands/sweep.py", "Store.open"),
    ("scripting/runs.py", "Store.open"),
    ("studies/published/solving.py", "json.loads"),  # what its own child sends
    ("studies/introduction/cost_measurement.py", "Store.open"),
    ("studies/introduction/cost_measurement.py", "_STATUS.read_text"),  # what the kernel says of this process
}
READERS = {
    *("load", "loads", "loadtxt", "genfromtxt", "fromfile", "memmap", "open_memmap", "read_text", "read_bytes"),
    *("from_file", "from_path", "from_xml_path", "parse", "imread", "open", "connect", "reader", "DictReader"),
    *("ZipFile", "NpzFile", "TarFile"),
}
MODULES = {"json", "np", "numpy", "pickle", "mjcf", "mujoco", "MjSpec", "csv", "sqlite3", "Image", "ElementTree"}
OF_MODULES = {"load", "loads", "parse", "connect", "reader"}  # names that others have for other things
METHODS = {"read_text", "read_bytes"}  # of a path; by these names alone they are functions of the one place
CALLED = re.compile(rf"\b(?:{'|'.join(READERS)})\(")  # most sources call nothing of that name, and are not parsed


def calls(source: str) -> Iterator[tuple[str, ast.Call]]:
    """Calls that may read a file, by their dotted names."""
    for node in ast.walk(ast.parse(source)) if CALLED.search(source) else ():
        if isinstance(node, ast.Call) and _last_name(node.func) in READERS:
            name = ast.unparse(node.func)
            owner, _, last = name.rpartition(".")
            known = owner.rpartition(".")[2] in MODULES or last not in OF_MODULES
            if known and not (last == "open" and _writes(node, owner)) and (owner or last not in METHODS):
                yield name, node


def _last_name(function: ast.expr) -> str:
    """What stands behind the last dot of what is called; "" for what has no name."""
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _writes(call: ast.Call, owner: str) -> bool:
    """True for an ``open`` that does not read: one in mode w or x, one of the operating system, and a browser's."""
    given = [*call.args[0 if owner else 1 :], *(each.value for each in call.keywords if each.arg == "mode")]
    mode = next((each.value for each in given if isinstance(each, ast.Constant) and isinstance(each.value, str)), "r")
    return owner in ("os", "webbrowser") or mode[:1] in "wxa"


def test_files_are_read_in_one_place() -> None:
    found = {
        (str(path.relative_to(ROOT)), name)
        for folder in (*FOLDERS, "commands", "scripting")
        for path in (ROOT / folder).rglob("*.py")
        if not str(path.relative_to(ROOT)).startswith(READING)
        for name, _ in calls(path.read_text(encoding="utf-8"))
    }
    assert found - ALLOWED == set(), "read it with mathnavi.interfaces.reading"
    assert ALLOWED - found == set(), "nothing reads so any more"


def test_a_reader_is_recognised() -> None:
    source = """
json.loads(text); json.load(file); np.load(path); open(path); path.open(); open(path, mode="rb"); path.read_text()
np.loadtxt(path); csv.reader(file); mujoco.MjSpec.from_file(path); pickle.load(file); Image.open(p); sqlite3.connect(p)
open(path, "w"); path.open("wb"); os.open(path, flags); plugin.load(); json.dumps(tree)
"""
    assert len(list(calls(source))) == 13
