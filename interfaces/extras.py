"""Packages that only some commands need, each installed with an extra and imported where it is used."""

from __future__ import annotations

import importlib
from typing import Any

from mathnavi.interfaces.errors import FieldError

EXTRAS = {  # by the name under which a package is imported: its name in the index, and the extra
    "pyarrow": ("pyarrow", "parquet"),
    "rerun": ("rerun-sdk", "rerun"),
    "mcap": ("mcap", "mcap"),
    "mcap_protobuf": ("mcap-protobuf-support", "mcap"),
    "rosbags": ("rosbags", "logs"),
    "pyulog": ("pyulog", "logs"),
    "foxglove_schemas_protobuf": ("foxglove-schemas-protobuf", "mcap"),
}


def extra(module: str, name: str) -> Any:
    """Import a module of one of the packages; FieldError for the field ``name`` if the package is missing."""
    imported = module.partition(".")[0]
    try:
        importlib.import_module(imported)
    except ModuleNotFoundError as error:
        if error.name != imported:
            raise
        package, installed_by = EXTRAS[imported]
        advice = f"pip install 'mathnavi[{installed_by}]'"
        raise FieldError(
            f"{name} needs the package {package}, which is not installed; allowed after {advice}"
        ) from None
    return importlib.import_module(module)
