"""Every study keeps one contract: its files, its claims, and nothing flown or computed twice."""

from __future__ import annotations

import csv
import html
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure
from PIL import Image

from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders import page
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.store import Store
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.flight.hunt_spaces import HOSTILE, SAFE_FLIGHT, UPDATES
from mathnavi.studies.framework import study
from mathnavi.studies.framework.study import Setup, StudyResult, as_csv, on_terrain, write_result
from mathnavi.studies.introduction.cost_measurement import CURVES
from mathnavi.studies.nodes.missile_closed_loop import CASES, KINDS, OTHERS, PAIRS, selected_kinds
from mathnavi.studies.nodes.missile_nodes import SCHEMES
from mathnavi.studies.real.floor_windows import FOLLOWING
from mathnavi.studies.riemannian import mechanisms
from tests.studies.real.logs import write_building, write_plaza

SMALLEST: dict[str, dict[str, int]] = {
    "horizon": {"seeds": 1},
    "run-time": {"seeds": 1, "nodes": 4, "horizons": 4},
    "threat": {"seeds": 1},
    "updates": {"seeds": 1, "notices": 1},
    "noise": {"seeds": 1, "offsets": 2},
    "beta": {"seeds": 1},
    "cost-to-go": {"targets": 1, "starts": 40, "repetitions": 1},
    "as-printed-planner": {"seeds": 1},
    "safety": {"missions": 1},
    "guarantees": {"missions": 1, "conditions": 1, "timed": 1, "tuning": 1, "settings": 1},
    "safety-filter": {"episodes": 1, "seconds": 1, "population": 2, "generations": 1},
    "flight-grids": {"seeds": 1, "faulted": 1},
    "loiter": {"goals": 1},
    "ocp-problems": {"problems": 2, "nodes": 12, "exhaustive": False},
    "ocp-outside": {"problems": 1},
    "ocp-rounding": {"problems": 1, "draws": 1, "settings": 1},
    "missile-nodes": {"repeats": 1, "cases": 1, "grids": 5, "reference_nodes": 61, "indirect": 1},
    "missile-closed-loop": {"cases": 1, "seeds": 1, "replans": 1, "others": 1, "pairs": 1, "draws": 1},
    "monitors": {"problems": 1, "nodes": 8, "reference_nodes": 41},
    "active-control": {"seeds": 1, "others": 1, "tracked": 1, "seconds": 1, "searched": 1, "depth": 1},
    "mismatch": {"seeds": 1, "seconds": 1},
    "integrity": {"seeds": 1, "alone": 1, "faults": 2, "estimators": 1},
    "introduction-examples": {"grid": 2, "starts": 1, "pairs": 2},
    "observer-properties": {"starts": 1, "subjects": 1, "seconds": 1},
    "observability": {
        **{"starts": 1, "walls": 1, "states": 1, "places": 1, "headings": 1},
        **{"searches": 4, "gramians": 1, "seconds": 1},
    },
    "sphere": {"points": 1, "seconds": 1, "noisy": 1, "fast": 1, "values": 1, "bodies": 1},
    "curvature-sign": {"seeds": 1, "others": 1, "strengths": 1},
    "arrival": {"seeds": 1, "sizes": 1, "steps": 1, "narrow": 1},
    "quadrotor": {"canyons": 1, "missions": 1, "drawn": 1},
    "separation": {"seeds": 1, "sizes": 1, "grown": 1, "repetitions": 1},
    "fleet-peers": {"seeds": 1, "sizes": 1, "conditions": 1, "tuning": 1, "checks": 1, "vehicles": 2},
    "contraction": {"distances": 6, "directions": 3, "points": 1},
    "consensus": {"sizes": 1, "seeds": 1, "vehicles": 4},
    "attitude": {"seeds": 1, "others": 1, "seconds": 1},
    "mechanisms": {"own": 1, "suite": 1, "values": 1, "seconds": 1},
    "real-arms": {"cases": 1, "values": 1, "seconds": 1, "robots": 1, "faults": 2},
    "false-alarms": {"seeds": 1, "cases": 1},
    "bounds": {"seeds": 1, "scenarios": 2, "shortened": 4},
    "scaling": {"repetitions": 1, "sizes": 2, "trials": 10, "worker_counts": 1, "slow_network": False},
    "range-convergence": {"seeds": 1, "peers": 1, "drives": 1, "repetitions": 1, "seconds": 1},
    "range-observer": {"starts": 1, "drives": 1, "states": 2, "seconds": 1},
    "terrain": {"synthetic": 2, "real": 1, "plans": 10},
    "hunt": {"missions": 2, "hostile": 2, "tries": 1, "draws": 1, "repeats": 1},
    "real": {"windows": 1},
}
STUDIES = "mathnavi.studies"
SHORT = {"DURATION": 6.0, "TIMES": (2.0, 4.0, 6.0)}  # [s]
SMALL_CURVES = {
    name: replace(curve, sizes={"fleet": (2, 4), "trials": (10, 20)}.get(name, curve.sizes))
    for name, curve in CURVES.items()
}
SMALLER: dict[str, dict[str, Any]] = {
    "guarantees": {"flight.guarantees._TIMED": 4.0},
    "hunt": {
        "flight.hunt.HUNTS": (SAFE_FLIGHT, UPDATES),
        "flight.hunt.HOSTILE": HOSTILE[:1],
        "flight.hunt.COLOURS": ("#2166ac", "#e08214"),
    },
    "arrival": {"fleet.arrival.SIZES": (2,), "fleet.arrival.PRINTED_SIZE": 2},
    "consensus": {"fleet.consensus.ROUNDS": (40, 80, 160), "fleet.consensus._FRACTIONS": (0.9, 1.1, 1.5)},
    "range-convergence": {
        "ranging.range_convergence.TIMED": 1,
        "ranging.estimator_runs._PARTICLES": 100,
    },
    "missile-nodes": {"nodes.missile_nodes.SCHEMES": SCHEMES[::2]},
    "curvature-sign": {f"riemannian.curvature_sign.{name}": value for name, value in SHORT.items()},
    "sphere": {"riemannian.sphere.STEPS": {"printed": 4e-4, "repaired": 5e-3}},
    "scaling": {
        **{"introduction.cost_measurement.FLOWN": 2.0, "introduction.cost_measurement.UPDATES": 8},
        **{f"introduction.{module}.CURVES": SMALL_CURVES for module in ("cost_measurement", "scaling")},
    },
    "real": {"real.floor_windows.FOLLOWING": {"range_ekf": FOLLOWING["range_ekf"]}},
    "mechanisms": {"riemannian.mechanisms.BEGIN": 0.05},
    "real-arms": {
        **{"riemannian.real_arms.BEGIN": 0.05, "riemannian.faulty_arms.SETTLED": 0.05},
        "riemannian.faulty_arms.SMALL": 0,
    },
}
"""constants of studies that no field makes smaller, by their places"""


