"""``mathnavi estimate ESTIMATOR FILE --mission``: an estimator over a log, a text file with a table, or over the
folder of a run that was imported from one.

It is ``mathnavi.estimate`` over ``SensorLog.from_csv`` or over the readings of the folder: prints the same, and writes
the estimates; those of a folder as the folder of a run, with its figures against the reference.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console

from mathnavi.commands.advised_flags import as_flags
from mathnavi.commands.arguments import FlagGroup, parse, with_flag
from mathnavi.commands.deadline import WallDeadline
from mathnavi.commands.errors import BadInputError, bad_input, bad_plugin, print_note, worded
from mathnavi.commands.output import output_folder, run_folder
from mathnavi.commands.replacing import install_run
from mathnavi.commands.summary import summary_table
from mathnavi.estimators.stagewise.recorded_smoother import SmootherConfig, Smoothing
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.field_table import TOGETHER, ValueName
from mathnavi.interfaces.fields import instance, plain
from mathnavi.interfaces.joint_states import QuaternionOrder
from mathnavi.interfaces.reading.table_format import TableFormat, names_in
from mathnavi.interfaces.writing import write_together
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES
from mathnavi.models.unicycle.beacons import BeaconMission
from mathnavi.sim.logs.imported import sensor_log_of, with_estimates
from mathnavi.sim.plugin.named_object import named_object
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.records.files import npz_bytes
from mathnavi.sim.records.run_folder import read_record, write_run_files
from mathnavi.sim.records.sensor_log import EstimateHistory, SensorLog, estimate

ARRAYS, TABLE = "estimates.npz", "estimates.csv"
SMOOTHER = "smoother"  # of the estimator that has written the folder


@configuration
class EstimateLogOptions:
    """Flags of the command for a log."""

    mission: Annotated[str, ValueName("FILE.py:NAME|MODULE:NAME")]
    """description of the vehicle and its sensors: an object, or a function that returns one, of a Python file,
    FILE.py:NAME, or of a module, package.module:NAME; it runs with your rights"""
    readings: Annotated[tuple[str, ...], TOGETHER, ValueName("SENSOR=COLUMNS...")] = ()
    """columns of each sensor by its name, with commas between them; of a folder its readings have their names"""
    inputs: Annotated[str, ValueName("COLUMNS")] = ""
    """columns of the input, with commas between them; zero if not given"""
    time: str = "t"
    """column of the times"""
    time_unit: str | None = None
    """unit of the times, s, ms, us, ns, or iso for dates; that in the column's name, else s, if not given"""
    units: Annotated[tuple[str, ...], TOGETHER, ValueName("COLUMN=UNIT...")] = ()
    """units of columns, as deg or mm; those in brackets in their names, else SI units, if not given"""
    quaternions: QuaternionOrder = "wxyz"
    """order of the quaternions in the readings, with the scalar first or last"""
    trust_units: bool = False
    """whether to use readings unchanged that fit the mission only in another unit or with another sign"""
    out: Path | None = None
    """folder of the estimates; FILE-ESTIMATOR next to FILE if not given"""
    wall_deadline: WallDeadline | None = None
    """limit of wall-clock time [s], after which the command is ended; none if not given"""


def estimate_log(name: str, path: Path, words: Sequence[str]) -> int:
    """Run the estimator called ``name`` over the log in a file or a folder, and return the exit code."""
    if not path.exists():
        raise BadInputError(f"{path} does not exist; allowed: a log in a text file, or the folder of a run")
    plugin, default = _estimator(name, path)
    groups = (
        FlagGroup(EstimateLogOptions),
        FlagGroup(TableFormat, default=TableFormat()),
        FlagGroup(type(default), "estimator", default, f"Fields of estimator {name}."),
    )
    prog = f"mathnavi estimate {name} FILE"
    options, form, fields = parse(words, prog, (plugin.__doc__ or "").strip().partition("\n")[0], *groups)
    is_folder = path.is_dir()
    if not (is_folder or options.readings):
        raise BadInputError("--readings is missing; allowed: SENSOR=COLUMNS...")
    if is_folder and options.readings:
        raise BadInputError(f"--readings with {path}; allowed: of a file, for the readings of a folder have names")
    out = options.out or beside(path, name)
    files = [out / ARRAYS, out / TABLE]
    known = [flag for group in groups for flag in group.section.flags]
    with bad_input():
        for file in files:
            check_spares(file, [path], "--out")
        check_spares(out, [path], "--out")
    try:
        mission = named_object(options.mission)
    except PluginError as error:
        raise BadInputError(f"--mission = {error}") from error
    errors = Console(stderr=True, markup=False, emoji=False)
    with run_folder(out) if is_folder else output_folder(out) as claim:
        try:
            log = sensor_log_of(path) if is_folder else _log(path, options, form)
            for note in (*log.notes, *beacon_columns(log, mission)):
                print_note(errors, f"{path}: {note}")
            found = estimate(PluginSpec(plugin, fields), mission, log, trust_units=options.trust_units)
        except (ValueError, OSError) as error:
            raise BadInputError(as_flags(with_flag(worded(error), known))) from error
        if claim is None:
            replaced = any(file.exists() for file in files)
            write_together(dict(zip(files, _contents(found, log), strict=True)))
            if replaced:
                print_note(errors, f"replaced the estimates in {out}")
        else:
            record = {"name": name, "fields": plain(fields), "mission": options.mission}
            made = with_estimates(path, found, record, mission)
            write_run_files(claim.new, made.config, made.summary, made.recording)
            install_run(claim, out, errors)
    print(found)
    if claim is not None:
        Console(markup=False, emoji=False, highlight=False).print(summary_table(made.summary, ()))
    print(f"{'estimates' if claim is None else 'run     '}  {out}")
    return 0 if found.ok.any() else 1


