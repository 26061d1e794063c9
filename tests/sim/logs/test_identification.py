"""Identification of an arm from its log, against the arm that made it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.identification.identify import Identification
from mathnavi.models.mechanism.driven_joints import DrivenJoint, driven_spec
from mathnavi.models.mechanism.entity import build_model
from mathnavi.sim.logs.identification import identify

TRUE = (
    DrivenJoint(gain=11.0, armature=0.8, damping=2.0, friction=3.0, offset=0.4),
    DrivenJoint(gain=-6.0, armature=0.3, damping=0.9, friction=1.2, offset=-0.2),
)
PERIOD = 0.002
POSITION, INPUTS = ["q0", "q1"], ["i0", "i1"]


@cache
def recorded(seed: int, duration: float = 14.0, late: int = 0, noise: float = 0.02) -> mn.RecordedLog:
    """Log at 100 Hz of a two-link arm that a PD controller moves; the currents are stamped ``late`` samples late."""
    rng = np.random.default_rng(seed)
    model = driven_spec("two-link", TRUE).compile()
    model.opt.timestep = PERIOD
    data = mujoco.MjData(model)
    rates, phases = rng.uniform(0.15, 0.6, (3, 2)), rng.uniform(0.0, 2.0 * np.pi, (3, 2))
    rows = []
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        wanted = (0.6 * np.sin(2.0 * np.pi * rates * t + phases)).sum(axis=0)
        torque = 300.0 * (wanted - data.qpos) - 30.0 * data.qvel
        data.ctrl[:] = [each / own.gain for each, own in zip(torque, TRUE, strict=True)]
        rows.append(np.concatenate([[t], data.qpos, data.ctrl]))
        mujoco.mj_step(model, data)
    rows = np.array(rows)[:: round(0.01 / PERIOD)]
    rows[:, 1:3] = np.round(rows[:, 1:3], 4)
    rows[:, 3:] = np.roll(rows[:, 3:], late, axis=0) + noise * rng.standard_normal((len(rows), 2))
    rows = rows[max(late, 0) :]
    signals = ("q0 [rad]", "q1 [rad]", "i0 [A]", "i1 [A]")
    return mn.RecordedLog("arm.csv", "table", {"table": mn.Channel(rows[:, 0], rows[:, 1:], signals)}, "made")


@cache
def identified(seed: int = 0) -> Identification:
    return identify(recorded(seed), "two-link", position=POSITION, inputs=INPUTS, test=recorded(100, 5.0))


def values() -> np.ndarray:
    return np.array([[own.gain, own.armature, own.damping, own.friction, own.offset] for own in TRUE])


def test_it_finds_the_parameters_of_the_arm_that_made_the_log() -> None:
    found = np.array([own.theta for own in identified().fits])
    assert found == pytest.approx(values(), rel=0.05, abs=0.05)


def test_intervals_hold_the_truth() -> None:
    """Of 30 intervals of 95 % that are partly dependent at least 24."""
    inside = 0
    for seed in range(3):
        for own, true in zip(identified(seed).fits, values(), strict=True):
            least, most = own.interval
            inside += int(((least <= true) & (true <= most)).sum())
    assert inside >= 24


def test_it_fits_a_motion_that_it_was_not_fitted_to() -> None:
    (tested,) = identified().tested
    assert (tested.share > 0.99).all()
    assert (tested.rms < 0.04).all()  # of noise of 0.02 A, some of which is smoothed away


def test_a_wrong_model_is_seen_on_the_other_motion(tmp_path: Path) -> None:
    """With links that are twice as heavy and friction at one joint alone, what is left grows."""
    log = recorded(0)
    table = log.channels["table"]
    squared = table.values.copy()
    squared[:, 3] += 0.5 * np.sign(np.gradient(squared[:, 1])) * squared[:, 1] ** 2
    other = mn.RecordedLog("arm.csv", "table", {"table": mn.Channel(table.t, squared, table.signals)}, "made")
    found = identify(other, "two-link", position=POSITION, inputs=INPUTS, test=recorded(100, 5.0))
    assert found.tested[0].rms[1] > 5.0 * identified().tested[0].rms[1]


def test_the_time_offset_of_the_currents_is_found() -> None:
    own = identify(recorded(0, late=2), "two-link", position=POSITION, inputs=INPUTS)
    right = identified()
    assert own.offset - right.offset == pytest.approx(0.02, abs=0.004)
    assert abs(right.offset) < 0.006  # half a period of the control, at most


def test_the_observer_takes_the_identified_model() -> None:
    log = recorded(100, 5.0).channels["table"]
    errors = {}
    for name, model in (("identified", identified().model()), ("nominal", build_model("two-link"))):
        observer, found = mn.VelocityObserver(model, "momentum_observer", noise=5e-5, bandwidth=10.0), []
        for k, (q, u) in enumerate(zip(log.values[:, :2], log.values[:, 2:], strict=True)):
            found.append(observer.step(0.01 if k else 0.0, q, u).velocity)
        reference = np.gradient(log.values[:, :2], log.t, axis=0)
        errors[name] = np.sqrt(np.mean(np.square(np.array(found) - reference)[100:]))
    assert errors["identified"] < 0.05
    assert errors["identified"] < 0.2 * errors["nominal"]


def test_what_a_motion_does_not_show_is_said() -> None:
    """A joint at a constant rate shows one torque, and not how much of it is damping, friction and offset."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 10.0, 0.01)
    q = np.column_stack([0.5 * np.sin(2.0 * t), 0.4 * t])
    u = np.column_stack([q[:, 0], 1.0 + 0.0 * t]) + 0.01 * rng.standard_normal((len(t), 2))
    signals = ("q0 [rad]", "q1 [rad]", "i0 [A]", "i1 [A]")
    log = mn.RecordedLog("arm.csv", "table", {"table": mn.Channel(t, np.column_stack([q, u]), signals)}, "made")
    found = identify(log, "two-link", position=POSITION, inputs=INPUTS, gains=(1.0,), hold_out=0.0)
    assert [each for each in found.remarks() if "elbow: the motion does not tell apart" in each]
    assert not [each for each in found.remarks() if "shoulder: the motion does not tell apart" in each]


def test_a_gain_that_is_given_is_held() -> None:
    found = identify(recorded(0), "two-link", position=POSITION, inputs=INPUTS, gains=(11.0, -6.0))
    assert [own.theta[0] for own in found.fits] == [11.0, -6.0]
    assert np.isnan(found.fits[0].deviation[0])
    assert np.array([own.theta for own in found.fits]) == pytest.approx(values(), rel=0.05, abs=0.05)


@pytest.mark.parametrize(
    ("position", "inputs", "fields", "message"),
    [
        (["q0"], INPUTS, {}, "arm.csv has 1 positions; allowed: 2, of the joints"),
        (POSITION, ["i0", "i2"], {}, "it has no signal 'i2'"),
        (POSITION, INPUTS, {"gains": (1.0, 2.0, 3.0)}, "gains = (1.0, 2.0, 3.0); allowed: one number, or 2, of"),
        (POSITION, INPUTS, {"half_window": 0.001}, "have enough others within 0.001 s"),
        (POSITION, INPUTS, {"slowest": 100.0}, "moves faster than 100 rad/s in 0 samples; allowed: 50 or more"),
    ],
)
def test_what_cannot_be_identified_is_refused(
    position: list[str], inputs: list[str], fields: dict[str, object], message: str
) -> None:
    with pytest.raises((mn.LogError, mn.FieldError)) as caught:
        identify(recorded(0), "two-link", position=position, inputs=inputs, **fields)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
