"""Command that flies one trial alone, with its folder, its log and its pictures."""

from __future__ import annotations

import shlex
from typing import Any

from mathnavi.commands.arguments import flags
from mathnavi.interfaces.field_table import flag_of, negation
from mathnavi.interfaces.fields import flattened, plain
from mathnavi.sim.plugin.groups import KINDS
from mathnavi.sim.plugin.registry import called
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.sweep.trial import Trial


def command_of(trial: Trial) -> str:
    """Return ``mathnavi run`` with the seed, the plug-ins and every field that is not at its default."""
    spec = trial.spec
    default = RunSpec.of(spec.scenario)
    words = ["mathnavi", "run", spec.scenario, "--seed", str(spec.seed)]
    for part, kind in KINDS.items():
        plugin = getattr(spec, part)
        words += [f"--{part}", called(kind, plugin.name)] if plugin.plugin is not getattr(default, part).plugin else []
    for prefix, config in spec.parts.items():
        words += _words(config, prefix)
    return shlex.join(words)


def _words(config: Any, prefix: str) -> list[str]:
    repeats = flags(type(config), prefix)
    default = flattened(plain(type(config)()))
    words: list[str] = []
    for name, value in flattened(plain(config)).items():
        flag = flag_of(f"{prefix}.{name}")
        if value is None or value == default.get(name):
            continue
        if isinstance(value, bool):
            words.append(flag if value else negation(flag))
        elif repeats.get(flag):
            for item in value:
                words += [flag, *map(_word, item if isinstance(item, list) else [item])]
        else:
            words += [flag, *map(_word, value if isinstance(value, list) else [value])]
    return words


def _word(value: Any) -> str:
    return repr(value) if isinstance(value, float) else str(value)