def beside(path: Path, name: str) -> Path:
    """Return the folder of the estimates of the estimator ``name``, next to a log or the folder of a run."""
    place = path if path.name not in ("", "..") else path.resolve()
    return place.with_name(f"{place.name if place.is_dir() else place.stem}-{name.replace(':', '.')}")


def beacon_columns(log: SensorLog, mission: Any) -> list[str]:
    """Return, for each sensor of beacons, which column of the log is which of the beacons that messages number."""
    return [
        f"{name}: {', '.join(f'beacon {i} is {column!r}' for i, column in enumerate(columns))}"
        for name, columns in log.columns.items()
        if name in (RANGES, DIFFERENCES) or (name == BEARINGS and isinstance(mission, BeaconMission))
    ]


def _estimator(name: str, path: Path) -> tuple[Any, Any]:
    """The plug-in with a name and its configuration; the smoother that of the estimator in the folder."""
    if name != SMOOTHER:
        with bad_plugin():
            plugin = load("estimators", name)
        return plugin, plugin.Config()
    recorded = read_record(path)[0].get("estimator") if path.is_dir() else None
    if recorded is None:
        raise BadInputError(f"{SMOOTHER} of {path}; allowed: of the folder that `mathnavi estimate` has written")
    with bad_plugin():
        filter_ = load("estimators", recorded["name"])
    with bad_input():
        smoothing = Smoothing(filter_, instance(filter_.Config, recorded["fields"], "$.estimator.fields"))
    return smoothing, SmootherConfig()


def _log(path: Path, options: EstimateLogOptions, form: TableFormat) -> SensorLog:
    readings = {sensor: names_in(columns) for sensor, columns in pairs("--readings", options.readings).items()}
    return SensorLog.from_csv(
        path,
        time=options.time,
        readings=readings,
        inputs=names_in(options.inputs),
        time_unit=options.time_unit,
        units=pairs("--units", options.units),
        quaternions=options.quaternions,
        **{name: getattr(form, name) for name in form.__dataclass_fields__},
    )


def pairs(flag: str, words: Sequence[str]) -> dict[str, str]:
    """Return the values of words NAME=VALUE by their names."""
    pairs: dict[str, str] = {}
    for word in words:
        name, equals, value = word.rpartition("=") if "units" in flag else word.partition("=")
        if not (name and equals and value):
            raise BadInputError(f"{flag} = {word}; allowed: NAME=VALUE")
        if name in pairs:
            raise BadInputError(f"{flag} = {word}: {name} is given twice; allowed: once")
        pairs[name] = value
    return pairs


def _contents(found: EstimateHistory, log: SensorLog) -> tuple[bytes, bytes]:
    """Return the content of the arrays' file and that of the table."""
    arrays: dict[str, Any] = {
        "estimate.t": found.t,
        "estimate.x": found.x,
        "estimate.covariance": found.covariance,
        "estimate.status": np.array([status.name for status in found.status]),
        "start": np.array(f"{log.start:f}"),
        **{f"estimate.{name}": values for name, values in found.extra.items()},
    }
    return npz_bytes(arrays), _table(found).encode()


def _table(found: EstimateHistory) -> str:
    names = found.names or tuple(f"x_{k + 1}" for k in range(found.x.shape[1]))
    further = {
        name: found.extra[figure][:, k].tolist()
        for figure, of_figure in found.figures.items()
        if figure in found.extra and found.extra[figure].shape[1:] == (len(of_figure),)
        for k, name in enumerate(of_figure)
    }
    columns: Mapping[str, Any] = {
        "t [s]": found.t.tolist(),
        **{name: found.x[:, k].tolist() for k, name in enumerate(names)},
        **{f"deviation of {name}": found.deviation[:, k].tolist() for k, name in enumerate(names)},
        **further,
        "status": [status.name for status in found.status],
    }
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(columns)
    rows.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()
