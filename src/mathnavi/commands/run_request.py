"""Request of `mathnavi run` and `mathnavi sweep`: a scenario, its plug-ins, and all their fields."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mathnavi.commands import opengl
from mathnavi.commands.arguments import FlagGroup, flags, given, parse, value_of, with_flag
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.run_config import RunConfig
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.bounds import Seed, configuration
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.fields import flattened, plain
from mathnavi.sim.plugin.registry import PluginSpec, load, names, of_stranger

if TYPE_CHECKING:
    from mathnavi.sim.scenarios.closed_loop import ClosedLoop

PLACES = {"scenarios": "SCENARIO", "controllers": "--controller", "estimators": "--estimator"}
USAGE = """usage: mathnavi {0} SCENARIO [OPTIONS]

SCENARIO: {1}

mathnavi {0} SCENARIO --help lists the options."""


@configuration
class CommonOptions:
    """Flags of every scenario."""

    seed: Seed = 0
    """seed of every random draw: the same seed gives the same log, bit for bit"""
    controller: str = ""
    """controller: name of a plug-in, or package.module:Class; its fields are --planner.*"""
    estimator: str = ""
    """estimator: name of a plug-in, or package.module:Class; its fields are --estimator.*"""


@dataclass(frozen=True)
class RunRequest:
    """Requested scenario with its plug-ins and their fields."""

    prog: str
    name: str  # of the scenario
    scenario: Any
    common: CommonOptions
    options: Any  # of the command
    config: Any
    controller: PluginSpec
    estimator: PluginSpec
    known: tuple[str, ...]  # flags
    given: tuple[str, ...] = ()  # flags, on the command line

    @property
    def fields(self) -> tuple[FlagGroup, ...]:
        """Return the fields of the scenario and its plug-ins at their present values."""
        return _fields(self.config, self.controller, self.estimator, self.common)

    def build(self) -> ClosedLoop:
        """Build the closed loop; errors as from ``scenarios.closed_loop.built``."""
        from mathnavi.sim.scenarios.closed_loop import built  # not needed by a sweep of a user-defined scenario

        return built(self.name, self.scenario, self.config, self.common.seed, self.controller, self.estimator)

    @contextmanager
    def failures(self, what: str) -> Iterator[None]:
        """Raise BadInputError for what a third-party scenario raises while it is run."""
        try:
            with of_stranger(self.scenario, f"scenarios: {self.name!r}: {what} failed:"):
                yield
        except PluginError as error:
            raise BadInputError(str(error)) from error

    @property
    def files(self) -> list[Path]:
        """Return the files that the fields name."""
        values = (
            value
            for config in (self.config, self.controller.config, self.estimator.config)
            for value in flattened(plain(config)).values()
        )
        return [Path(value) for value in values if isinstance(value, str) and os.path.isfile(value)]

    @contextmanager
    def bad_input(self) -> Iterator[None]:
        """Raise BadInputError for a ValueError or an OSError within the block; its message names the flag."""
        try:
            with bad_input():
                yield
        except BadInputError as error:
            raise BadInputError(with_flag(_about_a_file(str(error), self.config), self.known)) from error


def usage(command: str, argv: Sequence[str]) -> bool:
    """Print the usage if it is requested, and return whether it was; BadInputError without arguments."""
    if not argv:
        raise BadInputError(f"SCENARIO is missing; allowed: {', '.join(names('scenarios'))}")
    if argv[0] in ("-h", "--help"):
        print(wrapped(USAGE.format(command, ", ".join(names("scenarios")))))
        return True
    return False


def prepare() -> None:
    """Import MuJoCo, and make a user's plug-in, "my_planner:Mine", importable from the current folder."""
    opengl.import_physics()
    import_from_here()


def import_from_here() -> None:
    """Make a user's modules importable from the current folder, after all that is installed."""
    try:
        here = os.getcwd()
    except OSError as error:
        raise BadInputError(
            f"the folder in which the command is given: {error.strerror}; allowed: one that is there"
        ) from None
    if here not in sys.path:
        sys.path.append(here)


