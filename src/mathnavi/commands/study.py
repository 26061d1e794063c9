"""``mathnavi study``: tables and figures of the thesis, reproduced, and the ledger of its claims."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.commands.arguments import FlagGroup, parse, without
from mathnavi.commands.command_line import prepare
from mathnavi.commands.errors import BadInputError, bad_input, print_error, worded
from mathnavi.commands.interruption import when_interrupted
from mathnavi.commands.output import output_folder
from mathnavi.commands.progress import sweep_progress
from mathnavi.commands.provenance import note_changed_files, note_origins
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.bounds import Processes, configuration
from mathnavi.interfaces.errors import FieldError, PluginError
from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.writing import write_text
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.plugin.registry import load, names
from mathnavi.sim.records.claimed_folder import locked
from mathnavi.sim.records.claims import Claim, ledger
from mathnavi.sim.records.files import inside
from mathnavi.sim.records.store import STUDY_STORE, Store, StoreWriteError, stored_results
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.cluster import LostError, check
from mathnavi.sim.sweep.execution import available_cores
from mathnavi.studies.framework.study import Setup, StudyError, checked_result, first_look, on_terrain, write_result

ALL = "all"
LEDGER = "CLAIMS.md"
OUT = Path("renders/out/study")
TERRAIN = "tian_shan"  # unless another is requested
Studies = Mapping[str, tuple[Any, Any]]  # plug-in and configuration by name
USAGE = """usage: mathnavi study NAME|all [OPTIONS]

NAME: {}

mathnavi study NAME --help lists the options."""


@configuration
class StudyOptions:
    """Flags of every study."""

    terrain: tuple[str, ...] = ()
    """terrain of the studies on terrain: a name or an .npz file; may be given several times; tian_shan if not given"""
    out: Path | None = None
    """folder to write to, with a folder for each terrain if there are several; renders/out/study if not given"""
    quick: bool = False
    """whether to take a small sample, for a first look"""
    workers: Processes = field(default_factory=available_cores)
    """number of processes that fly and compute"""
    cluster: str | None = None
    """address of a Dask scheduler whose workers fly and compute instead, tcp://HOST:PORT or tls://HOST:PORT"""
    mix_environments: bool = False
    """whether to accept results stored from another computing environment, and workers that compute in one"""

    def __post_init__(self) -> None:
        if len(set(self.terrain)) < len(self.terrain):
            raise FieldError(f"terrain = {self.terrain}; allowed: each terrain once")


def main(argv: Sequence[str]) -> int:
    known = names("studies")
    if not argv:
        raise BadInputError(f"NAME is missing; allowed: {', '.join((*known, ALL))}")
    if argv[0] in ("-h", "--help"):
        print(wrapped(USAGE.format(", ".join(known))))
        return 0
    prepare()
    options, studies = read_studies(argv)
    if options.cluster is not None:
        with bad_input():
            check(options.cluster)
    sites = _sites(options, studies)
    console, errors = Console(markup=False, emoji=False), Console(stderr=True, markup=False, emoji=False)
    claims: list[list[Claim]] = []  # of each site
    for site in sites:
        claims.append([])
        for name, (plugin, config) in site.studies.items():
            try:
                claims[-1] += _study(name, plugin, config, site, options, argv, errors)
            except (StudyError, StoreWriteError, RefusedError, LostError, OSError) as error:
                print_error(f"{name} {site.where}: {worded(error)}")
                return 1
        console.print(f"Claims {site.where}", style="bold", highlight=False)
        console.print(_table(claims[-1]))
        for name, (_, config) in site.studies.items():
            if small := first_look(config):
                console.print(f"{name} is a first look, too little to judge by: {small}", highlight=False)
        console.print(f"studies  {site.folder}", soft_wrap=True, highlight=False)
    if argv[0] == ALL:
        path = (options.out or OUT) / LEDGER
        pairs = list(zip(sites, claims, strict=True))
        over_terrain = {site.name: found for site, found in pairs if site.terrain is not None}
        without_terrain = [claim for site, found in pairs if site.terrain is None for claim in found]
        write_text(path, ledger(over_terrain, without_terrain, _samples(studies)))
        console.print(f"ledger   {path}", soft_wrap=True, highlight=False)
    missed = [claim for found in claims for claim in found if claim.kind == "target" and not claim.holds]
    return 1 if missed else 0


@dataclass(frozen=True)
class _Site:
    """Terrain with the studies that are done on it, or the studies without terrain."""

    name: str
    terrain: str | None  # as requested
    folder: Path
    studies: Studies

    @property
    def where(self) -> str:
        """Return the words for the site in a sentence."""
        return self.name if self.terrain is None else f"over {self.name}"


