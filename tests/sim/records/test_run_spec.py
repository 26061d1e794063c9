"""A specification of a run says the same as a document, as a hash, as fields by name, and as a closed loop."""

from __future__ import annotations

import json
import pickle
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.errors import ArgumentError, FieldError, PluginError
from mathnavi.sim.plugin.registry import PluginSpec, load, names
from mathnavi.sim.records.run_spec import RunSpec

COIN = "tests.sim.sweep.scenarios:Coin"
NOBODY = "tests.sim.sweep.scenarios:Nobody"
COIN_CONTENT = "9c057d3f7c08bf6c68a055b64f13c055830ca7b18208c4d46043c31397ffcc87"
RADAR = ((1e3, 2e3, 900.0, 4.0),)
SPECS = [(scenario, {}) for scenario in names("scenarios")] + [
    ("safe-flight", {"terrain": "jacksboro", "faults.gust_rms": 1.5, "planner.nodes": 9, "radar": RADAR}),
    ("range-localisation", {"drive": "differential", "friction": 0.15, "sensors": (0.0, 90.0)}),
    ("quadrotor-canyon", {"planner.flight.nodes": 9}),
    (COIN, {"part.share": 0.25, "planner.gain": 3.0, "estimator.gain": 4.0}),
]


@pytest.fixture(params=SPECS, ids=[f"{scenario}-{len(fields)}" for scenario, fields in SPECS])
def spec(request: pytest.FixtureRequest) -> RunSpec:
    scenario, fields = request.param
    return RunSpec.of(scenario, 3, fields=fields)


def test_a_document_is_read_back_as_the_same_run(spec: RunSpec) -> None:
    document = json.loads(json.dumps(spec.document))
    again = RunSpec.from_document(document)
    assert again == spec
    assert again.content() == spec.content()
    assert RunSpec.from_document({**document, "fields": document.pop("config")}) == spec  # as in config.json


def test_its_fields_by_name_make_the_same_run(spec: RunSpec) -> None:
    default = RunSpec.of(spec.scenario)
    changed = {name: value for name, value in spec.fields.items() if value != default.fields[name]}
    assert RunSpec.of(spec.scenario, 3, fields=changed) == spec == default.with_seed(3).with_fields(changed)
    assert all(spec[name] == spec.with_fields({name: value})[name] for name, value in changed.items())


def test_a_copy_in_another_process_has_the_same_content(spec: RunSpec) -> None:
    copy = pickle.loads(pickle.dumps(spec))
    assert copy == spec
    assert copy.content() == spec.content()


def test_the_content_is_the_one_of_the_stores_that_are_there() -> None:
    """The hash that version 0.1.0 made of this trial, but for the version of its code."""
    coin = RunSpec.of(COIN, 3, fields={"bias": 0.25, "planner.gain": 3.0})
    assert coin.content(code="code", measure="m:f") == COIN_CONTENT


def test_every_part_of_a_run_counts() -> None:
    base = RunSpec.of(COIN)
    others = [
        base.with_seed(1),
        *(base.with_fields({name: 0.25}) for name in ("bias", "part.share", "planner.gain", "estimator.gain")),
        RunSpec.of(COIN, estimator="tests.sim.sweep.scenarios:Somebody"),
    ]
    assert len({each.content() for each in [base, *others]} | {base.content(measure="f"), base.content(code="x")}) == 9


def test_a_file_counts_by_its_content(tmp_path: Path) -> None:
    (tmp_path / "one").write_text("1")
    shutil.copy(tmp_path / "one", tmp_path / "two")
    one, two = (RunSpec.of(COIN, fields={"table": str(tmp_path / name)}) for name in ("one", "two"))
    assert one.content() == two.content()
    assert list(one.inputs()) == ["table"]
    (tmp_path / "two").write_text("2")
    assert one.content() != two.content()


