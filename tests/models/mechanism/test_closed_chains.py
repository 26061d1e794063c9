"""A four-bar linkage: what its closed chain allows, and that observers keep to it."""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.closed_chains import ClosedChains
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load

CRANK, COUPLER, ROCKER, BASE = 0.2, np.array([0.5, 0.1]), 0.3, 0.5  # [m]
LINKAGE = """<mujoco><option timestep="0.002"/><default><geom contype="0" size=".01"/><joint axis="0 1 0"/></default>
<worldbody><body><joint name="crank" damping="0.05"/><geom type="capsule" fromto="0 0 0 0 0 .2" mass=".2"/>
  <body name="coupler" pos="0 0 .2"><joint name="coupler" damping=".05"/>
    <geom type="capsule" fromto="0 0 0 .5 0 .1" mass=".4"/></body></body>
  <body name="rocker" pos=".5 0 0"><joint name="rocker" damping=".05"/>
    <geom type="capsule" fromto="0 0 0 0 0 .3" mass=".3"/></body></worldbody>
<equality><{kind} body1="rocker" body2="coupler" anchor="0 0 .3"{more}/></equality>
<actuator><motor joint="crank"/></actuator></mujoco>"""


@cache
def linkage(kind: str = "connect", more: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(LINKAGE.format(kind=kind, more=more))


def gap(q: Array) -> Array:
    """The way (2,) [m] from the rocker's end to the coupler's, x and z, by hand; q are turns about y."""
    a, b, c = q

    def turned(angle: float, x: float, z: float) -> Array:
        return np.array([np.cos(angle) * x + np.sin(angle) * z, -np.sin(angle) * x + np.cos(angle) * z])

    end: Array = turned(a, 0.0, CRANK) + turned(a + b, *COUPLER) - np.array([BASE, 0.0]) - turned(c, 0.0, ROCKER)
    return end


def slope(q: Array) -> Array:
    """Derivative (2, 3) of the gap."""
    return np.stack([(gap(q + e) - gap(q - e)) / 2e-6 for e in 1e-6 * np.eye(3)], axis=1)


def test_a_position_is_projected_onto_the_nearest_at_which_the_chain_is_closed() -> None:
    chains = ClosedChains.of(linkage())
    assert chains is not None
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = chains.nearest(0.15 * rng.standard_normal(3))
        assert np.abs(gap(q)).max() < 1e-3
        off = q + 1e-3 * rng.standard_normal(3)
        found = chains.nearest(off)
        assert np.abs(gap(found)).max() < 1e-9
        along = np.linalg.svd(slope(found))[2][2]  # the only direction that is left
        assert abs(along @ (off - found)) < 1e-5  # the rest is across


def test_a_position_that_is_far_off_is_not_thrown_farther() -> None:
    chains = ClosedChains.of(linkage())
    assert chains is not None
    rng = np.random.default_rng(5)
    for _ in range(50):
        q = 2.0 * rng.standard_normal(3)
        assert np.linalg.norm(gap(chains.nearest(q))) <= np.linalg.norm(gap(q))


def test_what_is_tangent_moves_the_chain_and_does_not_open_it() -> None:
    chains = ClosedChains.of(linkage())
    assert chains is not None
    rng = np.random.default_rng(2)
    for _ in range(20):
        q, c = chains.nearest(0.3 * rng.standard_normal(3)), rng.standard_normal(3)
        tangent = chains.tangent(q, c)
        assert np.abs(slope(q) @ tangent).max() < 1e-7
        np.testing.assert_allclose(chains.tangent(q, tangent), tangent, atol=1e-12)
        assert np.abs(tangent @ (c - tangent)) < 1e-12


@pytest.mark.parametrize(
    ("kind", "more", "left"), [("connect", "", 1), ("weld", "", 0), ("connect", ' active="false"', None)]
)
def test_the_degrees_of_freedom_that_are_left(kind: str, more: str, left: int | None) -> None:
    chains = ClosedChains.of(linkage(kind, more))
    if left is None:
        assert chains is None
        return
    assert chains is not None
    tangent = np.stack([chains.tangent(np.zeros(3), e) for e in np.eye(3)], axis=1)
    assert np.linalg.matrix_rank(tangent, tol=1e-9) == left


def test_a_mechanism_without_constraints_has_no_closure() -> None:
    assert MechanismSystem(linkage()).closure is not None
    open_chain = LINKAGE.format(kind="connect", more="").partition("<equality>")[0] + "</mujoco>"
    assert MechanismSystem(mujoco.MjModel.from_xml_string(open_chain)).closure is None


@cache
def swung(steps: int = 1500) -> tuple[Array, Array, Array]:
    """Positions (N, 3), velocities (N, 3) and controls (N, 1) of the linkage."""
    model = linkage()
    data = mujoco.MjData(model)
    rows = [(data.qpos.copy(), data.qvel.copy(), np.zeros(1))]
    for k in range(steps):
        data.ctrl[:] = 0.3 * np.sin(0.01 * k)
        mujoco.mj_step(model, data)
        rows.append((data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()))
    q, v, u = (np.array(each) for each in zip(*rows, strict=True))
    return q, v, u


@pytest.mark.parametrize("noise", [1e-3, 1e-2])
@pytest.mark.parametrize(
    ("method", "better"), [("riemannian_observer", 20.0), ("high_gain", 40.0), ("momentum_observer", 5.0)]
)
def test_observers_of_a_linkage_keep_to_what_it_allows(method: str, better: float, noise: float) -> None:
    """They are many times better than a filter, and the velocities open the chain by less than noise would."""
    q, v, u = swung()
    y = q + noise * np.random.default_rng(3).standard_normal(q.shape)
    errors, opening = {}, 0.0
    for name in (method, "filtered_differences"):
        mission = LagrangianMission(MechanismSystem(linkage()), PositionQuality(noise), 0.002)
        plugin: Any = load("estimators", name)
        estimator = plugin.build(plugin.Config(), mission)
        found = [
            estimator.update(0.002 * k, [Measurement("position", 0.002 * k, a)], b)
            for k, (a, b) in enumerate(zip(y, u, strict=True))
        ]
        x = np.array([each.x for each in found])
        errors[name] = float(np.sqrt(np.mean(np.square(x[500:, 3:] - v[500:]))))
        if name == method:
            assert found[-1].status is Status.OK
            opening = max(float(np.abs(slope(each[:3]) @ each[3:]).max()) for each in x[500::50])
    assert errors[method] < errors["filtered_differences"] / better
    assert opening < 0.1 * errors["filtered_differences"]
