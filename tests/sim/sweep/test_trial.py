"""The key of a trial is determined by its content."""

from __future__ import annotations

import dataclasses
import json
import math
import pickle
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.sweep.trial import Trial, keys, trial
from tests.sim.sweep.scenarios import DIGESTED, Coin, CoinConfig

COIN = "tests.sim.sweep.scenarios:Coin"
NOBODY = "tests.sim.sweep.scenarios:Nobody"


def test_the_same_content_has_the_same_key() -> None:
    one, other = trial(COIN, 3, bias=0.25), trial(COIN, 3, controller=NOBODY, fields={"bias": 0.25})
    assert one == other
    assert one.key == other.key == pickle.loads(pickle.dumps(one)).key
    assert len(one.key) == 64


def test_another_seed_or_measure_makes_another_key() -> None:
    trials = [trial(COIN), trial(COIN, 1), trial(COIN, measure="tests.sim.sweep.scenarios:twice")]
    assert len(set(keys(trials))) == len(trials)


def test_a_whole_number_is_the_number_it_stands_for() -> None:
    assert trial(COIN, bias=1).key == trial(COIN, bias=1.0).key


def test_other_code_makes_another_key(monkeypatch: pytest.MonkeyPatch) -> None:
    before = trial(COIN).key
    monkeypatch.setattr("mathnavi.sim.records.run_spec.code_version", lambda *_: "another")
    assert trial(COIN).key != before


def test_the_parameters_are_every_field_as_plain_data() -> None:
    made = trial(COIN, raise_at=(1, 2), fields={"part.share": 0.25, "planner.gain": 3, "estimator.gain": 4.0})
    expected = dataclasses.asdict(CoinConfig()) | {"part": {"share": 0.25, "count": 3}}
    expected |= {name: list(expected[name]) for name in expected if name.endswith("_at")} | {"raise_at": [1, 2]}
    assert made.parameters == {
        "config": expected,
        "controller": {"name": NOBODY, "fields": {"gain": 3.0}},
        "estimator": {"name": NOBODY, "fields": {"gain": 4.0}},
        "inputs": {},
    }
    assert json.loads(json.dumps(made.parameters)) == made.parameters


def test_its_record_calls_the_fields_as_the_command_line_does() -> None:
    fields = trial(COIN, fields={"part.share": 0.25, "planner.gain": 3.0}).record("key", "ok").fields
    expected = {
        "part.share": 0.25,
        "controller": NOBODY,
        "planner.gain": 3.0,
        "estimator": NOBODY,
        "estimator.gain": 1.0,
    }
    assert fields == {**fields, **expected}


def test_a_flight_has_its_own_plugins_by_default() -> None:
    flight = trial(seed=3, fields={"faults.gust_rms": 1.5, "planner.nodes": 7}, terrain="jacksboro")
    assert [flight.parameters[part]["name"] for part in ("controller", "estimator")] == ["flight", "full_state"]
    assert (flight.spec["faults.gust_rms"], flight.spec["planner.nodes"]) == (1.5, 7)
    assert flight.parameters["inputs"] == {"terrain": load_terrain("jacksboro").digest}


def test_keys_are_made_without_building_anything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = [str(tmp_path / name) for name in ("one", "other")]
    for file in files:
        Path(file).write_text(file)
    monkeypatch.setattr(Coin, "build", None)
    trials = [trial(COIN, seed, table=file) for seed in range(50) for file in files]
    DIGESTED.clear()
    made = keys(trials)
    assert len(set(made)) == 100
    assert files == DIGESTED
    assert made == [one.key for one in trials]


def test_a_measure_that_is_nowhere_is_reported() -> None:
    with pytest.raises(ValueError, match=r"measure = 'tests\.nowhere:at_all'.*package\.module:function"):
        _ = trial(COIN, measure="tests.nowhere:at_all").code


def test_a_plugin_of_the_script_that_runs_cannot_be_had_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Scenario(CoinConfig):
        Config = CoinConfig
        controller = estimator = NOBODY
        build = staticmethod(lambda *_: None)

    Scenario.__module__ = "__main__"
    monkeypatch.setattr(sys.modules["__main__"], "Mine", Scenario, raising=False)
    with pytest.raises(ValueError, match="is defined in the script that runs"):
        keys([trial("__main__:Mine")])


def test_a_config_may_hold_what_json_cannot_say_but_the_key_tells() -> None:
    assert trial(COIN, wait=math.inf).key != trial(COIN, wait=-math.inf).key


@dataclass(frozen=True)
class _Thing:
    items: tuple[Any, ...] = field(default=())


def test_what_cannot_be_stored_is_reported() -> None:
    odd = Trial(dataclasses.replace(trial(COIN).spec, config=_Thing((object(),))))
    with pytest.raises(TypeError, match="cannot be stored"):
        _ = odd.key


def test_the_code_version_tells_whose_sources_it_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mathnavi.sim.scenarios.safe_flight import SafeFlight

    assert code_version() == code_version(SafeFlight)
    assert code_version().count("+") == 1
    assert code_version(Coin).startswith(f"{code_version()}+tests-")
    name = f"alone_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(Path(sys.modules[Coin.__module__].__file__ or "").read_text())
    monkeypatch.syspath_prepend(tmp_path)
    assert code_version(load("scenarios", f"{name}:Coin"), Coin).startswith(f"{code_version()}+{name}-")