def test_plugins_are_given_by_name_by_class_or_with_their_fields() -> None:
    flight = load("controllers", "flight")
    by_name = RunSpec.of("safe-flight", controller="flight", fields={"planner.nodes": 9})
    assert by_name == RunSpec.of("safe-flight", controller=flight, fields={"planner": {"nodes": 9}})
    assert by_name == RunSpec.of("safe-flight", controller=PluginSpec.with_fields(flight, nodes=9))
    assert by_name.parameters()["controller"]["name"] == "flight"
    place = f"{flight.__module__}:{flight.__qualname__}"
    assert RunSpec.of("safe-flight", controller=place, fields={"planner.nodes": 9}) == by_name


def test_nested_fields_keep_the_defaults_of_their_group() -> None:
    noise = RunSpec.of("safe-flight", fields={"noise": {"position": np.float64(3.0)}}).config.noise
    assert noise.position == 3.0
    assert noise == RunSpec.of("safe-flight", fields={"noise.position": 3}).config.noise


@pytest.mark.parametrize(
    ("asked", "kind", "message"),
    [
        ({"scenario": "hover"}, PluginError, "'hover' is not known"),
        ({"controller": "autopilot"}, PluginError, "'autopilot' is not known"),
        ({"fields": {"colour": 1}}, FieldError, "^colour is not a field"),
        ({"fields": {"part.colour": 1}}, FieldError, "^part.colour is not a field; allowed: share, count"),
        ({"fields": {"bias.colour": 1}}, FieldError, "^bias has no fields"),
        ({"fields": {"planner.colour": 1}}, FieldError, "^planner.colour is not a field; allowed: gain"),
        ({"fields": {"estimator.gain": "high"}}, FieldError, "^estimator.gain = 'high'; allowed: float"),
        ({"fields": {"part.count": 1.5}}, FieldError, "^part.count = 1.5; allowed: int"),
        ({"fields": {"part.share": 1.5}}, ValueError, "^part.share = 1.5; allowed: 0 to 1"),
        *(
            ({"seed": seed}, FieldError, f"^seed = {seed!r}; allowed: a whole number from 0 to {LARGEST_SEED}")
            for seed in (-1, LARGEST_SEED + 1, 1.0, True, "1", None)
        ),
    ],
)
def test_what_no_run_can_be_is_refused(asked: dict[str, Any], kind: type[ValueError], message: str) -> None:
    with pytest.raises(kind, match=message):
        RunSpec.of(**{"scenario": COIN, **asked})


def test_a_document_that_does_not_fit_is_refused_with_the_place() -> None:
    document = RunSpec.of(COIN).document
    broken = {**document, "controller": {"name": NOBODY, "fields": {"gain": "high"}}}
    with pytest.raises(FieldError, match=r"^\$\.controller\.fields\.gain = 'high'; allowed: float"):
        RunSpec.from_document(broken)
    with pytest.raises(FieldError, match=r"^\$\.config\.colour is not a field"):
        RunSpec.from_document({**document, "config": {"colour": 1}})


def test_other_plugins_have_their_defaults_and_the_same_ones_keep_their_fields() -> None:
    somebody = "tests.sim.sweep.scenarios:Somebody"
    spec = RunSpec.of(COIN, 3, fields={"bias": 0.25, "planner.gain": 3.0, "estimator.gain": 4.0})
    changed = spec.with_plugins(controller=somebody, estimator=NOBODY)
    assert (changed["bias"], changed["planner.gain"], changed["estimator.gain"]) == (0.25, 1.0, 4.0)
    assert changed.parameters()["controller"]["name"] == somebody


def test_the_type_of_a_field_is_the_declared_one() -> None:
    spec = RunSpec.of(COIN)
    assert (spec.type_of("bias"), spec.type_of("part.count"), spec.type_of("planner.gain")) == (float, int, float)
    with pytest.raises((KeyError, AttributeError)):
        spec.type_of("planner.colour")


def test_a_seed_may_be_one_of_numpy() -> None:
    assert type(RunSpec.of(COIN, np.int64(3)).seed) is int


def test_a_plugin_that_no_other_process_finds_has_no_content() -> None:
    class Local(load("estimators", NOBODY)):
        pass

    spec = RunSpec.of(COIN, estimator=Local)
    with pytest.raises(ArgumentError, match=r"estimators: .*Local' is defined .* in a function; allowed: one in a"):
        spec.content()
