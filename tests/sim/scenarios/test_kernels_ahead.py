"""The lists of kernels that plug-ins name hold what a run calls: compiled ahead of it, nothing is compiled in it."""

from __future__ import annotations

import sys
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

from mathnavi.interfaces.compiled import KernelCache
from mathnavi.sim.engine.compilation import listed
from mathnavi.sim.sweep.trial import trial

SHORT: dict[str, dict[str, Any]] = {
    "safe-flight": {"terrain": "jacksboro", "start": (3000.0, 4000.0, 1000.0), "target": (6000.0, 7000.0, 1000.0)},
    "attitude-tracking": {"duration": 1.2, "settled": 0.8},
    "arm-velocity": {"duration": 0.5, "settled": 0.2},
    "missile-guidance": {},
    "quadrotor-canyon": {},
    "range-localisation": {"duration": 1.0},
    "simultaneous-arrival": {"vehicles": 2},
    "sphere-observer": {"duration": 1.0, "settled": 0.5},
}


def kept(kernel: object) -> bool:
    """True for a kernel that is called from Python."""
    return isinstance(kernel, Dispatcher) and isinstance(kernel._cache, KernelCache)


def forget() -> None:
    """Unload all kernels and drop what functions keep of their results: an earlier run would spare this one calls."""
    names = [vars(module) for name, module in sys.modules.items() if name.startswith("mathnavi.")]
    names += [vars(each) for content in [*names] for each in content.values() if isinstance(each, type)]
    for content in names:
        for each in content.values():
            if kept(each):
                each._reset_overloads()
            elif callable(clear := getattr(getattr(each, "__func__", each), "cache_clear", None)):
                clear()


@pytest.mark.parametrize("scenario", SHORT)
def test_a_run_calls_the_kernels_that_are_listed_and_no_others(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = trial(scenario, 0, fields=SHORT[scenario])
    configs = asked.config, asked.controller_config, asked.estimator_config
    kernels = listed(config.kernels for config in configs if hasattr(config, "kernels"))
    for kernel, arguments in kernels:  # as before a run, where they are missing
        kernel.compile(arguments)
    forget()
    called = set()
    load = KernelCache.load_overload

    def noted(self: KernelCache, sig: Any, target_context: Any) -> Any:
        called.add((self._kernel, sig))
        return load(self, sig, target_context)

    monkeypatch.setattr(KernelCache, "load_overload", noted)
    asked.build().run()
    assert called == set(kernels)