def _near(*target: float) -> tuple[float, ...]:
    """A target at three tenths of the distance."""
    return tuple(0.3 * x for x in target)


FLOWN: dict[str, tuple[str, Callable[[Mapping[str, Any]], dict[str, Any]]]] = {
    "missile-closed-loop": (
        "nodes.missile_closed_loop",
        lambda fields: {
            "planner.replan_period": 0.5,
            **fields,
            "target": _near(*fields.get("target", (500.0, 0.0, 0.0))),
        },
    ),
    "mechanisms": ("riemannian.mechanisms", lambda fields: {**fields, "duration": 0.2}),
    "real-arms": ("riemannian.mechanisms", lambda fields: {**fields, "duration": 0.2}),
}
"""fields of the missions of a module, for those that it asks for"""
CLAIMS = {
    "horizon": {"A.path-falls", "A.effort-falls", "A.20-to-15"},
    "run-time": {"A.runtime-grows", "flight.cpu-ratio"},
    "threat": {"A.threat-lower", "flight.radar"},
    "updates": {"flight.updates"},
    "noise": {"A.effort-grows-with-noise"},
    "beta": {"A.beta", "flight.beta"},
    "cost-to-go": {"flight.cost-to-go"},
    "as-printed-planner": {"A.safety-as-printed"},
    "safety": {"flight.safe", "flight.arrives"},
    "guarantees": {"guarantee.peers"},
    "safety-filter": {"guarantee.filter"},
    "flight-grids": {"flight.stretched"},
    "loiter": {"flight.loiter"},
    "ocp-problems": {"ocp.all", "ocp.collection", "ocp.statuses"},
    "ocp-outside": {"ocp.outside"},
    "ocp-rounding": {"ocp.rounding"},
    "missile-nodes": {
        *("missile.indirect", "missile.redistribute", "missile.equidistribute", "missile.gate"),
        *("B.more-accurate", "B.no-extra-time", "B.arclength-best", "B.minimum-at-25"),
    },
    "missile-closed-loop": {
        *("missile.replan", "missile.open-loop", "missile.feedback", "missile.moving-target", "missile.drawn"),
    },
    "monitors": {"B.arclength-best-problems", "ocp.monitors-radau"},
    "active-control": {"range.active", "range.active-limit", "C.input-decides", "C.basis", "C.deliberate"},
    "mismatch": {"mismatch.converged", "mismatch.sure-and-wrong", "mismatch.consistency"},
    "real": {"real.room", "real.floor", "real.beacons", "real.unicycles", "real.arm", "real.attitude"},
    "integrity": {"integrity.sure-and-wrong", "integrity.false-alarm", "integrity.recovers"},
    "introduction-examples": {
        *("I.example-2-1-observable", "I.example-2-1-no-observer", "I.example-2-2-unobservable"),
        *("I.example-2-2-observer", "I.linear-error-dynamics", "I.equation-2-4"),
        *("introduction.example-2-1", "introduction.example-2-2", "introduction.equation-2-4"),
    },
    "observer-properties": {"range.properties", "C.property-2-1"},
    "observability": {
        *("range.indistinguishable", "range.standing-still", "range.flags-ranks", "C.small-time", "C.proposition-1"),
        *("C.singleton", "C.output-flow", "C.zero-input", "C.map"),
    },
    "sphere": {
        *("riemannian.identities", "riemannian.printed-gain", "riemannian.repaired-gain", "riemannian.mujoco"),
        *("riemannian.noise", "D.converges", "D.transport-derivative", "D.transport-second", "D.lyapunov"),
    },
    "curvature-sign": {"riemannian.sign"},
    "contraction": {"riemannian.contraction", "D.infinitely-thin", "D.contraction-sign", "D.brackets"},
    "consensus": {"fleet.laplacian", "A.laplacian-rate", "A.outlier-keeps-value"},
    "attitude": {"riemannian.attitude"},
    "arrival": {"fleet.spread", "fleet.narrow", "A.consensus-by-A12", "A.constraint", "A.penalty", "A.one-step"},
    "quadrotor": {"fleet.quadrotor"},
    "separation": {"fleet.separation", "fleet.cost"},
    "fleet-peers": {"fleet.peers"},
    "terrain": {"terrain.faithful"},
    "hunt": {"search.safe", "search.hostile", "search.power"},
    "mechanisms": {
        *("riemannian.mechanisms", "riemannian.model-error", "riemannian.cost", "riemannian.menagerie"),
        "D.prohibitive",
    },
    "real-arms": {"real-arms.best", "real-arms.honest", "real-arms.false-alarm"},
    "false-alarms": {"false-alarms.scenarios"},
    "bounds": {"bounds.efficiency", "bounds.valid"},
    "scaling": {"scaling.map", "scaling.fleet", "scaling.hundred"},
    "range-convergence": {"range.global", "range.bank", "range.nonconvex", "range.diffdrive", "range.consistency"},
    "range-observer": {
        *(
            "range.identities",
            "range.as-printed",
            "C.start",
            "C.observer",
            "C.converges-z",
            "C.converges-x",
            "C.noise-z",
        ),
        *("C.noise-x", "C.position-better", "C.vector-average", "C.input", "C.proposition-2"),
    },
}
HOLDS: dict[str, dict[str, bool]] = {
    "sphere": {
        **{"riemannian.identities": True, "riemannian.mujoco": True, "D.transport-derivative": False},
        **{"D.transport-second": False, "D.lyapunov": False, "D.converges": False},
    },
    "terrain": {"terrain.faithful": True},
    "contraction": {
        **{"riemannian.contraction": True, "D.infinitely-thin": True, "D.contraction-sign": False},
        **{"D.brackets": False},
    },
}
"""of claims that do not depend on how much is run"""
UNMEASURED = {
    "noise",
    "ocp-problems",
    "ocp-outside",
    "ocp-rounding",
    "arrival",
    "real",
}  # over these hills no mission may arrive; not all are solved, or at hand
LAID_OUT = {"horizon", "contraction", "fleet-peers"}
"""whose figures are laid out and stand on the page as for a user; those of the others are drawn as they come"""
NARROW, BROAD, WIDE = 100.0, 200.0, 330.0  # [m]
ROOM = {"arrival": BROAD, "noise": BROAD, "scaling": BROAD, "separation": WIDE}  # for a fleet, or starts far apart
PRINTED = ("A.", "B.", "C.", "D.", "I.")  # the thesis' papers and its Introduction
NAMES = sorted(entry.name for entry in entry_points(group="mathnavi.studies"))


