"""Arguments of a script: a scenario, its plug-ins, and fields by mappings or by dotted names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError, PluginError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.fields import configured, flat
from mathnavi.sim.plugin.registry import PluginSpec, load, names
from mathnavi.sim.records.run_spec import Plugin, RunSpec

KINDS = ("controllers", "estimators", "consensus")  # of plug-ins with fields


def plugin(name: str | type[Any], **fields: Any) -> PluginSpec:
    """Return a controller, an estimator or a consensus protocol with some of its fields set.

    ``name`` is that of an installed plug-in ("flight", "range_ekf"), "package.module:Class", or the class itself.
    Nested fields are mappings, or dotted names: ``plugin("quadrotor", flight={"nodes": 9})``.

    Raises PluginError for an unknown name, FieldError for a field or a value that is not allowed.
    """
    found = _loaded(name) if isinstance(name, str) else name
    if not hasattr(found, "Config"):
        raise PluginError(f"{found!r} declares no frozen dataclass named Config, so it is not a plug-in")
    return PluginSpec(found, configured(found.Config(), fields))


def _loaded(name: str) -> Any:
    if ":" in name:
        refused = []
        for kind in KINDS:
            try:
                return load(kind, name)
            except PluginError as error:
                refused.append(error)
        raise refused[0]
    for kind in KINDS:
        if name in names(kind):
            return load(kind, name)
    known = sorted(each for kind in KINDS for each in names(kind))
    raise PluginError(f"plugin: {name!r} is not known; {allowed_for(name, known, 'or package.module:Class')}")


def specified(scenario: str, seed: int, controller: Plugin, estimator: Plugin, fields: Mapping[str, Any]) -> RunSpec:
    """Return the specification that a script's arguments make; PluginError and FieldError as ``RunSpec.of``."""
    with raising(FieldError):
        return RunSpec.of(scenario, seed, controller, estimator, flat(fields))
