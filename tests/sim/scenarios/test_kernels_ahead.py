"""The lists of kernels that plug-ins name hold what a run calls: compiled ahead of it, nothing is compiled in it."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

from numba.core.dispatcher import Dispatcher

from mathnavi.interfaces.compiled import KeptCompilation, Signature, any_missing
from mathnavi.sim.engine.compilation import listed
from mathnavi.sim.sweep.trial import trial

SHORT: dict[str, dict[str, Any]] = {
    "safe-flight": {"terrain": "jacksboro", "start": (3000.0, 4000.0, 1000.0), "target": (6000.0, 7000.0, 1000.0)},
    "attitude-tracking": {"duration": 1.2, "settled": 0.8},
    "arm-velocity": {"duration": 0.5, "settled": 0.2},
    "missile-guidance": {},
    "quadrotor-canyon": {"start": (300.0, 275.0, 1232.0), "target": (204.0, 303.0, 1232.0)},
    "range-localisation": {"duration": 1.0},
    "simultaneous-arrival": {
        **{"vehicles": 2, "terrain": "jacksboro", "target": (6000.0, 6000.0, 1000.0)},
        "start": ((3000.0, 4000.0, 1000.0), (3000.0, 6000.0, 1000.0)),
    },
    "sphere-observer": {"duration": 1.0, "settled": 0.5},
}


def check(scenario: str) -> None:
    """Run a scenario in a process that has loaded no kernel yet, and compare those that it loads with the list."""
    asked = trial(scenario, 0, fields=SHORT[scenario])
    kernels = listed_for(scenario)
    asked.spec.build().run()
    names = [vars(module) for name, module in sys.modules.items() if name.startswith("mathnavi.")]
    kept = [each for content in names for each in content.values() if isinstance(each, Dispatcher)]
    called = {(each, types) for each in kept if isinstance(each.compile, KeptCompilation) for types in each.overloads}
    assert called == set(kernels), (scenario, called ^ set(kernels))


def check_each() -> None:
    """Check every scenario in a child of this process, which has imported all that they need and run nothing."""
    for scenario in SHORT:
        listed_for(scenario)
    wrong = []
    for scenario in SHORT:
        child = os.fork()
        if not child:
            check(scenario)
            os._exit(0)
        if os.waitpid(child, 0)[1]:
            wrong.append(scenario)
    assert wrong == []


def listed_for(scenario: str) -> list[Signature]:
    asked = trial(scenario, 0, fields=SHORT[scenario])
    return listed(config.kernels for config in asked.spec.parts.values() if hasattr(config, "kernels"))


def test_runs_call_the_kernels_that_are_listed_and_no_others() -> None:
    for kernel, arguments in dict.fromkeys(each for scenario in SHORT for each in listed_for(scenario)):
        if any_missing([(kernel, arguments)]):  # one that is compiled in the run brings those that it calls
            kernel.compile(arguments)
    script = "from tests.sim.scenarios.test_kernels_ahead import check_each; check_each()"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
