"""A run's config.json, read back for ``run --from``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.sim.commands.errors import BadInputError, bad_input
from mathnavi.sim.interfaces.fields import instance
from mathnavi.sim.records.former_names import present_name
from mathnavi.sim.records.run_folder import CONFIG, read_run_document


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
    terrain_path: str | None  # as it was given
    terrain_digest: str | None

    @staticmethod
    def read(folder: Path) -> RunConfig:
        """The configuration of the run in ``folder``; BadInputError if there is none, or it is broken."""
        path = folder / CONFIG
        if not path.is_file():
            raise BadInputError(f"--from = {folder}: there is no {path}; allowed: the folder of a run")
        with bad_input():
            document, _ = read_run_document(folder)
        for kind in ("controller", "estimator"):
            if getattr(document, kind) is None:
                raise BadInputError(f"{path}: $.{kind} is missing; allowed: what `mathnavi run` writes")
        assert document.controller is not None
        assert document.estimator is not None
        return RunConfig(
            path=path,
            scenario=document.scenario,
            seed=document.seed,
            fields=document.fields,
            controller=present_name(document.controller.name),
            controller_fields=document.controller.fields,
            estimator=present_name(document.estimator.name),
            estimator_fields=document.estimator.fields,
            terrain_path=document.terrain.path if document.terrain else None,
            terrain_digest=document.terrain.digest if document.terrain else None,
        )

    def restored(self, config: type, fields: dict[str, Any], where: str) -> Any:
        """The frozen dataclass ``config`` with the recorded fields; BadInputError if they do not fit."""
        try:
            return instance(config, fields, where)
        except ValueError as error:
            raise BadInputError(f"{self.path}: {error}") from None