def read_request(
    command: str,
    argv: Sequence[str],
    options: type,
    run_config: RunConfig | None = None,
    chosen: Mapping[str, str] | None = None,
) -> RunRequest:
    """Return the request that ``argv`` makes, on top of a recorded run if given; BadInputError if ``argv`` is wrong.

    ``options`` are the flags of the command; ``chosen`` are plug-ins ("controller", "estimator") that no flag names.
    """
    name, words = _scenario(argv, run_config)
    scenario = loaded("scenarios", name)
    controller, observer = (
        (chosen or {}).get(part, value_of(f"--{part}", words)) for part in ("controller", "estimator")
    )
    if controller is None:
        controller = run_config.controller if run_config else scenario.controller
    if observer is None:
        observer = run_config.estimator if run_config else scenario.estimator
    planner = restored_plugin("controllers", controller, run_config)
    estimator = restored_plugin("estimators", observer, run_config)
    config = _restored(scenario.Config, run_config, words) if run_config else scenario.Config()
    common = CommonOptions(run_config.seed if run_config else 0, controller, observer)
    groups = (
        FlagGroup(CommonOptions, default=common, heading="Flags of every scenario."),
        FlagGroup(options),
        *_fields(config, planner, estimator, common),
    )
    known = tuple(flag for group in groups for flag, _ in flags(group.schema, group.prefix))
    purpose = (scenario.__doc__ or "").strip().partition("\n")[0]
    prog = f"mathnavi {command} {name}"
    common, own, config, planner_config, observer_config = parse(words, prog, purpose, *groups)
    parts = PluginSpec(planner.plugin, planner_config), PluginSpec(estimator.plugin, observer_config)
    return RunRequest(prog, name, scenario, common, own, config, *parts, known, tuple(given(words)))


def _fields(config: Any, controller: PluginSpec, estimator: PluginSpec, common: CommonOptions) -> tuple[FlagGroup, ...]:
    return (
        FlagGroup(type(config), default=config),
        FlagGroup(type(controller.config), "planner", controller.config, f"Fields of controller {common.controller}."),
        FlagGroup(type(estimator.config), "estimator", estimator.config, f"Fields of estimator {common.estimator}."),
    )


def _scenario(argv: Sequence[str], run_config: RunConfig | None) -> tuple[str, Sequence[str]]:
    if argv[0].startswith("-"):
        if run_config is None:
            raise BadInputError(
                f"{argv[0]} stands where the scenario belongs; allowed: {', '.join(names('scenarios'))}"
            )
        return run_config.scenario, argv
    if run_config is not None and argv[0] != run_config.scenario:
        raise BadInputError(f"scenario {argv[0]!r} is not the one in {run_config.path}; allowed: {run_config.scenario}")
    return argv[0], argv[1:]


def loaded(kind: str, name: str) -> Any:
    """Return the plug-in with a name; BadInputError names the flag that it is given with."""
    try:
        return load(kind, name)
    except ValueError as error:
        raise BadInputError(str(error).replace(kind, PLACES[kind], 1)) from error


def restored_plugin(kind: str, name: str, run_config: RunConfig | None) -> PluginSpec:
    """Return a plug-in with its default fields, or with the recorded ones if it is the plug-in of the recorded run."""
    plugin = loaded(kind, name)
    if run_config is not None:
        part = kind.removesuffix("s")
        recorded, fields = getattr(run_config, part), getattr(run_config, f"{part}_fields")
        if loaded(kind, recorded) is plugin:
            return PluginSpec(plugin, run_config.restored(plugin.Config, fields, f"$.{part}.fields"))
    return PluginSpec.with_fields(plugin)


def _restored(config: type, run_config: RunConfig, words: Sequence[str]) -> Any:
    """Return the recorded configuration of a scenario, except that lists which are given again start empty."""
    lists = {flag for flag, repeats in flags(config) if repeats} & set(given(words))
    fields = {name: value for name, value in run_config.fields.items() if f"--{name.replace('_', '-')}" not in lists}
    return run_config.restored(config, fields, "$.fields")


def _about_a_file(message: str, config: Any) -> str:
    """Return the message, preceded by the field that names a file if it starts with the name of that file."""
    for entry in dataclasses.fields(config):
        value = getattr(config, entry.name)
        if isinstance(value, str) and message.startswith(f"{value}: "):
            return f"{entry.name} = {message}"
    return message
