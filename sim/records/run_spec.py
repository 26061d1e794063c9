"""Specification of a run: a scenario, a controller and an estimator with all their fields, and a seed.

    spec = RunSpec.of("safe-flight", seed=3, fields={"terrain": "jacksboro", "planner.nodes": 13})
    spec["faults.gust_rms"], spec.with_fields({"faults.gust_rms": 1.5}), spec.build().run()

Whatever flies a scenario does so by a specification: the command line, scripts, sweeps, searches, environments and
studies. Fields are named as in ``mathnavi.sim.records.field_names``. In the hash of the content the digest of a file
replaces the field that names the file (``mathnavi.interfaces.input_files``).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import getitem
from typing import Any

import numpy as np

from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.errors import ArgumentError, FieldError, PluginError
from mathnavi.interfaces.fields import flattened, instance, leaf, leaf_type, plain, with_fields
from mathnavi.interfaces.input_files import Digests, declared_inputs, input_digests, named_plugins
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.plugin.groups import KINDS
from mathnavi.sim.plugin.registry import PluginSpec, called, load, of_stranger
from mathnavi.sim.records.field_names import PARTS, joined, split
from mathnavi.sim.records.store import canonical_json

Plugin = PluginSpec | str | type[Any] | None
"""plug-in with its fields, or its name or its class; None for the one that is there already"""


@dataclass(frozen=True)
class RunSpec:
    """Specification of a run, from which any process can repeat it."""

    scenario: str  # name, or "package.module:Class"
    config: Any  # frozen dataclass of the scenario
    controller: PluginSpec
    estimator: PluginSpec
    seed: int = 0

    def __post_init__(self) -> None:
        seed: Any = self.seed.item() if isinstance(self.seed, np.integer) else self.seed
        if type(seed) is not int or not 0 <= seed <= LARGEST_SEED:
            raise FieldError(f"seed = {self.seed!r}; allowed: a whole number from 0 to {LARGEST_SEED}")
        object.__setattr__(self, "seed", seed)

    @staticmethod
    def of(
        scenario: str,
        seed: int = 0,
        controller: Plugin = None,
        estimator: Plugin = None,
        fields: Mapping[str, Any] | None = None,
    ) -> RunSpec:
        """Return the specification of a run with some fields set, nested ones as mappings or by dotted names.

        Plug-ins are given by name, class or ``PluginSpec``; they are the scenario's own if not given. Raises
        PluginError for an unknown scenario or plug-in, FieldError as ``with_fields``.
        """
        plugin = load("scenarios", scenario)
        parts = {
            "controller": _part("controllers", plugin.controller if controller is None else controller),
            "estimator": _part("estimators", plugin.estimator if estimator is None else estimator),
        }
        return RunSpec(scenario, plugin.Config(), **parts, seed=seed).with_fields(fields or {})

    @staticmethod
    def from_document(document: Mapping[str, Any], where: str = "$") -> RunSpec:
        """Return the specification that a config.json holds, or the row of a store: scenario, seed and parameters.

        Messages name places in the document from ``where`` on. Raises PluginError for an unknown scenario or plug-in,
        FieldError for a field that does not fit.
        """

        def part(name: str) -> PluginSpec:
            plugin = load(KINDS[name], document[name]["name"])
            return PluginSpec(plugin, instance(plugin.Config, document[name]["fields"], f"{where}.{name}.fields"))

        scenario = load("scenarios", document["scenario"])
        key = "fields" if "fields" in document else "config"
        config = instance(scenario.Config, document[key], f"{where}.{key}")
        return RunSpec(document["scenario"], config, part("controller"), part("estimator"), document["seed"])

    @cached_property
    def scenario_class(self) -> Any:
        """Class of the scenario."""
        return load("scenarios", self.scenario)

    @property
    def parts(self) -> dict[str, Any]:
        """Configurations of scenario, controller and estimator by the prefixes of their fields."""
        return {"": self.config, "planner": self.controller.config, "estimator": self.estimator.config}

    @property
    def fields(self) -> dict[str, Any]:
        """Every field by its name, as plain data."""
        return {
            joined(prefix, name): value
            for prefix, config in self.parts.items()
            for name, value in flattened(plain(config)).items()
        }

    def __getitem__(self, name: str) -> Any:
        """Value of a field; AttributeError for an unknown name."""
        prefix, own = split(name)
        return leaf(self.parts[prefix], own)

    def type_of(self, name: str) -> Any:
        """Return the declared type of a field, as ``leaf_type``; KeyError or AttributeError if none exists."""
        prefix, own = split(name)
        return leaf_type(self.parts[prefix], own)

    def with_fields(self, fields: Mapping[str, Any]) -> RunSpec:
        """Return the specification with some fields set, nested ones as mappings or by dotted names.

        Raises FieldError for a field that is not known, a value of another type or out of its range; ValueError as the
        configuration of a third-party plug-in does.
        """
        own: dict[str, dict[str, Any]] = {prefix: {} for prefix in PARTS}
        for name, value in flattened(fields).items():
            prefix, rest = split(name)
            own[prefix][rest] = value
        made = {
            prefix: with_fields(config, own[prefix], prefix) if own[prefix] else config
            for prefix, config in self.parts.items()
        }
        return replace(
            self,
            config=made[""],
            controller=replace(self.controller, config=made["planner"]),
            estimator=replace(self.estimator, config=made["estimator"]),
        )

    def with_plugins(self, controller: Plugin = None, estimator: Plugin = None) -> RunSpec:
        """Return the specification with other plug-ins; those that it has already keep their fields."""
        changed: dict[str, Any] = {}
        for part, given in (("controller", controller), ("estimator", estimator)):
            if given is not None:
                made, present = _part(KINDS[part], given), getattr(self, part)
                changed[part] = present if made.plugin is present.plugin and not isinstance(given, PluginSpec) else made
        return replace(self, **changed)

    def with_seed(self, seed: int) -> RunSpec:
        """Return the specification of the same run with another seed."""
        return replace(self, seed=seed)

    def inputs(self, known: Digests | None = None) -> dict[str, str]:
        """Return the digests of the files that fields name, by the fields' names; as ``input_digests``."""
        found: dict[str, str] = {}
        for prefix, config in self.parts.items():
            found |= input_digests(config, f"{prefix}." if prefix else "", known)
        return found

    def parameters(self, inputs: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Return all but scenario and seed as a store has it, with the digests ``inputs`` of the files if known."""
        return {
            "config": plain(self.config),
            **{
                part: {"name": called(kind, spec.name), "fields": plain(spec.config)}
                for (part, kind), spec in zip(KINDS.items(), (self.controller, self.estimator), strict=True)
            },
            "inputs": dict(self.inputs() if inputs is None else inputs),
        }

    @property
    def document(self) -> dict[str, Any]:
        """All of it as plain data, from which ``from_document`` makes it again."""
        return {"scenario": self.scenario, "seed": self.seed, **self.parameters()}

    @property
    def plugins(self) -> list[Any]:
        """Controller and estimator, and the plug-ins that fields name."""
        named = (plugin for config in self.parts.values() for plugin in named_plugins(config))
        return [self.controller.plugin, self.estimator.plugin, *named]

    def code(self, *more: Any) -> str:
        """Return the version of the code that it runs, and of ``more`` functions.

        Raises ArgumentError for a plug-in that no other process would find.
        """
        plugins = self.scenario_class, self.controller.plugin, self.estimator.plugin
        for kind, plugin in zip(("scenarios", *KINDS.values()), plugins, strict=True):
            if plugin.__module__ == "__main__" or "<locals>" in plugin.__qualname__:
                name = f"{plugin.__module__}:{plugin.__qualname__}"
                raise ArgumentError(
                    f"{kind}: {name!r} is defined in the script that runs, or in a function; allowed: one in a module"
                )
        return code_version(self.scenario_class, *self.plugins, *more)

    def content(self, known: Digests | None = None, code: str | None = None, **more: Any) -> str:
        """Return the hash of scenario, parameters, ``more`` parameters, seed and code, in hexadecimal.

        Digests that are ``known`` are not made again; ``code`` is that of this specification if not given. TypeError
        for a field that cannot be stored, and errors as of ``input_digests`` and ``code``.
        """
        parameters = self.parameters(self.inputs(known)) | more
        for prefix, config in self.parts.items():
            fields = parameters[PARTS[prefix]] if not prefix else parameters[PARTS[prefix]]["fields"]
            for name in declared_inputs(config):  # the content of a file counts, not its place
                *above, last = name.split(".")
                del reduce(getitem, above, fields)[last]
        content = [self.scenario, parameters, self.seed, self.code() if code is None else code]
        return hashlib.sha256(canonical_json(content).encode()).hexdigest()

    def build(self) -> Any:
        """Build the closed loop (``mathnavi.sim.scenarios.closed_loop.ClosedLoop``); raises the scenario's errors.

        Raises PluginError if a third-party scenario fails to build it, or builds something else.
        """
        with self.failures("build()"):
            closed_loop = self.scenario_class.build(self.config, self.seed, self.controller, self.estimator)
        if not callable(getattr(closed_loop, "run", None)):
            made = type(closed_loop).__name__
            raise PluginError(f"scenarios: {self.scenario!r}: build() returned a {made}; allowed: a ClosedLoop")
        return closed_loop

    @contextmanager
    def failures(self, what: str) -> Iterator[None]:
        """Raise a PluginError that names the scenario for what a third-party scenario raises within the block."""
        with of_stranger(self.scenario_class, f"scenarios: {self.scenario!r}: {what} failed:"):
            yield


def _part(kind: str, given: PluginSpec | str | type[Any]) -> PluginSpec:
    if isinstance(given, PluginSpec):
        return given
    return PluginSpec.with_fields(load(kind, given) if isinstance(given, str) else given)