@pytest.fixture(scope="session")
def hills_by_length(tmp_path_factory: pytest.TempPathFactory) -> dict[float, str]:
    """Maps of hills by the distance [m] between their nodes."""
    x, y = np.meshgrid(np.arange(16) * 1.0, np.arange(16) * 1.0)
    places = {}
    for spacing in (NARROW, BROAD, WIDE):
        places[spacing] = str(tmp_path_factory.mktemp("map") / "hills.npz")
        z = 500.0 + 0.7 * spacing * np.sin(x / 4.0) * np.cos(y / 5.3)
        write_npz(HeightField(z, spacing, "hills"), Path(places[spacing]))
    return places


@pytest.fixture
def hills(name: str, hills_by_length: dict[float, str]) -> str:
    """1.5 km of hills, crossed in fourteen seconds, or 3 or 5 km for those that need room."""
    return hills_by_length[ROOM.get(name, NARROW)]


@pytest.fixture(scope="module")
def outcomes() -> dict[str, RunData]:
    """Results flown so far, by the key of a trial without a measure."""
    return {}


@pytest.fixture
def flown_once(outcomes: dict[str, RunData], trials_here: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Missions are flown here, and each once: a study flies its missions for their records, and some for their paths
    again; and several studies compare with the same mission.
    """

    def flown(trial: Trial) -> RunData:
        key = replace(trial, measure="").key
        if key not in outcomes:
            outcomes[key] = trial.build().run()
        return outcomes[key]

    monkeypatch.setattr(Trial, "flown", flown)


@pytest.fixture
def drawn_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure is drawn for its file and not again for the page, and nothing in it is given its place before."""
    if name not in LAID_OUT:
        monkeypatch.setattr(study, "lay_out", lambda figure: figure.set_layout_engine(None))
        monkeypatch.setitem(rcParams, "axes.titley", 1.0)  # or every title is moved off what it meets, all being drawn
        monkeypatch.setattr(page, "inline_svg", lambda figure, name, alt: page.Markup(f"<svg><!-- {name} --></svg>"))


@pytest.fixture
def smaller(name: str, hills: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a study does is as little as shows that it does all of it."""
    for place, value in SMALLER.get(name, {}).items():
        monkeypatch.setattr(f"{STUDIES}.{place}", value)
    if name == "scaling":
        monkeypatch.setattr(f"{STUDIES}.introduction.cost_measurement.GROUND", hills)
        monkeypatch.setattr(f"{STUDIES}.introduction.cost_measurement._folder", lambda: tmp_path)  # what is made of it
    if name in FLOWN:
        module, changed = FLOWN[name]
        monkeypatch.setattr(
            f"{STUDIES}.{module}.trial", lambda *named, fields, **more: trial(*named, fields=changed(fields), **more)
        )
    mechanisms.recorded.cache_clear()
    yield
    mechanisms.recorded.cache_clear()


def test_every_study_is_in_this_suite() -> None:
    assert set(SMALLEST) == set(CLAIMS) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("flown_once", "drawn_once", "smaller")
def test_a_study_keeps_the_contract(name: str, hills: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One test for everything, so that each study is run once."""
    plugin = load("studies", name)
    config = plugin.Config(**SMALLEST[name], **(small_logs(tmp_path / "logs") if name == "real" else {}))
    with Store.open(tmp_path / "trials.db") as store:
        setup = Setup(hills if on_terrain(plugin) else None, store)
        result: StudyResult = plugin.run(config, setup)
        write_result(tmp_path, name, plugin.title, result, setup, f"mathnavi study {name}")
        stored = store.keys() | store.job_endings().keys()
        assert stored
        made = [part for part, function in plugin.run.__globals__.items() if draws(function)]
        assert made
        for part in made:  # of the same results it would be the same
            monkeypatch.setitem(plugin.run.__globals__, part, lambda *_, **__: result.figure)
        idle = Setup(setup.terrain, store, progress=lambda now: pytest.fail(f"{now} is computed again"))
        again: StudyResult = plugin.run(config, idle)  # what was timed is as it was timed then
        assert store.keys() | store.job_endings().keys() == stored
        assert [claim.measured for claim in again.claims] == [claim.measured for claim in result.claims]
        assert as_csv(again.rows) == as_csv(result.rows)
    assert_claims(name, result)
    assert_files(tmp_path, name, result, "hills" if on_terrain(plugin) else None)


def small_logs(folder: Path) -> dict[str, Any]:
    """Fields of the study of real logs for logs in a folder that have two parts of five."""
    write_building(folder / "carmen" / "room-corrected.log", 5)
    write_plaza(folder / "plaza" / "Plaza1_.mat", 120)
    return {"data": folder, "beams": (4,), "seconds": 40.0, "apart": 10.0}


def draws(function: object) -> bool:
    """Return True if this is a function that returns a figure."""
    return getattr(function, "__annotations__", {}).get("return") in ("Figure", Figure)


def assert_claims(name: str, result: StudyResult) -> None:
    """They are those that the study is there for, and each has all that a ledger needs."""
    assert {claim.id for claim in result.claims} == CLAIMS[name]
    for claim in result.claims:
        assert claim.kind == ("printed" if claim.id.startswith(PRINTED) else "target")
        assert isinstance(claim.holds, bool) or (name in UNMEASURED and claim.holds is None)
        assert all((claim.statement, claim.source, claim.expected, claim.measured))
    texts = [*result.summary, result.caption, *(t for claim in result.claims for t in (claim.expected, claim.measured))]
    assert not [text for text in texts if re.search(r"(?<![\w.])\.\d", text)]  # 0.3 m, not .3 m
    holds = {claim.id: claim.holds for claim in result.claims}
    known = HOLDS.get(name, {})
    assert {claim: holds[claim] for claim in known} == known


def assert_files(folder: Path, name: str, result: StudyResult, terrain: str | None) -> None:
    """NAME.csv, NAME.json, NAME.png and NAME.html hold what was found."""
    rows = list(csv.DictReader((folder / f"{name}.csv").open(encoding="utf-8")))
    assert len(rows) == len(result.rows) > 0
    assert list(rows[0]) == list(dict.fromkeys(column for row in result.rows for column in row))
    document = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    assert (document["terrain"] or {"name": None})["name"] == terrain
    keys = {"id", "kind", "statement", "source", "expected", "measured", "holds"}
    assert all(claim.keys() == keys for claim in document["claims"])
    assert len(document["rows"]) == len(result.rows)
    with Image.open(folder / f"{name}.png") as picture:
        assert picture.width >= 1000
        assert np.asarray(picture.convert("L")).std() > 10.0
    page = (folder / f"{name}.html").read_text(encoding="utf-8")
    assert all(claim.id in page for claim in result.claims)
    assert all(html.escape(table.title) in page for table in result.tables)
    assert ("Over the terrain" in page) is (terrain is not None)


def test_every_kind_of_the_missiles_flights_can_be_flown() -> None:
    """Their smallest study flies only some."""
    assert selected_kinds(OTHERS, PAIRS) == KINDS
    smallest = SMALLEST["missile-closed-loop"]
    flown = selected_kinds(smallest["others"], smallest["pairs"])
    for kind in KINDS:
        assert len(kind.trials(len(CASES), 3)) == (3 if kind.seeded else len(CASES))
        if kind not in flown:
            kind.trials(1, 1)[0].build()


def test_a_study_of_fleets_in_two_halves_refuses_an_odd_number() -> None:
    with pytest.raises(ValueError, match="vehicles = 5; allowed: an even number from 4 to 256"):
        load("studies", "consensus").Config(vehicles=5)
