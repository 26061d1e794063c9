"""Command that flies one trial alone, with its folder, its log and its pictures."""

from __future__ import annotations

import shlex
from typing import Any

from mathnavi.commands.arguments import flags
from mathnavi.interfaces.field_table import flag_of, negation
from mathnavi.interfaces.fields import flattened, plain
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.sweep.trial import Trial


def command_of(trial: Trial) -> str:
    """Return ``mathnavi run`` with the seed, the plug-ins and every field that is not at its default."""
    scenario = load("scenarios", trial.scenario)
    words = ["mathnavi", "run", trial.scenario, "--seed", str(trial.seed)]
    for flag, name, own in (
        ("--controller", trial.controller, scenario.controller),
        ("--estimator", trial.estimator, scenario.estimator),
    ):
        words += [flag, name] if name != own else []
    for prefix, config in (
        ("", trial.config),
        ("planner", trial.controller_config),
        ("estimator", trial.estimator_config),
    ):
        words += _words(config, prefix)
    return shlex.join(words)


def _words(config: Any, prefix: str) -> list[str]:
    repeats = dict(flags(type(config), prefix))
    default = flattened(plain(type(config)()))
    words: list[str] = []
    for name, value in flattened(plain(config)).items():
        flag = flag_of(prefix, name)
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
