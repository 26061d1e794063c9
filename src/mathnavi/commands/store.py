"""``mathnavi store``: show what a sweep has stored, or export it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.evidence import print_evidence, verdict
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.field_table import Positional
from mathnavi.sim.records.computing_environment import difference, environment_digest
from mathnavi.sim.records.parquet import write_parquet
from mathnavi.sim.records.store import Record, Store, canonical_json
from mathnavi.sim.records.sweep_data import Sweep, grouped

USAGE = """usage: mathnavi store show FILE.db
       mathnavi store export FILE.db --out FILE.csv|FILE.jsonl|FILE.parquet"""

PLUGINS = ("controller", "estimator")  # they decide which other fields there are

File = Annotated[Path, Positional("FILE.db")]


@dataclass(frozen=True)
class StoreShowOptions:
    """Flags of ``store show``."""

    file: File
    """store of a sweep"""


@dataclass(frozen=True)
class StoreExportOptions:
    """Flags of ``store export``."""

    file: File
    """store of a sweep"""
    out: Path
    """file to write: .csv or .parquet with one row for each trial, or .jsonl with one JSON object for each trial"""


def main(argv: Sequence[str]) -> int:
    actions = {"show": _show, "export": _export}
    if argv and argv[0] in ("-h", "--help"):
        print(USAGE)
        return 0
    if not argv or argv[0] not in actions:
        raise BadInputError(f"store {' '.join(argv[:1])}: not a command; allowed: {', '.join(actions)}")
    actions[argv[0]](argv[1:])
    return 0


def _show(argv: Sequence[str]) -> None:
    (options,) = parse(argv, "mathnavi store show", "Print the content of a store.", FlagGroup(StoreShowOptions))
    with bad_input(), Store.existing(options.file) as store:
        records = store.records()
    console = Console(markup=False, emoji=False)
    if not records:
        console.print(f"{options.file}: no trials", soft_wrap=True, highlight=False)
    if other := sum(record.origin.digest != environment_digest() for record in records):
        console.print(f"{other} of {len(records)} trials from another environment", highlight=False, soft_wrap=True)
    changed = _changed_files(records)
    for kind in Counter(_kind(record, changed) for record in records):
        members = [record for record in records if _kind(record, changed) == kind]
        scenario, code, _, *files = kind
        console.print(f"{scenario}, {verdict(members)}", style="bold", highlight=False, soft_wrap=True)
        console.print(f"code {code}", style="dim", highlight=False, soft_wrap=True)
        for name, digest in zip(changed, files, strict=True):
            console.print(f"{name} with digest {digest}", style="dim", highlight=False, soft_wrap=True)
        words = difference(members[0].origin.environment) or "as here"
        console.print(f"environment {words}", style="dim", highlight=False, soft_wrap=True)
        print_evidence(console, members, _varied(members))


def _kind(record: Record, changed: Sequence[str]) -> tuple[str, ...]:
    """Return scenario, version of the code, environment, and digests of changed files by the names of the fields.

    Records that differ in any of these are reported separately.
    """
    inputs = record.parameters.get("inputs", {})
    return record.scenario, record.code, record.origin.digest, *(str(inputs.get(name, "none")) for name in changed)


def _changed_files(records: Sequence[Record]) -> list[str]:
    """Return the fields in which one name stands for files of different contents."""
    digests: dict[tuple[str, str], set[str]] = {}
    for record in records:
        for name, digest in record.parameters.get("inputs", {}).items():
            digests.setdefault((name, canonical_json(record.fields.get(name))), set()).add(digest)
    return sorted({name for (name, _), found in digests.items() if len(found) > 1})


def _export(argv: Sequence[str]) -> None:
    (options,) = parse(argv, "mathnavi store export", "Write a store as a table.", FlagGroup(StoreExportOptions))
    with bad_input(), Store.existing(options.file) as store:
        check_spares(options.out, [options.file], "--out")
        write = _writer(options, store)
        try:
            write(options.out)
        except OSError as error:
            raise BadInputError(
                f"--out = {options.out}: {error.strerror}; "
                f"allowed: a file in a folder that is there and can be written to, with room for it"
            ) from error
    print(options.out)


def _writer(options: StoreExportOptions, store: Store) -> Callable[[Path], None]:
    writers: dict[str, Callable[[Path], None]] = {
        ".csv": store.export_csv,
        ".jsonl": store.export_jsonl,
        ".parquet": lambda out: write_parquet(out, store.rows()),
    }
    if options.out.suffix not in writers:
        raise BadInputError(f"--out = {options.out}; allowed: a name that ends in {' or '.join(writers)}")
    return writers[options.out.suffix]


def _varied(records: Sequence[Record]) -> list[str]:
    """Return the fields that sweeps have listed, and those that they have drawn: numbers that follow the seed."""
    compared = _compared(records)
    others = [name for name, values in _values(records).items() if len(values) > 1 and name not in compared]
    return [*compared, *Sweep(records, others).continuous]


def _values(records: Sequence[Record]) -> dict[str, set[str]]:
    """Return the values of each field in any of the trials, as JSON."""
    values: dict[str, set[str]] = {}
    for record in records:
        for name, value in record.fields.items():
            values.setdefault(name, set()).add(canonical_json(value))
    return values


def _compared(records: Sequence[Record]) -> list[str]:
    """Return the fields that a sweep has listed: those that differ for the same seed. Drawn ones follow the seed.

    A field that follows from others, as a plug-in's defaults do, is left out.
    """
    values: dict[tuple[str, int], set[str]] = {}
    for record in records:
        for name, value in record.fields.items():
            values.setdefault((name, record.seed), set()).add(canonical_json(value))
    differing = dict.fromkeys(name for (name, _), found in values.items() if len(found) > 1)
    compared: list[str] = []
    for name in sorted(differing, key=lambda name: name not in PLUGINS):
        if len(grouped(records, [*compared, name])) > len(grouped(records, compared)):
            compared.append(name)
    return compared
