"""Reader of a run's config.json for ``run --from``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.interfaces.errors import UntrustedError
from mathnavi.interfaces.fields import flattened, instance
from mathnavi.sim.plugin.trust import check_place, recorded_places, within_record
from mathnavi.sim.records.documents import RunDocument
from mathnavi.sim.records.run_folder import CONFIG, read_run_document


@dataclass(frozen=True)
class RunConfig:
    """Configuration of a recorded run: all that is needed to run it again."""

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
        """Read the configuration of the run in ``folder``; BadInputError if it is missing or broken, or names code that
        is neither installed nor named in ``argv``, unless it is read within ``trusting()``.
        """
        path = folder / CONFIG
        if not path.is_file():
            raise BadInputError(f"--from = {folder}: there is no {path}; allowed: the folder of a run")
        with bad_input():
            document, plain = read_run_document(folder)
        for kind in ("controller", "estimator"):
            if getattr(document, kind) is None:
                raise BadInputError(f"{path}: $.{kind} is missing; allowed: what `mathnavi run` writes")
        assert document.controller is not None
        assert document.estimator is not None
        controller, estimator = document.controller.name, document.estimator.name
        by_user = {word.partition("=")[2] or word for word in argv}
        try:
            for place in (document.scenario, controller, estimator):
                if ":" in place and place not in by_user:
                    check_place(place, str(path))
            places = recorded_places([document.fields, plain["controller"], plain["estimator"]], str(path))
        except UntrustedError as error:
            raise BadInputError(str(error)) from None
        return RunConfig(
            path=path,
            scenario=document.scenario,
            seed=document.seed,
            fields=document.fields,
            controller=controller,
            controller_fields=document.controller.fields,
            estimator=estimator,
            estimator_fields=document.estimator.fields,
            inputs=_inputs(document),
            environment=_environment(document),
            places={place: where for place, where in places.items() if place not in by_user},
        )

    @property
    def named_fields(self) -> dict[str, Any]:
        """Return every recorded field by its name on the command line."""
        return {
            **flattened(self.fields),
            **flattened(self.controller_fields, "planner."),
            **flattened(self.estimator_fields, "estimator."),
        }

    def restored(self, config: type, fields: dict[str, Any], where: str) -> Any:
        """Return the frozen dataclass ``config`` with the recorded fields; BadInputError if they do not fit."""
        try:
            with within_record(self.places):
                return instance(config, fields, where)
        except ValueError as error:
            raise BadInputError(f"{self.path}: {error}") from None


def _inputs(document: RunDocument) -> dict[str, str]:
    """Return the recorded digests; an earlier version recorded only that of the terrain, under another key."""
    if document.inputs is not None:
        return document.inputs
    digest = document.terrain.digest if document.terrain else None
    return {} if digest is None else {"terrain": digest}


def _environment(document: RunDocument) -> dict[str, str]:
    if document.machine is None:
        return {}
    return {name: value for name, value in (document.versions | document.machine).items() if name != "mathnavi"}
