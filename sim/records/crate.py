"""The records of a sweep or a study as an RO-Crate: tables, what was asked, and which software answered.

The crate follows RO-Crate 1.1 and the profile Process Run Crate 0.5 (https://w3id.org/ro/wfrun/process/0.5). Each group
of records that one version of the code has made of one scenario, or of one function, is a ``CreateAction``: its
``instrument`` is that version of mathnavi, its ``object`` the configuration, its ``result`` the tables. A study whose
files stand beside the store is an action too, from the tables to its own files.

    ro-crate-metadata.json                           the provenance
    trials.csv, trials.jsonl, trials.parquet         one line a trial; all fields and figures
    jobs.csv, jobs.parquet                           one line another computation; its arrays stay in the store
    configuration/K-NAME.json                        of a group: fields that all have, those that vary, seeds
    studies/NAME.json, .csv, .png, .html             of a study
"""

from __future__ import annotations

import hashlib
import mimetypes
import os
import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mathnavi.sim.interfaces.reading.files import MOST_LINES, parsed, read_bytes, read_document
from mathnavi.sim.interfaces.writing import write_text
from mathnavi.sim.records.documents import StudyRecord
from mathnavi.sim.records.extras import extra
from mathnavi.sim.records.files import write_json
from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.parquet import write_parquet
from mathnavi.sim.records.store import STUDY_STORE, Record, Store, as_csv, canonical_json

PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
CONTEXT = "https://w3id.org/ro/terms/workflow-run/context"
LICENCES = "https://spdx.org/licenses/"
STUDY_FILES = (".json", ".csv", ".png", ".html")
MEDIA_TYPES = {".jsonl": "application/jsonl", ".parquet": "application/vnd.apache.parquet"}


@dataclass(frozen=True)
class _Group:
    """The records that one version of the code has made of one scenario or function."""

    name: str
    code: str
    configuration: Mapping[str, Any]
    endings: Counter[str]
    tables: tuple[str, ...]

    @property
    def outcome(self) -> str:
        """Numbers of records by how they ended, in words."""
        return ", ".join(f"{count} {ending}" for ending, count in sorted(self.endings.items()))


def write_crate(store: Store, folder: Path, *, licence: str = "", parquet: bool = False) -> None:
    """Write a store as an RO-Crate into a new folder, whole or not at all.

    ``licence``: of the records, an SPDX identifier or the address of a text. ``parquet``: each table as Parquet too.
    Raises FieldError where rocrate or pyarrow is not installed, OSError where the folder is there or cannot be made.
    """
    rocrate = extra("rocrate.rocrate", "--crate")
    if parquet:
        extra("pyarrow", "--parquet")
    scratch = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        groups = _write_tables(store, scratch, parquet)
        studies = _copy_studies(store.path, scratch)
        crate = _crate(rocrate.ROCrate(version="1.1"), store, scratch, groups, studies, licence)
        crate.metadata.write(scratch)
        os.chmod(scratch, 0o755)
        os.rename(scratch, folder)  # onto nothing, or an empty folder
    except BaseException:
        shutil.rmtree(scratch, ignore_errors=True)
        raise


# ---- files


def _write_tables(store: Store, folder: Path, parquet: bool) -> list[_Group]:
    records, jobs = store.records(), store.jobs(sorted(store.job_endings()))
    write_text(folder / "trials.csv", as_csv(store.rows()))
    store.export_jsonl(folder / "trials.jsonl")
    if parquet:
        write_parquet(folder / "trials.parquet", store.rows())
    if jobs:
        rows = [_job_row(job) for job in jobs]
        write_text(folder / "jobs.csv", as_csv(rows))
        if parquet:
            write_parquet(folder / "jobs.parquet", rows)
    groups = [*_groups_of_trials(records, parquet), *_groups_of_jobs(jobs, parquet)]
    (folder / "configuration").mkdir()
    for k, group in enumerate(groups, 1):
        write_json(folder / _configuration_file(k, group), group.configuration)
    write_json(folder / "environments.json", store.environments())
    return groups


def _configuration_file(number: int, group: _Group) -> str:
    return f"configuration/{number}-{re.sub(r'[^A-Za-z0-9_-]+', '.', group.name)}.json"


def _groups_of_trials(records: Sequence[Record], parquet: bool) -> Iterator[_Group]:
    tables = ("trials.csv", "trials.jsonl", *["trials.parquet"] * parquet)
    for name, code in dict.fromkeys((record.scenario, record.code) for record in records):
        members = [record for record in records if (record.scenario, record.code) == (name, code)]
        values: dict[str, dict[str, Any]] = {}
        for record in members:
            for field, value in record.fields.items():
                values.setdefault(field, {})[canonical_json(value)] = value
        configuration = {
            "scenario": name,
            "code": code,
            "seeds": sorted({record.seed for record in members}),
            "fields": {field: next(iter(found.values())) for field, found in values.items() if len(found) == 1},
            "varied": sorted(field for field, found in values.items() if len(found) > 1),
            "files": _digests(members),
        }
        endings = Counter(_ending(record) for record in members)
        yield _Group(name, code, configuration, endings, tables)


def _ending(record: Record) -> str:
    if record.status != "ok":
        return record.status
    return "did what they should" if record.success else "did not"


def _digests(records: Sequence[Record]) -> dict[str, list[str]]:
    """The digests of the files that each field named."""
    found: dict[str, set[str]] = {}
    for record in records:
        for field, digest in record.parameters.get("inputs", {}).items():
            found.setdefault(field, set()).add(str(digest))
    return {field: sorted(digests) for field, digests in found.items()}


