"""Specification of a recorded run, from its config.json: for ``run --from``, ``estimate`` and ``view``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mathnavi.commands.errors import BadInputError, bad_input, bad_plugin
from mathnavi.interfaces.errors import UntrustedError
from mathnavi.interfaces.fields import plain
from mathnavi.sim.plugin.trust import check_place, recorded_places, within_record
from mathnavi.sim.records.documents import RunDocument
from mathnavi.sim.records.run_folder import CONFIG, read_run_document
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.records.timing import LatencyName


@dataclass(frozen=True)
class RecordedSpec:
    """Specification of a recorded run, and what its folder says of its origin."""

    path: Path
    spec: RunSpec
    inputs: dict[str, str]  # digests of the files that were read, by the names of the fields
    environment: dict[str, str]  # versions and processor; empty where an earlier version did not record all of it
    latency: LatencyName | None  # simulated time that its plans took; None: none
    code: str | None  # version of the code that it ran; None where an earlier version did not record it
    places: dict[str, str]  # "package.module:Class" in any field, with this file, unless the folder is trusted

    @staticmethod
    def read(folder: Path, argv: Sequence[str] = ()) -> RecordedSpec:
        """Read the run in ``folder``; BadInputError if its config.json is missing or broken, or names code that is
        neither installed nor named in ``argv``, unless it is read within ``trusting()``.
        """
        path = folder / CONFIG
        if not path.is_file():
            raise BadInputError(f"--from = {folder}: there is no {path}; allowed: the folder of a run")
        with bad_input():
            document, _ = read_run_document(folder)
        for kind in ("controller", "estimator"):
            if getattr(document, kind) is None:
                raise BadInputError(f"{path}: $.{kind} is missing; allowed: what `mathnavi run` writes")
        recorded = plain(document)
        by_user = {word.partition("=")[2] or word for word in argv}
        try:
            for place in (document.scenario, recorded["controller"]["name"], recorded["estimator"]["name"]):
                if ":" in place and place not in by_user:
                    check_place(place, str(path))
        except UntrustedError as error:
            raise BadInputError(str(error)) from None
        named = recorded_places([recorded[part] for part in ("fields", "controller", "estimator")], str(path))
        places = {place: where for place, where in named.items() if place not in by_user}
        try:
            with bad_plugin(), within_record(places):
                spec = RunSpec.from_document(recorded)
        except BadInputError:
            raise
        except ValueError as error:
            raise BadInputError(f"{path}: {error}") from None
        return RecordedSpec(
            path, spec, _inputs(document), _environment(document), document.latency, document.code, places
        )


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
