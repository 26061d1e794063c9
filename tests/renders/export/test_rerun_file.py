"""A recording of Rerun, read back with its own reader: each number of the log, motions, lines and events."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.renders.export.contents import moments_of, read_run

rerun = pytest.importorskip("rerun", reason="the extra rerun is missing")
chunks = pytest.importorskip("rerun.chunk", reason="the extra rerun is missing")

Rows = list[tuple[int | None, Any]]  # time [ns], None for what has none, and value
Read = dict[tuple[str, str], Rows]  # by entity and component


def read(path: Path) -> Read:
    """All values by entity and component, in order of time."""
    found: Read = defaultdict(list)
    for chunk in chunks.RrdReader(str(path)).stream().to_chunks():
        batch = chunk.to_record_batch()
        times = [None] * batch.num_rows
        if "t" in batch.schema.names:
            times = batch.column("t").cast("int64").to_pylist()
        for name in batch.schema.names:
            if ":" in name:
                column = batch.column(name).to_pylist()
                found[chunk.entity_path, name.partition(":")[2]] += zip(times, column, strict=True)
    for rows in found.values():
        rows.sort(key=lambda row: -1 if row[0] is None else row[0])
    return found


@pytest.fixture(scope="module")
def files(exported: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Read]:
    folder = tmp_path_factory.mktemp("rerun")
    for name, run in exported.items():
        assert main(["export", str(run), "--rerun", str(folder / f"{name}.rrd")]) == 0
    return {name: read(folder / f"{name}.rrd") for name in exported}


@pytest.mark.parametrize("name", ["flight", "robot", "numbers"])
def test_each_number_of_the_log_is_read_back_as_it_was(
    name: str, exported: dict[str, Path], files: dict[str, Read]
) -> None:
    found = files[name]
    for channel in read_run(exported[name]).channels:
        stamps = np.round(channel.t * 1e9).astype(np.int64).tolist()
        for field in channel.fields if len(channel.t) else ():
            parts = [[field.name, column] for column in field.columns] or [[field.name]]
            series = []
            for part in parts:
                rows = found[rerun.new_entity_path([*channel.path, *part]), "scalars"]
                assert [stamp for stamp, _ in rows] == stamps
                series.append([value for _, value in rows])
            for k, recorded in enumerate(field.rows):
                row = [number for values in series for number in values[k]]
                np.testing.assert_array_equal(row, np.ravel(recorded).astype(np.float64))


def test_motions_lines_and_events_are_there(exported: dict[str, Path], files: dict[str, Read]) -> None:
    for name, folder in exported.items():
        run, found = read_run(folder), files[name]
        for motion, own in run.scene.motions.items():
            rows = found[rerun.new_entity_path(["world", motion]), "translation"]
            np.testing.assert_array_equal([value[0] for _, value in rows], own.pos.astype(np.float32))
        strips = [rows for (_, component), rows in found.items() if component == "strips"]
        assert len(strips) == len(run.scene.lines)
        moments = sorted(len(list(moments_of(lines, run.scene.duration))) for lines in run.scene.lines)
        assert sorted(map(len, strips)) == moments
        texts = [
            row for (entity, kind), rows in found.items() if (entity[:8], kind) == ("/events/", "text") for row in rows
        ]
        assert sorted(stamp for stamp, _ in texts) == [round(event.t * 1e9) for event in run.events]
        meshes = [rows for (_, component), rows in found.items() if component == "triangle_indices"]
        assert len(meshes) == len(run.scene.surfaces) + 2 * (run.scene.ground is not None)
