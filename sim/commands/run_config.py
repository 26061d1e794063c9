"""A run's config.json, read back for ``run --from``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.sim.commands.errors import BadInputError
from mathnavi.sim.interfaces.errors import UntrustedError
from mathnavi.sim.interfaces.fields import flattened, instance, of_type
from mathnavi.sim.plugin.trust import check_place, recorded_places, within_record
from mathnavi.sim.records.former_names import present_name


@dataclass(frozen=True)
class RunConfig:
    """The configuration of a recorded run: what is needed to run it again."""

    path: Path
    scenario: str
    seed: int
    fields: dict[str, Any]
    controller: str
    controller_fields: dict[str, Any]
    estimator: str
    estimator_fields: dict[str, Any]
    inputs: dict[str, str]  # digests of the files that were read, by the names of the fields
    environment: dict[str, str]  # versions and processor; empty where an earlier version did not record all of it
    places: dict[str, str]  # "package.module:Class" in any field, with this file, unless the folder is trusted

    @staticmethod
    def read(folder: Path, argv: Sequence[str] = ()) -> RunConfig:
        """The configuration of the run in ``folder``; BadInputError if there is none, it is broken, or it names code
        that is neither installed nor named in ``argv`` too, unless it is read within ``trusting()``.
        """
        path = folder / "config.json"
        if not path.is_file():
            raise BadInputError(f"--from = {folder}: there is no {path}; allowed: the folder of a run")
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            parts: dict[str, Any] = {"scenario": of_type(str, data["scenario"], "scenario")}
            for kind in ("controller", "estimator"):
                parts[kind] = present_name(of_type(str, data[kind]["name"], f"{kind}.name"))
                parts[f"{kind}_fields"] = of_type(dict, data[kind]["fields"], f"{kind}.fields")
            named = {word.partition("=")[2] or word for word in argv}  # by the user himself
            for part in ("scenario", "controller", "estimator"):
                if ":" in parts[part] and parts[part] not in named:
                    check_place(parts[part], str(path))
            places = recorded_places([data["fields"], data["controller"], data["estimator"]], str(path))
            return RunConfig(
                path=path,
                places={place: where for place, where in places.items() if place not in named},
                seed=of_type(int, data["seed"], "seed"),
                fields=of_type(dict, data["fields"], "fields"),
                inputs=_inputs(data),
                environment=_environment(data),
                **parts,
            )
        except UntrustedError as error:
            raise BadInputError(str(error)) from None
        except KeyError as error:
            raise BadInputError(f"{path}: {error.args[0]} is missing; allowed: what `mathnavi run` writes") from None
        except (ValueError, TypeError, AttributeError) as error:
            raise BadInputError(f"{path}: not the configuration of a run ({error})") from None

    @property
    def named_fields(self) -> dict[str, Any]:
        """Every recorded field, by the name that the command line has for it."""
        return {
            **flattened(self.fields),
            **flattened(self.controller_fields, "planner."),
            **flattened(self.estimator_fields, "estimator."),
        }

    def restored(self, config: type, fields: dict[str, Any], where: str) -> Any:
        """The frozen dataclass ``config`` with the recorded fields; BadInputError if they do not fit."""
        try:
            with within_record(self.places):
                return instance(config, fields, where)
        except ValueError as error:
            raise BadInputError(f"{self.path}: {error}") from None


def _inputs(data: dict[str, Any]) -> dict[str, str]:
    """The recorded digests; an earlier version recorded that of the terrain alone, and elsewhere."""
    if "inputs" in data:
        return {name: of_type(str, digest, f"inputs.{name}") for name, digest in data["inputs"].items()}
    digest = data.get("terrain", {}).get("digest")
    return {} if digest is None else {"terrain": of_type(str, digest, "terrain.digest")}


def _environment(data: dict[str, Any]) -> dict[str, str]:
    if "machine" not in data:
        return {}
    recorded = {**data["versions"], **data["machine"]}
    del recorded["mathnavi"]
    return recorded