def _groups_of_jobs(jobs: Sequence[JobRecord], parquet: bool) -> Iterator[_Group]:
    tables = ("jobs.csv", *["jobs.parquet"] * parquet)
    for name, code in dict.fromkeys((job.function, job.code) for job in jobs):
        members = [job for job in jobs if (job.function, job.code) == (name, code)]
        configuration = {
            "function": name,
            "code": code,
            "seeds": sorted({job.seed for job in members}),
            "arguments": [parsed(job.arguments, f"job {job.key}", ValueError) for job in members],
        }
        yield _Group(name, code, configuration, Counter(job.status for job in members), tables)


def _job_row(job: JobRecord) -> dict[str, Any]:
    names = ("key", "function", "arguments", "seed", "code", "status", "result", "error")
    return {name: getattr(job, name) for name in names} | {f"timings.{k}": value for k, value in job.timings.items()}


def _copy_studies(store: Path, folder: Path) -> dict[str, dict[str, Any]]:
    """Copy the files of the studies that a store belongs to; their documents by name."""
    studies = {}
    for path in sorted(store.parent.glob("*.json")) if store.name == STUDY_STORE else ():
        try:
            record, document = read_document(path, StudyRecord, ValueError)
        except (OSError, ValueError):
            continue  # another program's
        if record.study == path.stem:
            (folder / "studies").mkdir(exist_ok=True)
            for file in (path.with_suffix(ending) for ending in STUDY_FILES):
                if file.is_file():
                    shutil.copyfile(file, folder / "studies" / file.name)
            studies[path.stem] = document
    return studies


# ---- metadata


def _crate(
    crate: Any,
    store: Store,
    folder: Path,
    groups: Sequence[_Group],
    studies: Mapping[str, Mapping[str, Any]],
    licence: str,
) -> Any:
    """The crate of what has been written into a folder."""
    changed = datetime.fromtimestamp(store.path.stat().st_mtime, UTC).replace(microsecond=0)
    trials, jobs = len(store.keys()), len(store.job_endings())
    names = dict.fromkeys([*studies, *(group.name for group in groups)])
    crate.name = f"Records of mathnavi: {', '.join(names) or 'none'}"
    crate.description = (
        f"{trials} trials and {jobs} other computations of the testbed mathnavi, as its store {store.path.name} has "
        "them"
    )
    crate.datePublished = changed
    crate.metadata.extra_contexts.append(CONTEXT)
    profile = _add(crate, PROFILE, "CreativeWork", name="Process Run Crate", version="0.5")
    crate.root_dataset["conformsTo"] = profile
    crate.license = _licence(crate, licence)
    files = {path: _add_file(crate, folder, path) for path in _written(folder)}
    software = {code: _software(crate, code) for code in dict.fromkeys(group.code for group in groups)}
    actions = []
    for k, group in enumerate(groups, 1):
        actions.append(
            _action(
                crate,
                f"#action-{k}",
                f"{sum(group.endings.values())} runs of {group.name}",
                group.outcome,
                [software[group.code]],
                [files[_configuration_file(k, group)]],
                [files[table] for table in group.tables],
                changed,
            )
        )
    tables = [files[path] for path in dict.fromkeys(table for group in groups for table in group.tables)]
    for name, document in studies.items():
        results = [file for path, file in files.items() if path in {f"studies/{name}{end}" for end in STUDY_FILES}]
        made = _action(
            crate, f"#study-{name}", str(document.get("title") or name), str(document.get("command", "")),
            [*software.values()], tables, results, changed,
        )  # fmt: skip
        actions.append(made)
    crate.root_dataset["mentions"] = _references(actions)
    return crate


def _written(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def _add(crate: Any, identifier: str, kind: str, **properties: Any) -> Any:
    from rocrate.model.contextentity import ContextEntity

    return crate.add(ContextEntity(crate, identifier, properties={"@type": kind, **properties}))


def _add_file(crate: Any, folder: Path, path: str) -> Any:
    content = read_bytes(folder / path, ValueError, MOST_LINES)
    properties = {
        "name": path,
        "encodingFormat": MEDIA_TYPES.get(Path(path).suffix) or mimetypes.guess_type(path)[0],
        "contentSize": str(len(content)),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
    return crate.add_file(folder / path, path, properties=properties)


def _licence(crate: Any, licence: str) -> Any:
    """The entity of the licence of the records; it says so where none is stated."""
    if not licence:
        return _add(crate, "#licence", "CreativeWork", name="not stated", description="Ask who has made the records.")
    address = licence if "://" in licence else f"{LICENCES}{licence}"
    return _add(crate, address, "CreativeWork", name=licence)


def _software(crate: Any, code: str) -> Any:
    return _add(
        crate, f"#mathnavi-{code}", "SoftwareApplication", name="mathnavi", version=code, softwareVersion=code,
        description="A MuJoCo testbed for planners and observers; the version ends in the digest of its sources",
    )  # fmt: skip


def _action(
    crate: Any,
    identifier: str,
    name: str,
    description: str,
    instruments: Sequence[Any],
    objects: Sequence[Any],
    results: Sequence[Any],
    ended: datetime,
) -> Any:
    """A CreateAction: instruments make results of objects; ``ended`` is when the store was last written."""
    return _add(
        crate, identifier, "CreateAction", name=name, description=description, instrument=_references(instruments),
        object=_references(objects), result=_references(results), endTime=ended.isoformat(),
        actionStatus={"@id": "http://schema.org/CompletedActionStatus"},
    )  # fmt: skip


def _references(entities: Sequence[Any]) -> Any:
    """References to entities; RO-Crate asks for a single one without a list."""
    found = [{"@id": entity.id} for entity in entities]
    return found[0] if len(found) == 1 else found
