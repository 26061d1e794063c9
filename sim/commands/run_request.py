"""What `mathnavi run` and `mathnavi sweep` are asked for: a scenario, its plug-ins, and every field of theirs."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from mathnavi.sim.commands import opengl
from mathnavi.sim.commands.arguments import FlagGroup, flags, given, parse, value_of, with_flag
from mathnavi.sim.commands.errors import BadInputError, bad_input
from mathnavi.sim.commands.run_config import RunConfig
from mathnavi.sim.plugin.registry import PluginSpec, load, names

PLACES = {"scenarios": "SCENARIO", "controllers": "--controller", "estimators": "--estimator"}
USAGE = "usage: mathnavi {0} SCENARIO [OPTIONS]      SCENARIO: {1}\nmathnavi {0} SCENARIO --help lists the options."


@dataclass(frozen=True)
class CommonOptions:
    """Flags of every scenario."""

    seed: int = 0
    """of every random draw: the same seed gives the same log, bit for bit"""
    controller: str = ""
    """name of a plug-in, or package.module:Class; its fields are --planner.*"""
    estimator: str = ""
    """name of a plug-in, or package.module:Class; its fields are --estimator.*"""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed = {self.seed}; allowed: a whole number >= 0")


@dataclass(frozen=True)
class RunRequest:
    """Everything that was asked for."""

    prog: str
    name: str  # of the scenario
    scenario: Any
    common: CommonOptions
    options: Any  # of the command
    config: Any
    controller: PluginSpec
    estimator: PluginSpec
    known: tuple[str, ...]  # flags

    @property
    def fields(self) -> tuple[FlagGroup, ...]:
        """The fields of the scenario and its plug-ins, at their present values."""
        return _fields(self.config, self.controller, self.estimator, self.common)

    @contextmanager
    def bad_input(self) -> Iterator[None]:
        """A ValueError or an OSError in here means that the input was bad; the error names the flag."""
        try:
            with bad_input():
                yield
        except BadInputError as error:
            raise BadInputError(with_flag(_about_a_file(str(error), self.config), self.known)) from error


def usage(command: str, argv: Sequence[str]) -> bool:
    """Whether the usage was asked for, and printed; BadInputError without any word."""
    if not argv:
        raise BadInputError(f"SCENARIO is missing; allowed: {', '.join(names('scenarios'))}")
    if argv[0] in ("-h", "--help"):
        print(USAGE.format(command, ", ".join(names("scenarios"))))
        return True
    return False


def prepare() -> None:
    """Choose how to draw, and find a user's own plug-in, "my_planner:Mine", where the command is given."""
    opengl.choose()
    opengl.import_physics()
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())


def read_order(
    command: str,
    argv: Sequence[str],
    options: type,
    saved: RunConfig | None = None,
    chosen: Mapping[str, str] | None = None,
) -> RunRequest:
    """What ``argv`` asks for, on top of what a saved run says.

    ``options`` are the command's own flags; ``chosen`` are plug-ins ("controller", "estimator") that no flag names.
    """
    name, words = _scenario(argv, saved)
    scenario = loaded("scenarios", name)
    controller, observer = (
        (chosen or {}).get(part, value_of(f"--{part}", words)) for part in ("controller", "estimator")
    )
    if controller is None:
        controller = saved.controller if saved else scenario.controller
    if observer is None:
        observer = saved.estimator if saved else scenario.estimator
    planner = restored_part(
        "controllers", controller, saved, (saved.controller, saved.controller_fields) if saved else None
    )
    estimator = restored_part(
        "estimators", observer, saved, (saved.estimator, saved.estimator_fields) if saved else None
    )
    config = _restored(scenario.Config, saved, words) if saved else scenario.Config()
    common = CommonOptions(saved.seed if saved else 0, controller, observer)
    groups = (
        FlagGroup(CommonOptions, default=common, heading="Of every scenario."),
        FlagGroup(options),
        *_fields(config, planner, estimator, common),
    )
    known = tuple(flag for group in groups for flag, _ in flags(group.schema, group.prefix))
    purpose = (scenario.__doc__ or "").strip().partition("\n")[0]
    prog = f"mathnavi {command} {name}"
    common, own, config, planner_config, observer_config = parse(words, prog, purpose, *groups)
    parts = PluginSpec(planner.plugin, planner_config), PluginSpec(estimator.plugin, observer_config)
    return RunRequest(prog, name, scenario, common, own, config, *parts, known)


def _fields(config: Any, controller: PluginSpec, estimator: PluginSpec, common: CommonOptions) -> tuple[FlagGroup, ...]:
    return (
        FlagGroup(type(config), default=config),
        FlagGroup(type(controller.config), "planner", controller.config, f"Of the controller {common.controller}."),
        FlagGroup(type(estimator.config), "estimator", estimator.config, f"Of the estimator {common.estimator}."),
    )


def _scenario(argv: Sequence[str], saved: RunConfig | None) -> tuple[str, Sequence[str]]:
    if argv[0].startswith("-"):
        if saved is None:
            raise BadInputError(
                f"{argv[0]} stands where the scenario belongs; allowed: {', '.join(names('scenarios'))}"
            )
        return saved.scenario, argv
    if saved is not None and argv[0] != saved.scenario:
        raise BadInputError(f"scenario {argv[0]!r} is not the one in {saved.path}; allowed: {saved.scenario}")
    return argv[0], argv[1:]


def loaded(kind: str, name: str) -> Any:
    """The plug-in called so; BadInputError says what stands where it is named on the command line."""
    try:
        return load(kind, name)
    except ValueError as error:
        raise BadInputError(str(error).replace(kind, PLACES[kind], 1)) from error


def restored_part(
    kind: str, name: str, saved: RunConfig | None, before: tuple[str, dict[str, Any]] | None
) -> PluginSpec:
    """A plug-in with its default fields, or with the saved ones if it is the plug-in that was saved."""
    plugin = loaded(kind, name)
    if saved is not None and before is not None and loaded(kind, before[0]) is plugin:
        return PluginSpec(plugin, saved.restored(plugin.Config, before[1], f"{kind.removesuffix('s')}.fields"))
    return PluginSpec.of(plugin)


def _restored(config: type, saved: RunConfig, words: Sequence[str]) -> Any:
    """The saved fields of a scenario, but for the lists that are given anew: those start empty."""
    lists = {flag for flag, repeats in flags(config) if repeats} & set(given(words))
    fields = {name: value for name, value in saved.fields.items() if f"--{name.replace('_', '-')}" not in lists}
    return saved.restored(config, fields, "fields")


def _about_a_file(message: str, config: Any) -> str:
    """A message that starts with the name of a file, with the field that names it before it."""
    for entry in dataclasses.fields(config):
        value = getattr(config, entry.name)
        if isinstance(value, str) and message.startswith(f"{value}: "):
            return f"{entry.name} = {message}"
    return message
