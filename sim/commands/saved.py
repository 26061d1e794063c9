"""A run's config.json, read back for ``run --from``."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from sim.commands.errors import BadInputError


@dataclass(frozen=True)
class Saved:
    """What is needed to run again."""

    path: Path
    scenario: str
    seed: int
    fields: dict[str, Any]
    controller: str
    controller_fields: dict[str, Any]
    estimator: str
    estimator_fields: dict[str, Any]
    terrain_path: str | None  # as it was given
    terrain_digest: str | None

    @staticmethod
    def read(folder: Path) -> Saved:
        """The configuration of the run in ``folder``."""
        path = folder / "config.json"
        if not path.is_file():
            raise BadInputError(f"--from = {folder}: there is no {path}; allowed: the folder of a run")
        try:
            saved = json.loads(path.read_text(encoding="utf-8"))
            parts = {}
            for kind in ("controller", "estimator"):
                parts[kind] = _of(str, saved[kind]["name"], f"{kind}.name")
                parts[f"{kind}_fields"] = _of(dict, saved[kind]["fields"], f"{kind}.fields")
            return Saved(
                path=path,
                scenario=_of(str, saved["scenario"], "scenario"),
                seed=_of(int, saved["seed"], "seed"),
                fields=_of(dict, saved["fields"], "fields"),
                terrain_path=saved.get("terrain", {}).get("path"),
                terrain_digest=saved.get("terrain", {}).get("digest"),
                **parts,
            )
        except KeyError as error:
            raise BadInputError(f"{path}: {error.args[0]} is missing; allowed: what `mathnavi run` writes") from None
        except (ValueError, TypeError, AttributeError) as error:
            raise BadInputError(f"{path}: not the configuration of a run ({error})") from None

    def restored(self, config: type, fields: dict[str, Any], where: str) -> Any:
        """The frozen dataclass ``config`` with the saved fields."""
        try:
            return _instance(config, fields, where)
        except ValueError as error:
            raise BadInputError(f"{self.path}: {error}") from None


def _of(kind: type | tuple[type, ...], value: Any, where: str) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise ValueError(f"{where} = {value!r}; allowed: {' or '.join(one.__name__ for one in kinds)}")
    return value


def _instance(config: type, fields: dict[str, Any], where: str) -> Any:
    hints = get_type_hints(config)
    names = [field.name for field in dataclasses.fields(config)]
    for name in fields:
        if name not in names:
            raise ValueError(f"{where}.{name} is not a field; allowed: {', '.join(names)}")
    return config(**{name: _value(hints[name], value, f"{where}.{name}") for name, value in fields.items()})


def _value(hint: Any, value: Any, where: str) -> Any:
    """``value`` as JSON has it in the type that the dataclass declares."""
    origin, choices = get_origin(hint), get_args(hint)
    if dataclasses.is_dataclass(hint):
        return _instance(typing.cast(type, hint), _of(dict, value, where), where)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in choices:
            return None
        return _value(next(choice for choice in choices if choice is not type(None)), value, where)
    if origin in (tuple, list):
        items = _of(list, value, where)
        if origin is list or choices[-1] is Ellipsis:
            choices = (choices[0],) * len(items)
        if len(choices) != len(items):
            raise ValueError(f"{where} = {value!r}; allowed: {len(choices)} values")
        return origin(_value(choice, item, where) for choice, item in zip(choices, items, strict=True))
    if origin is typing.Literal:
        if value not in choices:
            raise ValueError(f"{where} = {value!r}; allowed: {', '.join(map(str, choices))}")
        return value
    if hint is bool:
        if not isinstance(value, bool):
            raise ValueError(f"{where} = {value!r}; allowed: true, false")
        return value
    if hint is float:
        return float(_of((int, float), value, where))
    if hint is Path:
        return Path(_of(str, value, where))
    return _of(hint, value, where)
