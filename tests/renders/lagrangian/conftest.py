"""Short runs of the scenarios of Paper D, shared by all tests of their pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from mathnavi.models.manifold.mission import PositionQuality
from mathnavi.renders.lagrangian.run_data import LagrangianRun, load_run
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.scenarios.arm_velocity import ArmVelocity
from mathnavi.sim.scenarios.attitude_tracking import AttitudeTrackingScenario
from mathnavi.sim.scenarios.sphere_observer import SphereObserver

SHORT = {"duration": 1.2, "settled": 0.8, "rate": 250.0}
MADE: Mapping[str, tuple[Any, dict[str, Any]]] = {
    "body": (SphereObserver, SHORT),
    "sphere": (SphereObserver, {**SHORT, "space": "sphere", "force": "printed"}),
    "hyperbolic-plane": (SphereObserver, {**SHORT, "space": "hyperbolic-plane", "force": "linear", "speed": 3.0}),
    "silent": (SphereObserver, {**SHORT, "reading": PositionQuality(dropout=1.0)}),
    "tracking": (AttitudeTrackingScenario, SHORT),
    "arm": (ArmVelocity, {**SHORT, "load": 1.5}),
    "cart": (ArmVelocity, {**SHORT, "mechanism": "cart-pendulum"}),
    "thrown": (ArmVelocity, {**SHORT, "start": (0.0, 0.0, 4.0, -3.0)}),
}


@pytest.fixture(scope="session")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The folder of a run of each kind, and of one without the observer (D.6)."""
    folder = tmp_path_factory.mktemp("lagrangian")
    for name, (scenario, fields) in MADE.items():
        scenario.build(scenario.Config(**fields), 3).run().write(folder / name)
    differences = PluginSpec.with_fields(load("estimators", "filtered_differences"))
    SphereObserver.build(SphereObserver.Config(**SHORT), 3, estimator=differences).run().write(folder / "differences")
    return {name: folder / name for name in (*MADE, "differences")}


@pytest.fixture(scope="session")
def runs(folders: dict[str, Path]) -> dict[str, LagrangianRun]:
    return {name: load_run(folder) for name, folder in folders.items()}
