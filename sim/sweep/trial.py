"""Trial: a scenario with its plug-ins, every field resolved, and a seed. Its key is the hash of its content.

In the key, the digest of a file's content replaces the field that names the file
(``mathnavi.interfaces.input_files``), and the computing environment is part of the key.

A trial may name a measure, a function at "package.module:function" that computes figures from the ``RunResult``, which
holds the whole log. The figures are added to the summary, and the log is not kept.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.fields import leaf, plain, with_fields
from mathnavi.interfaces.input_files import Digests, declared_inputs, named_plugins, run_inputs
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.records.computing_environment import environment, in_environment
from mathnavi.sim.records.figure_names import is_wall_clock
from mathnavi.sim.records.origins import Origin
from mathnavi.sim.records.store import Record, canonical_json

if TYPE_CHECKING:  # the processes of a sweep import a scenario only where they fly it
    from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunResult


@dataclass(frozen=True)
class Trial:
    """Run that any process can repeat. Plug-ins are named as on the command line, or as "package.module:Class"."""

    scenario: str
    config: Any  # frozen dataclass of the scenario
    seed: int
    controller: str
    controller_config: Any  # frozen dataclass of the controller
    estimator: str
    estimator_config: Any  # frozen dataclass of the estimator
    measure: str = ""  # "package.module:function" of the outcome

    WALL_TIME: ClassVar[str] = "trial_wall_s"

    def __post_init__(self) -> None:
        if not (isinstance(self.seed, int) and 0 <= self.seed <= LARGEST_SEED):
            raise ArgumentError(f"seed = {self.seed!r}; allowed: a whole number from 0 to {LARGEST_SEED}")

    @property
    def parameters(self) -> dict[str, Any]:
        """Return all resolved fields as plain data, and the digests of the files that fields name."""
        return self._parameters(run_inputs(*self._configs))

    @property
    def code(self) -> str:
        """Version of the code that it runs."""
        return code_version(
            _plugin("scenarios", self.scenario),
            _plugin("controllers", self.controller),
            _plugin("estimators", self.estimator),
            *([_function(self.measure)] if self.measure else []),
            *(plugin for config in self._configs for plugin in named_plugins(config)),
        )

    @property
    def content(self) -> str:
        """Hash of scenario, parameters, seed and code."""
        return contents([self])[0]

    @property
    def key(self) -> str:
        """Hash of the content and of the environment of this process."""
        return in_environment(self.content)

    def build(self) -> ClosedLoop:
        """Build the closed loop, ready to run; ValueError as raised by the scenario."""
        parts = (
            PluginSpec(_plugin("controllers", self.controller), self.controller_config),
            PluginSpec(_plugin("estimators", self.estimator), self.estimator_config),
        )
        closed_loop: ClosedLoop = _plugin("scenarios", self.scenario).build(self.config, self.seed, *parts)
        return closed_loop

    def flown(self) -> RunResult:
        """Run it; return the result with the whole log."""
        outcome: RunResult = self.build().run()
        return outcome

    def run(self) -> tuple[dict[str, Any], bool]:
        """Run it; return the summary with the figures of the measure, and whether the mission succeeded."""
        outcome = self.flown()
        measured = _function(self.measure)(outcome) if self.measure else {}
        return {**outcome.summary, **measured}, bool(outcome.success)

    def perform(self) -> dict[str, Any]:
        """Run it; return success, summary and timings as in a record. Raises TypeError for a summary that cannot be
        stored.
        """
        figures, success = self.run()
        timings = {
            name: None if figures[name] is None else float(figures[name]) for name in filter(is_wall_clock, figures)
        }
        kept = {name: value for name, value in figures.items() if name not in timings and name != "seed"}
        canonical_json(kept)
        return {"success": success, "summary": kept, "timings": timings}

    def record(
        self,
        content: str,
        status: str,
        *,
        success: bool | None = None,
        summary: Mapping[str, Any] | None = None,
        timings: Mapping[str, float | None] | None = None,
        error: str | None = None,
    ) -> Record:
        """Return the record of how it ended in this process, under the key that it has here."""
        named = (in_environment(content), self.scenario, self.parameters, self.seed, self.code)
        origin = Origin(content, environment())
        return Record(*named, status, success, dict(summary or {}), dict(timings or {}), error, origin)

    def renamed(self, record: Record) -> Record:
        """Return the record of a trial of the same key, with the file names of this trial."""
        return replace(record, parameters=self._parameters(record.parameters["inputs"]))

    @property
    def _configs(self) -> tuple[Any, Any, Any]:
        return self.config, self.controller_config, self.estimator_config

    def _parameters(self, inputs: Mapping[str, str]) -> dict[str, Any]:
        return {
            "config": plain(self.config),
            "controller": {"name": self.controller, "fields": plain(self.controller_config)},
            "estimator": {"name": self.estimator, "fields": plain(self.estimator_config)},
            "inputs": dict(inputs),
            **({"measure": self.measure} if self.measure else {}),
        }

    def _content(self, inputs: Mapping[str, str]) -> str:
        parameters = self._parameters(inputs)
        places = {
            "planner": parameters["controller"]["fields"],
            "estimator": parameters["estimator"]["fields"],
        }
        declared = {
            *declared_inputs(self.config),
            *declared_inputs(self.controller_config, "planner."),
            *declared_inputs(self.estimator_config, "estimator."),
        }
        for name in declared & set(inputs):  # the content of a file counts, not its place
            first, *rest = name.split(".")
            holder = places[first] if first in places else parameters["config"]
            *above, last = rest if first in places else (first, *rest)
            for part in above:
                holder = holder[part]
            del holder[last]
        return hashlib.sha256(canonical_json([self.scenario, parameters, self.seed, self.code]).encode()).hexdigest()


def trial(
    scenario: str = "safe-flight",
    seed: int = 0,
    controller: str | None = None,
    estimator: str | None = None,
    fields: Mapping[str, Any] | None = None,
    measure: str = "",
    **more: Any,
) -> Trial:
    """Build a trial with some fields set, those that are not at their defaults.

    ``fields`` are named as on the command line, with underscores: "terrain", "faults.gust_rms", "planner.nodes",
    "estimator.rate"; ``more`` are those of the scenario that need no dot. Controller and estimator are the scenario's
    defaults if not given; ``measure`` is that of a Trial.

        trial(seed=3, terrain="jacksboro", fields={"faults.gust_rms": 1.5, "planner.nodes": 13})

    Raises ValueError for an unknown plug-in or field, and for a value of another type or out of its range.
    """
    plugin = _plugin("scenarios", scenario)
    names = {"controllers": controller or plugin.controller, "estimators": estimator or plugin.estimator}
    sorted_out: dict[str, dict[str, Any]] = {"planner": {}, "estimator": {}, "": {}}
    for name, value in {**(fields or {}), **more}.items():
        group, _, rest = name.partition(".")
        if rest and group in sorted_out:
            sorted_out[group][rest] = value
        else:
            sorted_out[""][name] = value
    return Trial(
        scenario=scenario,
        config=with_fields(plugin.Config(), sorted_out[""]),
        seed=seed,
        controller=names["controllers"],
        controller_config=with_fields(
            _plugin("controllers", names["controllers"]).Config(), sorted_out["planner"], "planner"
        ),
        estimator=names["estimators"],
        estimator_config=with_fields(
            _plugin("estimators", names["estimators"]).Config(), sorted_out["estimator"], "estimator"
        ),
        measure=measure,
    )


def keys(trials: Sequence[Trial]) -> list[str]:
    """Return the keys of many trials in the environment of this process; errors as of ``contents``."""
    return [in_environment(content) for content in contents(trials)]


def contents(trials: Sequence[Trial]) -> list[str]:
    """Return the content hashes of many trials without building any of them; each file that they name is read once.

    Raises as the digest of a field does, for example FileNotFoundError for a missing file.
    """
    known: Digests = {}
    return [each._content(run_inputs(*each._configs, known)) for each in trials]


def named_files(trials: Sequence[Trial]) -> dict[tuple[str, str], str]:
    """Return the digest of each file that trials name, by the name of the field and its value; errors as of
    ``contents``.
    """
    known: Digests = {}
    found: dict[tuple[str, str], str] = {}
    for each in trials:
        parts = {"planner": each.controller_config, "estimator": each.estimator_config}
        for name, digest in run_inputs(*each._configs, known).items():
            first, _, rest = name.partition(".")
            found[name, str(leaf(*((parts[first], rest) if first in parts else (each.config, name))))] = digest
    return found


@cache
def _plugin(kind: str, name: str) -> Any:
    """Return a plug-in that another process can find too."""
    plugin = load(kind, name)
    if plugin.__module__ == "__main__":
        raise ArgumentError(f"{kind}: {name!r} is defined in the script that runs; allowed: one in a module")
    return plugin


@cache
def _function(name: str) -> Callable[[Any], Mapping[str, Any]]:
    """Return the function at "package.module:function"."""
    module, _, attribute = name.partition(":")
    try:
        function: Callable[[Any], Mapping[str, Any]] = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise ArgumentError(f"measure = {name!r}: {error}; allowed: package.module:function") from error
    return function