def _sites(options: StudyOptions, studies: Studies) -> list[_Site]:
    """Return the terrains with the studies that are done on each, and the site of the others, which are done once.

    With several terrains each has its own folder of files; all other files lie next to these folders.
    """
    out = options.out or OUT
    over = {name: pair for name, pair in studies.items() if on_terrain(pair[0])}
    anywhere = {name: pair for name, pair in studies.items() if name not in over}
    if options.terrain and not over:
        named = " ".join(f"--terrain {terrain}" for terrain in options.terrain)
        raise BadInputError(f"{named}: {', '.join(studies)} is not done on a terrain; allowed: no --terrain")
    terrains = (options.terrain or (TERRAIN,)) if over else ()
    with bad_input():
        names_of = [load_terrain(terrain).name for terrain in terrains]
    if twice := [name for name in names_of if names_of.count(name) > 1]:
        raise BadInputError(f"--terrain {' '.join(terrains)}: two are called {twice[0]}; allowed: each once")
    sites = [
        _Site(name, terrain, out / name if len(terrains) > 1 else out, over)
        for name, terrain in zip(names_of, terrains, strict=True)
    ]
    return [*sites, _Site("without terrain", None, out, anywhere)] if anywhere else sites


def read_studies(argv: Sequence[str]) -> tuple[StudyOptions, dict[str, tuple[Any, Any]]]:
    """Return the options, and the requested studies with their configurations; BadInputError if ``argv`` is wrong."""
    name = argv[0]
    chosen = names("studies") if name == ALL else (name,)
    try:
        plugins = {one: load("studies", one) for one in chosen}
    except ValueError as error:
        raise BadInputError(str(error).replace("studies:", "NAME =", 1)) from error
    prog = f"mathnavi study {name}"
    if name == ALL:
        (options,) = parse(
            argv[1:],
            prog,
            "Every study, and the ledger of the claims.",
            FlagGroup(StudyOptions, default=StudyOptions()),
        )
        return options, {
            one: (plugin, plugin.quick if options.quick else plugin.Config()) for one, plugin in plugins.items()
        }
    plugin = plugins[name]
    default = plugin.quick if "--quick" in argv else plugin.Config()
    purpose = (plugin.__doc__ or "").strip().partition("\n")[0]
    groups = FlagGroup(StudyOptions, default=StudyOptions()), FlagGroup(plugin.Config, default=default)
    options, config = parse(argv[1:], prog, purpose, *groups)
    return options, {name: (plugin, config)}


def _study(
    name: str,
    plugin: Any,
    config: Any,
    site: _Site,
    options: StudyOptions,
    argv: Sequence[str],
    errors: Console,
) -> Sequence[Claim]:
    """Run one study, write its files, and return its claims."""
    words = argv[1:] if site.terrain is not None else without("--terrain", argv[1:])
    command = shlex.join(["mathnavi", "study", name, *words])
    path, file = site.folder / STUDY_STORE, site.folder / f"{name.replace(':', '.')}.json"
    with bad_input():
        inside(options.out or OUT, site.folder)
    with ExitStack() as opened:
        with output_folder(site.folder), bad_input():
            store = opened.enter_context(Store.open(inside(site.folder, path)))
            opened.enter_context(locked(file, file))
        when_interrupted(lambda: _stored(path))
        progress = opened.enter_context(sweep_progress(errors, name))
        setup = Setup(site.terrain, store, options.workers, progress, options.cluster, options.mix_environments)
        if site.terrain is not None:
            note_changed_files(errors, store, {("terrain", site.terrain): setup.ground.digest})
        try:
            findings = checked_result(name, plugin, config, setup)
        except PluginError as error:
            raise BadInputError(str(error)) from error
        except ValueError as error:  # the terrain does not do for its missions, say
            raise StudyError(str(error)) from error
        small = first_look(config)
        write_result(site.folder, name.replace(":", "."), plugin.title, findings, setup, command, small)
        note_origins(errors, store, setup.elsewhere)
    claims: Sequence[Claim] = findings.claims
    return claims


def _stored(path: Path) -> str:
    """Return the note on what is kept of a study that is interrupted."""
    number = stored_results(path)
    if number is None:
        return f"what had ended is stored in {path}; to go on"
    if number == 0:
        return "nothing had ended yet; to begin again"
    return f"{counted(number, 'result')} stored in {path}; to go on"


def _samples(studies: Studies) -> str:
    """Return the samples of each study, in words."""
    sizes = {name: dataclasses.asdict(config) for name, (_, config) in studies.items()}
    return "; ".join(
        f"{name}: {', '.join(f'{count} {what}' for what, count in of_study.items())}"
        for name, of_study in sizes.items()
    )


def _table(claims: Sequence[Claim]) -> Table:
    kinds = "printed: what the thesis says, which need not hold; target: what is asked of this software"
    table = Table(box=None, padding=(0, 2, 0, 0), caption=kinds, caption_justify="left", caption_style="dim")
    table.add_column("claim", no_wrap=True)
    for column in ("expected", "measured", "holds"):
        table.add_column(column, min_width=5, overflow="fold")
    for claim in claims:
        holds = "not measured" if claim.holds is None else "yes" if claim.holds else "NO"
        table.add_row(f"{claim.id}\n{claim.kind}", Text(claim.expected), Text(claim.measured), holds)
    return table
