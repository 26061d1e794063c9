"""A four-bar linkage: what its closed chain allows, and that observers keep to it."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.closed_chains import ClosedChains
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load
from tests.estimators.velocity.faulty_arms import observed

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


CARRIED = """<mujoco><option timestep="0.002" integrator="implicitfast"/><default><geom contype="0" conaffinity="0"
  size=".01"/><joint axis="0 1 0" damping=".1" armature=".005" frictionloss=".2"/></default>
<worldbody><body><joint name="turn" axis="0 0 1" damping="5" armature=".1"/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" mass="2"/>
  <body pos=".3 0 0"><joint name="lift" damping="5" armature=".1"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" mass="1"/>
    <body pos=".2 0 0"><joint name="crank"/><geom type="capsule" fromto="0 0 0 0 0 .04" mass=".1"/>
      <body name="coupler" pos="0 0 .04"><joint name="coupler"/>
        <geom type="capsule" fromto="0 0 0 .1 0 .02" mass=".1"/></body></body>
    <body name="rocker" pos=".3 0 0"><joint name="rocker"/>
      <geom type="capsule" fromto="0 0 0 0 0 .06" mass=".1"/></body></body></body></worldbody>
<equality><connect body1="rocker" body2="coupler" anchor="0 0 .06" solref=".01 1"/></equality>
<tendon><fixed name="drive"><joint joint="crank" coef=".5"/><joint joint="rocker" coef=".5"/></fixed></tendon>
<actuator><general joint="turn" biastype="affine" gainprm="1000" biasprm="0 -1000 -100"/>
  <general joint="lift" biastype="affine" gainprm="1000" biasprm="0 -1000 -100"/>
  <general tendon="drive" biastype="affine" gainprm="100" biasprm="0 -100 -10"/></actuator></mujoco>"""


def test_a_chain_that_is_a_bit_open_does_not_hold_the_arm_that_carries_it() -> None:
    chains = ClosedChains.of(mujoco.MjModel.from_xml_string(CARRIED))
    assert chains is not None
    rng = np.random.default_rng(4)
    for _ in range(10):
        q = chains.nearest(np.append(rng.standard_normal(2), 0.05 * rng.standard_normal(3)))
        for arm in np.eye(5)[:2]:
            np.testing.assert_allclose(chains.tangent(q + 1e-3 * rng.standard_normal(5), arm), arm, atol=1e-9)
        tangent = np.stack([chains.tangent(q + 1e-3 * rng.standard_normal(5), e) for e in np.eye(5)], axis=1)
        assert np.trace(tangent) == pytest.approx(3.0, abs=1e-3)  # the arm's two joints, and the linkage's one


@pytest.mark.parametrize("fault", [{}, {"gain": 0.8}, {"gain": 1.2}, {"damping": 2.0}, {"friction": 0.2}], ids=str)
def test_a_servo_within_a_chain_whose_gain_is_off_is_told_and_does_not_spoil_the_arm(
    fault: dict[str, float], tmp_path: Path
) -> None:
    file = tmp_path / "carried.xml"
    file.write_text(CARRIED, encoding="utf-8")
    watched = observed(str(file), "riemannian_observer", 2.0, **fault)
    settled = slice(round(1.0 / watched.period), None)
    assert not watched.sure_and_wrong
    assert np.sqrt(np.mean(np.square(watched.error[settled, :2]))) < 1e-3
    if not fault:
        assert watched.ok[settled].all()
