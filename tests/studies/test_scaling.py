"""The study of time and memory against size: what it fits, what it names, what it measures with."""

from __future__ import annotations

import resource
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.introduction import cost_measurement
from mathnavi.studies.introduction.cost_measurement import (
    CURVES,
    Measured,
    PeakMemory,
    SizedCase,
    SweepCase,
    delayed,
    measured,
    swept,
)
from mathnavi.studies.introduction.scaling import (
    Growth,
    claims,
    exponent,
    grown,
    medians,
    of_cluster,
    serves_up_to,
    trials_a_second,
)

SIZES = (4, 8, 16, 32, 64)


@given(p=st.floats(0.2, 3.0), factor=st.floats(1e-6, 1e3), beyond=st.floats(1.5, 50.0))
def test_a_power_law_is_found_and_followed_to_its_limit(p: float, factor: float, beyond: float) -> None:
    costs = [factor * size**p for size in SIZES]
    curve = replace(CURVES["fleet"], today=16, limit=factor * (16.0 * 4.0 * beyond) ** p)
    assert exponent(SIZES, costs) == pytest.approx(p)
    assert serves_up_to(curve, SIZES, costs) == pytest.approx(4.0 * beyond, rel=1e-6)


def test_what_does_not_grow_serves_at_any_size() -> None:
    curve = replace(CURVES["fleet"], limit=2.0)
    assert serves_up_to(curve, SIZES, [1.0] * len(SIZES)) == np.inf


def test_a_limit_that_was_met_is_where_it_last_served() -> None:
    curve = replace(CURVES["fleet"], today=16, limit=10.0)
    assert serves_up_to(curve, SIZES, [1.0, 2.0, 8.0, 20.0, 90.0]) == 1.0
    assert serves_up_to(curve, SIZES, [11.0, 12.0, 18.0, 20.0, 90.0]) == 0.0


def test_claims_follow_from_the_exponents_and_what_breaks_is_named() -> None:
    def growths(map_flown: float, fleet: float) -> list[Growth]:
        exponents = dict.fromkeys(CURVES, 1.0) | {"map, built": 2.0, "map, flown": map_flown, "fleet": fleet}
        return grown(
            [
                {
                    "curve": name,
                    "size": size,
                    "cost_wall_s": 1e-9 * (size / curve.today) ** exponents[name],
                    "memory_wall_s": 0.0,
                }
                for name, curve in CURVES.items()
                for size in curve.sizes
            ]
        )

    assert [each.holds for each in claims(growths(map_flown=0.0, fleet=1.0))] == [True, True, True]
    bad = claims(growths(map_flown=2.0, fleet=6.0))
    assert [each.holds for each in bad] == [False, False, False]
    assert "fleet (at " in bad[2].measured


def test_medians_over_the_repetitions() -> None:
    cases = [SizedCase("fleet", size, seed) for size in (4, 8) for seed in range(3)]
    results = [Measured(MeasuredTime(case.size * (1.0 + case.seed)), MeasuredTime(1.0)) for case in cases]
    (growth,) = grown(medians(cases, results))
    assert (growth.sizes, growth.costs, growth.memory) == ([4, 8], [8.0, 16.0], [1.0, 1.0])


@pytest.mark.parametrize("curve", ["bank", "observer", "radars", "trials"])
def test_a_size_is_measured(curve: str) -> None:
    found = measured(SizedCase(curve, CURVES[curve].sizes[0], seed=0))
    assert 0.0 < found.cost < np.inf


def test_a_scenario_takes_the_largest_fleet() -> None:
    size = max(CURVES["fleet"].sizes)
    assert trial("simultaneous-arrival", fields={"vehicles": size}).spec.config.vehicles == size


def test_no_map_is_read_twice() -> None:
    first, second = (load_terrain(CURVES["map, built"].made(129, 0).spec.config.terrain) for _ in range(2))
    assert first is not second
    assert np.array_equal(first.z, second.z)


def test_what_is_made_counts_as_memory_only_where_it_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[str] = []

    class Watched(PeakMemory):
        def __enter__(self) -> PeakMemory:
            events.append("begin")
            return super().__enter__()

    monkeypatch.setattr(cost_measurement, "PeakMemory", Watched)
    for holds, order in ((True, ["made", "begin", "made"]), (False, ["made", "made", "begin"])):
        curve = replace(
            CURVES["fleet"], sizes=(1, 20), made=lambda *_: events.append("made"), cost=lambda _: 0.0, holds=holds
        )
        monkeypatch.setitem(CURVES, "ones", curve)
        events.clear()
        measured(SizedCase("ones", 20, seed=0))
        assert events == order


@pytest.mark.parametrize(("commit", "named"), [(0.1, "store's single writer"), (1e-6, "scheduler")])
def test_what_holds_a_cluster_up_is_named(commit: float, named: str) -> None:
    far = {"delay_s": 0.05, "cost_wall_s": 0.01}
    text = of_cluster([far], commit)
    assert named in text.partition("the first limit, ")[2]
    assert "the sweep does not hold" in text
    assert "the sweep holds" in of_cluster([{**far, "cost_wall_s": 1e-4}], 1e-4)


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="the system does not say")
def test_memory_that_was_given_back_counts() -> None:
    # how much of an array is resident is the system's affair: it may take pages away at any time
    before, held, after, counted = 0.0, 0.0, 0.0, 0.0
    for _ in range(10):
        before = _resident()
        with PeakMemory() as memory:
            before = max(before, _resident())
            array = np.ones(25_000_000)
            held = _resident()
            del array
            after = _resident()
        counted = memory.grown
        if held - max(before, after) > 20.0:
            break
    else:
        pytest.skip("the system keeps no array of 200 MB in memory")
    assert counted > held - before - 5.0
    assert counted < 1000.0


def _resident() -> float:
    """Memory of this process [MB] as the kernel counts it page by page."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


def test_a_sweep_of_nothing_ends() -> None:
    (row,) = swept([SweepCase(workers=1, trials=3)])
    assert row["start_wall_s"] > 0.0
    assert trials_a_second(row) > 0.0


def test_the_relay_holds_every_byte_back_and_loses_none() -> None:
    sent = bytes(range(256)) * 1024
    with socket.create_server(("127.0.0.1", 0)) as server:

        def echo() -> None:
            there, _ = server.accept()
            with there:
                while data := there.recv(4096):
                    there.sendall(data)

        threading.Thread(target=echo, daemon=True).start()
        relay = delayed("127.0.0.1", server.getsockname()[1], 0.1)
        with relay as port, socket.create_connection(("127.0.0.1", port), timeout=60.0) as here:
            began = time.monotonic()
            threading.Thread(target=here.sendall, args=(sent,), daemon=True).start()
            got = here.recv(1)
            first = time.monotonic() - began
            while len(got) < len(sent):
                got += here.recv(65536)
    assert got == sent
    assert first >= 0.2  # there and back
