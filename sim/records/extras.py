"""Optional packages, which are installed only with an extra of mathnavi."""

from __future__ import annotations

import importlib
from typing import Any

from mathnavi.interfaces.errors import FieldError

EXTRAS = {"pyarrow": "parquet"}  # by package


def extra(module: str, name: str) -> Any:
    """Import a module of one of the packages; FieldError for the field ``name`` if the package is missing."""
    package = module.partition(".")[0]
    try:
        importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        advice = f"pip install 'mathnavi[{EXTRAS[package]}]'"
        raise FieldError(
            f"{name} needs the package {package}, which is not installed; allowed after {advice}"
        ) from None
    return importlib.import_module(module)
