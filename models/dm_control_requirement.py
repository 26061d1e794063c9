"""dm-control, which pip cannot install with what it requires on Python 3.13 and later: labmaze has no wheel there."""

from __future__ import annotations

from importlib.util import find_spec

DISTRIBUTION = "dm-control"


class MissingPackageError(ImportError):
    """A package that mathnavi needs is not installed; the message has the command that installs it."""


def require_dm_control() -> None:
    """Raise MissingPackageError if dm-control is not installed."""
    if find_spec("dm_control") is not None:
        return
    from importlib.metadata import PackageNotFoundError, requires  # takes as long to import as the command line

    try:
        listed = requires("mathnavi") or []
    except PackageNotFoundError:  # mathnavi runs from its sources
        listed = []
    wanted = next((each.partition(";")[0].strip() for each in listed if each.startswith(DISTRIBUTION)), DISTRIBUTION)
    installer = "python -m pip" if find_spec("pip") is not None else "uv pip"
    raise MissingPackageError(
        f"{DISTRIBUTION} is not installed; type: {installer} install --no-deps '{wanted}' "
        "(with its requirements it cannot be installed on Python 3.13 and later; mathnavi brings those that it uses)"
    )
