"""An MCAP file, read back with the official readers: each number of the log, the scene's motions, the events."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.renders.export.contents import ExportedRun, read_run
from mathnavi.renders.export.mcap_file import writer
from mathnavi.renders.scene.elements import Scene
from mathnavi.sim.records.log_channels import Channel, Field
from mathnavi.sim.records.run_folder import described, read_arrays

reading = pytest.importorskip("mcap.reader", reason="the extra mcap is missing")
protobuf = pytest.importorskip("mcap_protobuf.decoder", reason="the extra mcap is missing")
pytest.importorskip("foxglove_schemas_protobuf", reason="the extra mcap is missing")


class Json:
    """Decoder of messages in JSON."""

    def decoder_for(self, encoding: str, schema: Any) -> Any:
        return json.loads if encoding == "json" else None


class Read:
    """All that a file holds, by topic."""

    def __init__(self, path: Path) -> None:
        self.messages: dict[str, list[tuple[int, Any]]] = defaultdict(list)  # stamp and message
        self.metadata: dict[str, dict[str, str]] = {}
        self.schemas: dict[str, Any] = {}
        with open(path, "rb") as file:
            reader = reading.make_reader(
                file, validate_crcs=True, decoder_factories=[protobuf.DecoderFactory(), Json()]
            )
            for schema, channel, message, value in reader.iter_decoded_messages():
                raw = channel.message_encoding == "json"
                self.messages[channel.topic].append((message.log_time, value))
                self.schemas[channel.topic] = json.loads(schema.data) if raw else schema.name
            for channel in reader.get_summary().channels.values():
                self.metadata[channel.topic] = channel.metadata
            self.attachments = {each.name: each.data for each in reader.iter_attachments()}


def array_of(read: Read, topic: str, name: str) -> Any:
    """An array of the log from the messages of a topic, as its metadata says, with their own times."""
    said = json.loads(read.metadata[topic]["arrays"])[name]
    rows = []
    for _, message in read.messages.get(topic, ()):
        value = message.get(said["field"], np.nan)
        if said["columns"]:
            value = [value.get(column, np.nan) for column in said["columns"]]
        row = np.array(value, dtype=np.float64).astype(said["dtype"])  # null is NaN
        rows.append(row if said["shape"] is None else row.reshape(said["shape"]))
    return np.array([message["t"] for _, message in read.messages.get(topic, ())]), rows


@pytest.fixture(scope="module")
def files(exported: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Read]:
    folder = tmp_path_factory.mktemp("mcap")
    for name, run in exported.items():
        assert main(["export", str(run), "--mcap", str(folder / f"{name}.mcap")]) == 0
    return {name: Read(folder / f"{name}.mcap") for name in exported}


@pytest.mark.parametrize("name", ["flight", "robot", "numbers"])
def test_each_number_of_the_log_is_read_back_as_it_was(
    name: str, exported: dict[str, Path], files: dict[str, Read]
) -> None:
    read, arrays = files[name], read_arrays(exported[name])
    seen = {"t", "estimate.t", "plan.offsets", "plan.adopted"} | {
        each for each, rows in arrays.items() if each == "cramer_rao.deviation" and not rows.size
    }
    for topic, metadata in read.metadata.items():
        for array in json.loads(metadata.get("arrays", "{}")):
            t, rows = array_of(read, topic, array)
            recorded = arrays[array]
            if array.startswith("measurement."):
                kept = ~np.isnan(recorded).all(axis=1)
                np.testing.assert_array_equal(t, arrays["t"][kept])
                recorded = recorded[kept]
            elif array.startswith("plan."):
                np.testing.assert_array_equal(t, arrays["plan.adopted"])
            else:
                np.testing.assert_array_equal(t, arrays["estimate.t" if topic == "/estimate" else "t"])
            offsets = arrays["plan.offsets"] if array in ("plan.t", "plan.x", "plan.u", "plan.phase") else None
            if offsets is not None:
                assert [row.size for row in rows] == (np.diff(offsets) * int(np.prod(recorded.shape[1:]))).tolist()
                rows = list(np.concatenate(rows).reshape(recorded.shape))
            np.testing.assert_array_equal(np.array(rows).reshape(recorded.shape), recorded, err_msg=array)
            seen.add(array)
    assert seen >= arrays.keys()


@pytest.mark.parametrize("name", ["flight", "robot", "numbers"])
def test_stamps_are_the_times_in_whole_nanoseconds_in_order(name: str, files: dict[str, Read]) -> None:
    for topic, messages in files[name].messages.items():
        stamps = [stamp for stamp, _ in messages]
        assert stamps == sorted(stamps), topic
        if isinstance(files[name].schemas[topic], dict):
            assert stamps == [round(message["t"] * 1e9) for _, message in messages], topic


def test_the_schemas_are_foxgloves_and_simple_ones_of_json(files: dict[str, Read]) -> None:
    for read in files.values():
        for topic, schema in read.schemas.items():
            if isinstance(schema, str):
                assert schema in ("foxglove.SceneUpdate", "foxglove.FrameTransforms", "foxglove.Log"), topic
                continue
            assert set(schema["properties"]) >= {key for _, message in read.messages[topic] for key in message}
            for kind in schema["properties"].values():
                assert kind["type"] in ("number", "string", "array", "object")


def test_the_motions_meshes_and_lines_of_the_scene_are_there(exported: dict[str, Path], files: dict[str, Read]) -> None:
    for name in ("flight", "robot"):
        scene, read = read_run(exported[name]).scene, files[name]
        poses: dict[str, list[Any]] = defaultdict(list)
        for _, message in read.messages["/tf"]:
            for each in message.transforms:
                assert each.parent_frame_id == "world"
                poses[each.child_frame_id].append(each)
        assert poses.keys() == scene.motions.keys()
        for motion, found in poses.items():
            own = scene.motions[motion]
            places = [[each.translation.x, each.translation.y, each.translation.z] for each in found]
            np.testing.assert_array_equal(places, own.pos)
            if own.quat is not None:
                turned = [[e.rotation.w, e.rotation.x, e.rotation.y, e.rotation.z] for e in found]
                np.testing.assert_array_equal(turned, own.quat)
        frames = {"world", *scene.motions}
        drawn = {topic: messages for topic, messages in read.messages.items() if topic.startswith("/scene/")}
        for topic, messages in drawn.items():
            for _, message in messages:
                (entity,) = message.entities
                assert entity.frame_id in frames, topic
                (t,) = (float(each.value) for each in entity.metadata)
                assert entity.timestamp.seconds * 10**9 + entity.timestamp.nanos == round(t * 1e9)
        triangles = sum(
            len(mesh.indices) // 3 for messages in drawn.values() for mesh in messages[0][1].entities[0].triangles
        )
        assert triangles >= sum(len(surface.faces) for surface in scene.surfaces)


def test_events_and_texts_go_along(exported: dict[str, Path], files: dict[str, Read]) -> None:
    for name, folder in exported.items():
        events, read = read_run(folder).events, files[name]
        assert [
            (each["t"], each["agent"], each["kind"], each["message"]) for _, each in read.messages.get("/events", ())
        ] == [(e.t, e.agent, e.kind, e.message) for e in events]
        assert [each.message for _, each in read.messages.get("/log", ())] == [
            ": ".join(filter(None, described(event))) for event in events
        ]
        for document in ("config.json", "summary.json", "log.json"):
            assert read.attachments[document] == (folder / document).read_bytes()


def test_infinity_and_nan_are_read_back(tmp_path: Path) -> None:
    t = np.array([0.0, 1.0 / 3.0, 0.7])
    odd = np.array([[np.inf, -np.inf], [np.nan, 0.1 + 0.2], [5e-324, -0.0]])
    fields = (
        Field("x", "truth.x", odd, ("a [m]", "b [m]")),
        Field("u", "command.u", odd),
        Field("c", "cost", odd[:, 0]),
    )
    run = ExportedRun(Scene("odd", 0.7, ()), [Channel("v1", "truth", t, fields)], (), {}, {})
    writer()(tmp_path / "odd.mcap", run)
    read = Read(tmp_path / "odd.mcap")
    for name, rows in (("truth.x", odd), ("command.u", odd), ("cost", odd[:, 0])):
        times, found = array_of(read, "/v1/truth", name)
        np.testing.assert_array_equal(times, t)
        np.testing.assert_array_equal(np.array(found), rows)
        assert np.array_equal(np.signbit(np.array(found)), np.signbit(rows))
    assert read.messages["/v1/truth"][1][1]["x"] == {"b": 0.1 + 0.2}


def test_the_same_run_makes_the_same_file(exported: dict[str, Path], tmp_path: Path) -> None:
    run = read_run(exported["numbers"])
    for name in ("one", "other"):
        writer()(tmp_path / name, run)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
