"""Command line of `mathnavi run`, `sweep` and `search`: from words to the specification of a run."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mathnavi.commands import opengl
from mathnavi.commands.arguments import FlagGroup, flags, given, parse, value_of, with_flag
from mathnavi.commands.errors import BadInputError, bad_input, bad_plugin
from mathnavi.commands.flown import HEADING, CommonOptions, import_from_here
from mathnavi.commands.recorded_spec import RecordedSpec
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.field_table import flag_of
from mathnavi.sim.plugin.groups import KINDS
from mathnavi.sim.plugin.registry import called, names
from mathnavi.sim.records.run_spec import RunSpec

if TYPE_CHECKING:
    from mathnavi.sim.scenarios.closed_loop import ClosedLoop


@dataclass(frozen=True)
class CommandLine:
    """Specification of a run with the options of the command that it is given to."""

    prog: str
    spec: RunSpec
    options: Any = None
    known: tuple[str, ...] = ()  # flags
    given: tuple[str, ...] = ()  # flags, on the command line

    def build(self) -> ClosedLoop:
        """Build the closed loop; errors as of ``RunSpec.build``."""
        closed_loop: ClosedLoop = self.spec.build()
        return closed_loop

    @contextmanager
    def failures(self, what: str) -> Iterator[None]:
        """Raise BadInputError for what a third-party scenario raises while it is run."""
        try:
            with self.spec.failures(what):
                yield
        except PluginError as error:
            raise BadInputError(str(error)) from error

    @property
    def files(self) -> list[Path]:
        """Return the files that the fields name."""
        values = self.spec.fields.values()
        return [Path(value) for value in values if isinstance(value, str) and os.path.isfile(value)]

    @contextmanager
    def bad_input(self) -> Iterator[None]:
        """Raise BadInputError for a ValueError or an OSError within the block; its message names the flag."""
        try:
            with bad_input():
                yield
        except BadInputError as error:
            raise BadInputError(with_flag(self._about_a_file(str(error)), self.known)) from error

    def _about_a_file(self, message: str) -> str:
        """Return the message, preceded by the field that names a file if it starts with the name of that file."""
        named = (name for name, value in self.spec.fields.items() if message.startswith(f"{value}: "))
        return next((f"{name} = {message}" for name in named), message)


def prepare() -> None:
    """Import MuJoCo, and make a user's plug-in, "my_planner:Mine", importable from the current folder."""
    opengl.import_physics()
    import_from_here()


def read_command_line(
    command: str,
    argv: Sequence[str],
    options: type,
    recorded: RecordedSpec | None = None,
    chosen: Mapping[str, str] | None = None,
) -> CommandLine:
    """Read ``argv``, on top of a recorded run if given; BadInputError if ``argv`` is wrong.

    ``options`` are the flags of the command; ``chosen`` are plug-ins ("controller", "estimator") that no flag names.
    """
    name, words = _scenario(argv, recorded)
    controller, estimator = ((chosen or {}).get(part, value_of(f"--{part}", words)) for part in KINDS)
    with bad_plugin():
        if recorded is None:
            spec = RunSpec.of(name, 0, controller, estimator)
        else:
            spec = _without_lists(recorded.spec, words).with_plugins(controller, estimator)
    common = CommonOptions(spec.seed, *(called(kind, getattr(spec, part).name) for part, kind in KINDS.items()))
    groups = (
        FlagGroup(CommonOptions, default=common),
        FlagGroup(options),
        *field_groups(spec),
    )
    known = tuple(flag for group in groups for flag in group.section.flags)
    purpose = (spec.scenario_class.__doc__ or "").strip().partition("\n")[0]
    prog = f"mathnavi {command} {name}"
    common, own, config, planner, observer = parse(words, prog, purpose, *groups)
    parts = replace(spec.controller, config=planner), replace(spec.estimator, config=observer)
    return CommandLine(prog, RunSpec(name, config, *parts, common.seed), own, known, tuple(given(words)))


def field_groups(spec: RunSpec) -> tuple[FlagGroup, ...]:
    """Return the fields of the scenario and its plug-ins as flags, at their present values."""
    headings = {
        "": None,
        "planner": HEADING.format("controller", called("controllers", spec.controller.name)),
        "estimator": HEADING.format("estimator", called("estimators", spec.estimator.name)),
    }
    return tuple(FlagGroup(type(part), prefix, part, headings[prefix]) for prefix, part in spec.parts.items())


def _scenario(argv: Sequence[str], recorded: RecordedSpec | None) -> tuple[str, Sequence[str]]:
    if argv[0].startswith("-"):
        if recorded is None:
            raise BadInputError(
                f"{argv[0]} stands where the scenario belongs; allowed: {', '.join(names('scenarios'))}"
            )
        return recorded.spec.scenario, argv
    if recorded is not None and argv[0] != recorded.spec.scenario:
        raise BadInputError(
            f"scenario {argv[0]!r} is not the one in {recorded.path}; allowed: {recorded.spec.scenario}"
        )
    return argv[0], argv[1:]


def _without_lists(spec: RunSpec, words: Sequence[str]) -> RunSpec:
    """Return the specification with default lists for the scenario's lists that are given again, which replace them."""
    again = {flag for flag, repeats in flags(type(spec.config)).items() if repeats} & set(given(words))
    default = type(spec.config)()
    lists = (entry.name for entry in dataclasses.fields(default) if flag_of(entry.name) in again)
    return spec.with_fields({name: getattr(default, name) for name in lists})
