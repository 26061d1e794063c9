"""Formats of logs: the plug-in that reads a file, chosen by its name or by what the file begins with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.fields import configured
from mathnavi.sim.logs.recorded_log import RecordedLog
from mathnavi.sim.plugin.registry import PluginSpec, load, loadable, names, of_stranger
from mathnavi.sim.records.run_folder import CONFIG

KIND = "logs"  # of plug-ins


def format_of(path: Path) -> Any:
    """Return the plug-in of the format of a file, the first by name that accepts it.

    Raises LogError for a file that none of them accepts, FileNotFoundError if it does not exist.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist")
    for plugin in loadable(KIND).values():
        with of_stranger(plugin, f"logs: {plugin.__name__}.accepts({str(path)!r})"):
            if plugin.accepts(path):
                return plugin
    if path.is_dir() and (path / CONFIG).is_file():
        raise LogError(f"{path} is the folder of a run; allowed: a log, from which such a folder is imported")
    raise LogError(f"{path} is of no format that is known; allowed with format=NAME: {', '.join(names(KIND))}")


def read(path: Path, spec: PluginSpec) -> RecordedLog:
    """Read the log in a file or a folder by a plug-in; LogError, FileNotFoundError, and FieldError of its package."""
    with of_stranger(spec.plugin, f"logs: {spec.name}.read({str(path)!r})"):
        log = spec.plugin.read(path, spec.config)
    if not isinstance(log, RecordedLog):
        raise LogError(f"{path}: {spec.name}.read() returned {type(log).__name__}; allowed: a RecordedLog")
    return log


def read_log(path: str | Path, format: str | None = None, **fields: Any) -> RecordedLog:
    """Read a log as it was recorded: its channels with their own stamps, nothing sorted, merged or silently left out.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        format: name of an installed format, "package.module:Class" of your own; None for the one that the file
            has by its name or its first bytes. ``mathnavi list logs`` names them.
        **fields: fields of the format's configuration, as ``time_column=0``.

    Returns:
        The channels, the clock and what the file says of the vehicle. ``sensor_log`` makes of it what estimators take.

    Raises:
        LogError: for a file that no format accepts, or that is not what its format says, with the place in it.
        FieldError: for a field that the format does not have, and for a package that is not installed.
        PluginError: for an unknown format.
        FileNotFoundError: if there is no file.
    """
    plugin = format_of(Path(path)) if format is None else load(KIND, format)
    return read(Path(path), PluginSpec(plugin, configured(plugin.Config(), fields)))
