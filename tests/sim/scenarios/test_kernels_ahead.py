"""The lists of kernels that plug-ins name hold what a run calls: compiled ahead of it, nothing is compiled in it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from numba.core.dispatcher import Dispatcher

from mathnavi.interfaces.compiled import KeptCompilation, Signature, any_missing
from mathnavi.models.field.map_file import load_map
from mathnavi.sim.engine.compilation import listed
from mathnavi.sim.sweep.trial import trial
from tests.models.field.walls import FURNISHED

PLACES = ((3.0, 2.0), (-3.0, 2.5), (-2.5, -3.0))
AMONG_BEACONS = {"beacons.places": PLACES, "planner.mode": "figure-eight"}
RANGE_FINDERS: dict[str, Any] = {"start_known": True, "sensors": (-135.0, -45.0, 45.0, 135.0)}
FLIGHT = {"terrain": "jacksboro", "start": (3000.0, 4000.0, 1000.0), "target": (6000.0, 7000.0, 1000.0)}
CARRIED: dict[str, Any] = {
    "beacons.places": (
        (2000.0, 8000.0, 900.0),
        (8000.0, 2000.0, 420.0),
        (5000.0, 5000.0, 1500.0),
        (1000.0, 2000.0, 600.0),
    ),
    "beacons.range_noise": 0.5,
}
Run = tuple[str | None, dict[str, Any]]
"""estimator and fields"""


def runs(room: Path) -> dict[str, Sequence[Run]]:
    """Short runs of each scenario; together those of one call all that they list, within a ``room`` too."""
    return {
        "safe-flight": [
            (None, FLIGHT),
            ("moving_horizon", FLIGHT),
            ("kalman", FLIGHT | CARRIED),
            ("kalman", FLIGHT | CARRIED | {"beacons.unknown": (0, 1), "estimator.fixes": True, "noise.position": 2.0}),
        ],
        "attitude-tracking": [(None, {"duration": 1.2, "settled": 0.8})],
        "arm-velocity": [(None, {"duration": 0.5, "settled": 0.2})],
        "missile-guidance": [(None, {})],
        "quadrotor-canyon": [(None, {"start": (300.0, 275.0, 1232.0), "target": (204.0, 303.0, 1232.0)})],
        "range-localisation": [
            (None, {"duration": 1.0}),
            ("range_ukf", {"duration": 1.0, "field.shape": "map", "field.map": str(room), **RANGE_FINDERS}),
            ("beacon_bank", {"duration": 4.0, **AMONG_BEACONS, "beacons.unknown": (0,), "start_known": True}),
            ("beacon_bank", {"duration": 4.0, **AMONG_BEACONS}),
            (
                "beacon_bank",
                {
                    **{"duration": 8.0, **AMONG_BEACONS, "beacons.unknown": (0,), "start_known": True},
                    "beacons.read": ("bearings",),
                },
            ),
            ("mathnavi.estimators.beacons.certified:BeaconCertified", {"duration": 1.0, **AMONG_BEACONS}),
        ],
        "simultaneous-arrival": [
            (
                None,
                {
                    **{"vehicles": 2, "terrain": "jacksboro", "target": (6000.0, 6000.0, 1000.0)},
                    "start": ((3000.0, 4000.0, 1000.0), (3000.0, 6000.0, 1000.0)),
                },
            )
        ],
        "sphere-observer": [(None, {"duration": 1.0, "settled": 0.5})],
    }


def loaded() -> set[Signature]:
    """Kernels that this process has loaded or compiled."""
    names = [vars(module) for name, module in sys.modules.items() if name.startswith("mathnavi.")]
    kept = [each for content in names for each in content.values() if isinstance(each, Dispatcher)]
    return {(each, types) for each in kept if isinstance(each.compile, KeptCompilation) for types in each.overloads}


def called(scenario: str, run: Run, known: Sequence[Signature]) -> set[int]:
    """Places in the kernels ``known`` of those that a run calls, in a child of this process that has called none."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        try:
            before, (estimator, fields) = loaded(), run
            trial(scenario, 0, estimator=estimator, fields=fields).spec.build().run()
            after = loaded() - before
            assert after <= set(listed_for(scenario, run)), (scenario, run, after - set(listed_for(scenario, run)))
            os.write(writer, json.dumps([known.index(each) for each in after]).encode())
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
    os.close(writer)
    with os.fdopen(reader) as answer:
        found = answer.read()
    assert not os.waitpid(child, 0)[1], (scenario, run)
    return set(json.loads(found))


def check_each(room: str) -> None:
    """Check every scenario in children of this process, which has imported all that they need and run nothing.

    What reads a map is no part of a run: this process reads it.
    """
    load_map(Path(room))
    each_listed = {name: listed_for(name, *own) for name, own in runs(Path(room)).items()}
    wrong = []
    for name, own in runs(Path(room)).items():
        known = each_listed[name]
        found = set().union(*(called(name, run, known) for run in own))
        wrong += [(name, each) for k, each in enumerate(known) if k not in found]
    assert wrong == []


def listed_for(scenario: str, *own: Run) -> list[Signature]:
    specs = [trial(scenario, 0, estimator=estimator, fields=fields).spec for estimator, fields in own]
    named = (getattr(config, "kernels", None) for spec in specs for config in spec.parts.values())
    return listed(name for name in named if name)


def test_runs_call_the_kernels_that_are_listed_and_no_others(tmp_path: Path) -> None:
    room = tmp_path / "room.json"
    room.write_text(json.dumps({"name": FURNISHED.name, "rings": FURNISHED.rings}))
    kernels = [each for name, own in runs(room).items() for each in listed_for(name, *own)]
    for kernel, arguments in dict.fromkeys(kernels):
        if any_missing([(kernel, arguments)]):  # one that is compiled in the run brings those that it calls
            kernel.compile(arguments)
    script = f"from tests.sim.scenarios.test_kernels_ahead import check_each; check_each({str(room)!r})"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
