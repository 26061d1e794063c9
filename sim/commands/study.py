"""``mathnavi study``: tables and figures of the thesis done again, and the ledger of its claims."""

from __future__ import annotations

import dataclasses
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from models.terrain.library import load_terrain
from renders.claims import Claim, ledger
from sim.commands.arguments import Group, parse
from sim.commands.errors import INTERRUPTED, BadInputError, bad_input
from sim.commands.order import prepare
from sim.commands.output import output_folder
from sim.commands.progress import sweep_progress
from sim.log import write_text
from sim.plugins import load, names
from sim.store import Store, StoreError
from sim.studies.study import Setup, StudyError, write_findings
from sim.sweep.child import RefusedError
from sim.sweep.execution import available_cores

ALL = "all"
STORE = "trials.db"
LEDGER = "CLAIMS.md"
USAGE = "usage: mathnavi study NAME|all [OPTIONS]      NAME: {}\nmathnavi study NAME --help lists the options."


@dataclass(frozen=True)
class Options:
    """Flags of every study."""

    terrain: tuple[str, ...] = ()
    """name of a terrain, or an .npz file; may be given several times; tian_shan if not given"""
    out: Path | None = None
    """folder to write to, with a folder for each terrain if there are several; renders/out/study if not given"""
    quick: bool = False
    """a small sample, for a first look"""
    workers: int = field(default_factory=available_cores)
    """processes that fly"""

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"workers = {self.workers}; allowed: a whole number >= 1")
        if len(set(self.terrain)) < len(self.terrain):
            raise ValueError(f"terrain = {self.terrain}; allowed: each terrain once")


def main(argv: Sequence[str]) -> int:
    known = names("studies")
    if not argv:
        raise BadInputError(f"NAME is missing; allowed: {', '.join((*known, ALL))}")
    if argv[0] in ("-h", "--help"):
        print(USAGE.format(", ".join(known)))
        return 0
    prepare()
    try:
        options, studies = read_order(argv)
    except SystemExit:  # the help is printed
        return 0
    terrains = options.terrain or ("tian_shan",)
    with bad_input():
        grounds = [load_terrain(terrain) for terrain in terrains]
    if len({ground.name for ground in grounds}) < len(grounds):
        raise BadInputError(f"--terrain {' '.join(terrains)}: two are called {grounds[0].name}; allowed: each once")
    out = options.out or Path("renders/out/study")
    console, errors = Console(), Console(stderr=True)
    claims: dict[str, list[Claim]] = {}
    for terrain, ground in zip(terrains, grounds, strict=True):
        folder = out / ground.name if len(terrains) > 1 else out
        claims[ground.name] = []
        for name, (plugin, config) in studies.items():
            try:
                claims[ground.name] += _study(name, plugin, config, terrain, folder, options, argv, errors)
            except (StudyError, StoreError, RefusedError) as error:
                print(f"mathnavi: {name} over {ground.name}: {' '.join(str(error).split())}", file=sys.stderr)
                return 1
            except KeyboardInterrupt:
                command = shlex.join(["mathnavi", "study", *argv])
                print(f"mathnavi: interrupted, what was flown is stored; to go on: {command}", file=sys.stderr)
                return INTERRUPTED
        console.print(_table(ground.name, claims[ground.name]))
        console.print(f"studies  {folder}", soft_wrap=True, highlight=False)
    if argv[0] == ALL:
        write_text(out / LEDGER, ledger(claims, _samples(studies)))
        console.print(f"ledger   {out / LEDGER}", soft_wrap=True, highlight=False)
    missed = [
        claim for of_terrain in claims.values() for claim in of_terrain if claim.kind == "target" and not claim.holds
    ]
    return 1 if missed else 0


def read_order(argv: Sequence[str]) -> tuple[Options, dict[str, tuple[Any, Any]]]:
    """The options, and the studies with their configurations."""
    name = argv[0]
    chosen = names("studies") if name == ALL else (name,)
    try:
        plugins = {one: load("studies", one) for one in chosen}
    except ValueError as error:
        raise BadInputError(str(error).replace("studies:", "NAME =", 1)) from error
    prog = f"mathnavi study {name}"
    if name == ALL:
        (options,) = parse(
            argv[1:], prog, "Every study, and the ledger of the claims.", Group(Options, default=Options())
        )
        return options, {
            one: (plugin, plugin.quick if options.quick else plugin.Config()) for one, plugin in plugins.items()
        }
    plugin = plugins[name]
    default = plugin.quick if "--quick" in argv else plugin.Config()
    purpose = (plugin.__doc__ or "").strip().partition("\n")[0]
    groups = Group(Options, default=Options()), Group(plugin.Config, default=default)
    options, config = parse(argv[1:], prog, purpose, *groups)
    return options, {name: (plugin, config)}


def _study(
    name: str,
    plugin: Any,
    config: Any,
    terrain: str,
    folder: Path,
    options: Options,
    argv: Sequence[str],
    errors: Console,
) -> Sequence[Claim]:
    """Run one study, write its files, and return its claims."""
    command = shlex.join(["mathnavi", "study", name, *argv[1:]])
    with output_folder(folder), bad_input():
        store = Store.open(folder / STORE)
    with store, sweep_progress(errors, name) as progress:
        setup = Setup(terrain, store, options.workers, progress)
        try:
            findings = plugin.run(config, setup)
        except ValueError as error:  # the terrain does not do for its missions
            raise StudyError(str(error)) from error
        with bad_input():
            write_findings(folder, name.replace(":", "."), plugin.title, findings, setup, command)
    claims: Sequence[Claim] = findings.claims
    return claims


def _samples(studies: Mapping[str, tuple[Any, Any]]) -> str:
    """How much each study measures."""
    sizes = {name: dataclasses.asdict(config) for name, (_, config) in studies.items()}
    return "; ".join(
        f"{name}: {', '.join(f'{count} {what}' for what, count in of_study.items())}"
        for name, of_study in sizes.items()
    )


def _table(terrain: str, claims: Sequence[Claim]) -> Table:
    table = Table(title=f"Claims over {terrain}", title_justify="left", box=None, padding=(0, 2, 0, 0))
    for column in ("claim", "kind", "expected", "measured", "holds"):
        table.add_column(column, overflow="fold")
    for claim in claims:
        holds = "not measured" if claim.holds is None else "yes" if claim.holds else "NO"
        table.add_row(claim.id, claim.kind, claim.expected, claim.measured, holds)
    return table
