"""What an MJCF file says is what ``arm-velocity`` simulates: its steps are MuJoCo's own of that file, bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Estimate, PlanRequest, Status
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.environments.dm import load_learning
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.scenarios.arm_velocity import VEHICLE, ArmVelocity, ArmVelocityConfig
from mathnavi.sim.scenarios.closed_loop import ClosedLoop

ARM = """<mujoco>{before}<worldbody>{world}<body name="arm" pos="0 0 1"><joint name="a" axis="0 1 0" {joint}/>
<geom name="link" type="capsule" size=".04" fromto="0 0 0 .2 0 -.5" mass="1"/><site name="tip" pos="0 0 -.5"/>
<body name="fore" pos="0 0 -.5"><joint name="b" axis="0 1 0" damping=".1"/>
<geom name="hand" type="box" size=".03 .03 .2" pos="0 0 -.2" mass=".6"/></body></body></worldbody>{after}</mujoco>"""
STIFF = '<actuator><position joint="a" kp="2e5" kv="180" ctrlrange="-2 2"/><motor joint="b"/></actuator>'
MUSCLE = (
    '<actuator><muscle name="m" joint="a" ctrlrange="0 1" force="20" lengthrange="-2 2"/><motor joint="b"/></actuator>'
)
KEY = '<keyframe><key time="3" qpos=".3 .1" qvel=".2 -.1" act=".4" ctrl=".25 -.5"/></keyframe>'


def file(folder: Path, *, before: str = "", world: str = "", joint: str = 'damping=".1"', after: str = "") -> Path:
    path = folder / "arm.xml"
    path.write_text(ARM.format(before=before, world=world, joint=joint, after=after))
    return path


def closed_loop(
    path: Path | str,
    estimator: str = "filtered_differences",
    controller: str = "input_signal",
    estimator_fields: dict[str, Any] | None = None,
    **fields: Any,
) -> ClosedLoop:
    config = ArmVelocityConfig(
        **{"mechanism": str(path), "rate": 500.0, "speed_max": 1e4, "settled": 0.0, "duration": 0.2, **fields}
    )
    observing = PluginSpec.with_fields(load("estimators", estimator), **(estimator_fields or {}))
    return ArmVelocity.build(config, 0, PluginSpec.with_fields(load("controllers", controller)), observing)


def plant_of(loop: ClosedLoop) -> MujocoPlant:
    assert isinstance(loop.plant, MujocoPlant)
    return loop.plant


class Alone:
    """MuJoCo's own simulation of a file, from its first keyframe."""

    def __init__(self, path: Path, tick: float) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.timestep = tick
        self.data = mujoco.MjData(self.model)
        if self.model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, self.data, 0)

    def stepped(self, u: Array, ticks: int) -> None:
        self.data.ctrl[:] = u
        mujoco.mj_step(self.model, self.data, ticks)


def steps_are_mujoco_s(path: Path, plant: MujocoPlant, seconds: float = 0.3) -> bool:
    """Whether the plant steps as MuJoCo does with the file, under the same random controls."""
    alone, rng, ticks = Alone(path, plant.dt), np.random.default_rng(0), max(1, round(0.01 / plant.dt))
    moved = False
    for _ in range(round(seconds / (ticks * plant.dt))):
        u = rng.uniform(-1.0, 1.0, alone.model.nu)
        plant.step({VEHICLE: u}, ticks)
        alone.stepped(u, ticks)
        for field in ("qpos", "qvel", "act", "mocap_pos", "mocap_quat", "eq_active"):
            if not np.array_equal(getattr(alone.data, field), getattr(plant.data, field)):
                return False
        moved |= bool(np.abs(alone.data.qvel).max() > 0.1)
    return moved


@pytest.mark.honoured("MJCF", "option timestep")
@pytest.mark.parametrize(
    ("timestep", "rate", "tick", "period"),
    [
        (0.0006, 1000.0, 0.0002, 0.001),
        (0.0006, 333.333, 0.0006, 0.003),
        (0.0006, 1666.67, 0.0006, 0.0006),
        (1 / 240, 120.0, 1 / 240, 1 / 120),
        (0.002, 1000.0, 0.001, 0.001),
        (0.001, 300.0, 0.001 / 3, 0.01 / 3),
        (0.02, 1000.0, 0.001, 0.001),
    ],
)
def test_a_file_is_stepped_by_its_timestep_or_a_whole_fraction_of_it(
    tmp_path: Path, timestep: float, rate: float, tick: float, period: float
) -> None:
    path = file(tmp_path, before=f'<option timestep="{timestep!r}"/>')
    loop = closed_loop(path, rate=rate, duration=0.05)
    assert plant_of(loop).dt == pytest.approx(tick, rel=1e-12)
    outcome = loop.run()
    spent = np.diff(outcome.t)
    assert spent[:-1] == pytest.approx(period)
    assert 0.05 - 1e-9 <= outcome.t[-1] < 0.05 + tick
    alone = Alone(path, plant_of(loop).dt)
    for u, x, seconds in zip(outcome["command.u"], outcome["truth.x"][1:], spent, strict=False):
        alone.stepped(u, round(seconds / tick))
        assert np.array_equal(np.concatenate([alone.data.qpos, alone.data.qvel]), x)


@pytest.mark.refused("MJCF", "option timestep of zero")
def test_a_clock_that_does_not_fit_is_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = file(tmp_path, before='<option timestep="0.0006"/>')
    with pytest.raises(FieldError, match=r"rate = 437\.0; allowed: .*file, 0\.0006 s.*the nearest is 416\.667 Hz$"):
        closed_loop(path, rate=437.0)
    with pytest.raises(FieldError, match=r"the nearest is 200 Hz"):
        closed_loop(file(tmp_path, before='<option timestep="0.5"/>'), rate=1000.0)
    file(tmp_path, before='<option timestep="0"/>')
    assert main(["run", "arm-velocity", "--mechanism", str(path), "--out", str(tmp_path / "run")]) == 2
    assert "timestep of the model = 0 s; allowed: at least 1e-06 s" in capsys.readouterr().err


def test_a_servo_that_is_stable_at_its_own_timestep_only_says_where_and_when_it_diverges(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = file(tmp_path, before='<option timestep="0.0006" integrator="Euler"/>', joint="", after=STIFF)
    assert closed_loop(good).run().summary["speed_max"] < 100.0
    file(tmp_path, before='<option timestep="0.002" integrator="Euler"/>', joint="", after=STIFF)
    words = ["--mechanism", str(good), "--rate", "500", "--duration", "2", "--out", str(tmp_path / "run")]
    assert main(["run", "arm-velocity", *words, "--controller", "input_signal"]) == 1
    outcome = mn.load(tmp_path / "run")
    (event,) = [event for event in outcome.events if event.kind == "diverged"]
    assert event.agent == VEHICLE
    assert outcome.t[-2] < event.t <= outcome.t[-1] < 1.0
    assert event.message.startswith("the simulation diverged in the joint 'a': an acceleration that is not finite")
    assert outcome.summary["shortfall"] == f"at {event.t:.6g} s {event.message}"
    assert np.isnan(outcome["truth.x"][-1]).all()
    assert np.isfinite(outcome["truth.x"][:-1]).all()
    assert "the simulation diverged" in " ".join(capsys.readouterr().out.split())


def test_an_episode_ends_where_the_simulation_diverges(tmp_path: Path) -> None:
    path = file(tmp_path, before='<option timestep="0.002" integrator="Euler"/>', joint="", after=STIFF)
    environment = load_learning("arm-velocity", mechanism=str(path), rate=500.0, settled=0.0)
    environment.reset()
    step = environment.step(np.ones(2))
    while not step.last():
        step = environment.step(np.ones(2))
    assert environment.info["outcome"] == "diverged"
    assert np.isfinite(step.reward)


FEATURES = {
    "option integrator RK4": {"before": '<option integrator="RK4"/>'},
    "option integrator implicit": {"before": '<option integrator="implicit"/>'},
    "option gravity, wind, density, viscosity": {
        "before": '<option gravity="1 0 -3" wind="2 0 0" density="30" viscosity="0.2" integrator="implicitfast"/>'
    },
    "option solver, iterations, cone, impratio": {
        "before": '<option solver="PGS" iterations="3" cone="elliptic" impratio="5" tolerance="1e-3"/>',
        "world": '<geom type="plane" size="2 2 .1" pos="0 0 .3"/>',
    },
    "option flag gravity, contact": {
        "before": '<option><flag gravity="disable" contact="disable"/></option>',
        "after": '<actuator><motor joint="a" gear="9"/></actuator>',
    },
    "option flag sleep": {
        "before": '<option><flag sleep="enable"/></option>',
        "world": '<geom type="plane" size="2 2 .1"/><body pos="1 0 .2"><freejoint/><geom type="box" size=".1 .1 .1"/>'
        "</body>",
    },
    "option flag override with o_solref": {
        "before": '<option o_solref="0.1 1" o_margin="0.05"><flag override="enable"/></option>',
        "world": '<geom type="plane" size="2 2 .1" pos="0 0 .2"/>',
    },
    "option actuatorgroupdisable": {
        "before": '<option actuatorgroupdisable="1"/>',
        "after": '<actuator><motor joint="a" group="1"/><motor joint="b"/></actuator>',
    },
    "statistic meaninertia": {
        "before": '<option iterations="2"/><statistic meaninertia="1e-4"/>',
        "world": '<geom type="plane" size="2 2 .1" pos="0 0 .3"/>',
    },
    "joint spring, armature, friction loss, limits": {
        "joint": 'stiffness="3" springref="20" armature=".02" frictionloss=".1" range="-10 10" limited="true"'
    },
    "geom contact with a floor of the file": {"world": '<geom type="plane" size="2 2 .1" pos="0 0 .3"/>'},
    "contact pair and exclude": {
        "world": '<geom name="wall" type="box" size=".1 1 1" pos=".2 0 0" contype="0" conaffinity="0"/>',
        "after": '<contact><pair geom1="wall" geom2="hand" solref="0.01 1"/><exclude body1="arm" body2="fore"/>'
        "</contact>",
    },
    "tendon with a spring and limits": {
        "after": '<tendon><fixed stiffness="5" range="-.1 .1" limited="true"><joint joint="a" coef="1"/>'
        '<joint joint="b" coef="-.5"/></fixed></tendon>'
    },
    "equality joint": {"after": '<equality><joint joint1="a" joint2="b" polycoef="0 .5 0 0 0"/></equality>'},
    "equality connect, switched off": {
        "after": '<equality><connect body1="fore" anchor="0 0 -.3" active="false"/></equality>'
    },
    "mocap body that holds a weld": {
        "world": '<body name="target" mocap="true" pos=".1 0 .2"/>',
        "after": '<equality><weld body1="fore" body2="target"/></equality>'
        '<keyframe><key mpos=".2 0 .1" qpos=".1 .2"/></keyframe>',
    },
    "gravity compensation": {"before": "<default><joint actuatorgravcomp='true'/></default>"},
    "actuator muscle": {"after": MUSCLE},
    "actuator filter": {"after": '<actuator><general joint="a" dyntype="filter" dynprm=".05" gainprm="9"/></actuator>'},
    "actuator filterexact": {"after": '<actuator><position joint="a" kp="30" timeconst=".05"/></actuator>'},
    "actuator integrator with actlimited": {
        "after": '<actuator><intvelocity joint="a" kp="30" actrange="-.01 .01"/></actuator>'
    },
    "actuator damper": {"after": '<actuator><damper joint="a" kv="3" ctrlrange="0 1"/></actuator>'},
    "actuator adhesion": {
        "world": '<geom type="plane" size="2 2 .1" pos="0 0 .3"/>',
        "after": '<actuator><adhesion body="fore" ctrlrange="0 1" gain="5"/><motor joint="a"/></actuator>',
    },
    "actuator with several controls": {
        "after": '<actuator><dcmotor joint="a" motorconst="2" resistance=".5" input="pos vel" controller="9 0 1"/>'
        '<motor joint="b"/></actuator>'
    },
    "actuator delay": {"after": '<actuator><motor joint="a" delay=".01" nsample="8"/></actuator>'},
    "actuator user": {"after": '<actuator><general joint="a" dyntype="user" actdim="1" gainprm="9"/></actuator>'},
    "actuator on a site": {"after": '<actuator><motor site="tip" gear="3 0 1 0 0 0"/></actuator>'},
    "keyframe act, ctrl, qvel": {"after": MUSCLE + KEY},
}


@pytest.mark.parametrize(
    "parts",
    [pytest.param(parts, id=name, marks=pytest.mark.honoured("MJCF", name)) for name, parts in FEATURES.items()],
)
def test_the_steps_are_mujoco_s_own(tmp_path: Path, parts: dict[str, str]) -> None:
    path = file(tmp_path, **parts)
    assert steps_are_mujoco_s(path, plant_of(closed_loop(path)))


@pytest.mark.honoured("MJCF", "keyframe ctrl")
def test_the_first_keyframe_is_the_start_and_the_default_command(tmp_path: Path) -> None:
    outcome = closed_loop(file(tmp_path, after=MUSCLE + KEY)).run()
    np.testing.assert_array_equal(outcome["truth.x"][0], [0.3, 0.1, 0.2, -0.1])
    np.testing.assert_array_equal(outcome["truth.activation"][0], [0.4])
    np.testing.assert_array_equal(outcome["command.u"], np.tile([0.25, -0.5], (len(outcome.t), 1)))
    assert outcome.t[0] == 0.0
    servo = '<actuator><position joint="a" kp="90"/><position joint="b" kp="90"/></actuator>'
    key = '<keyframe><key qpos=".3 .1" ctrl=".25 -.5"/></keyframe>'
    agent = closed_loop(file(tmp_path, after=servo + key), "riemannian_observer", "joint_tracking").agents[VEHICLE]
    assert agent.command is not None
    assert agent.command.tolist() == [0.25, -0.5]
    unknown = Estimate(0.0, np.zeros(4), status=Status.INITIALISING)
    plan = agent.planner.plan(PlanRequest(0.0, 0.0, unknown, None))
    assert agent.tracker.command(0.0, unknown, plan).tolist() == [0.25, -0.5]


@pytest.mark.honoured("MJCF", "activations in the log")
def test_activations_are_logged_by_name_and_read_again(tmp_path: Path) -> None:
    path = file(tmp_path, after=MUSCLE + KEY)
    outcome = closed_loop(path).run()
    alone, found = Alone(path, 0.002), []
    for u in outcome["command.u"]:
        found.append(alone.data.act.copy())
        alone.stepped(u, 1)
    np.testing.assert_array_equal(outcome["truth.activation"], found)
    again = mn.load(outcome.save(tmp_path / "run"))
    np.testing.assert_array_equal(again["truth.activation"], outcome["truth.activation"])
    assert again.recording.activation_names == {VEHICLE: ("activation_m [-]",)}
    assert "truth.activation" not in closed_loop(file(tmp_path)).run().arrays


@pytest.mark.refused("MJCF", "actuators with states, by estimators that model forces")
@pytest.mark.parametrize(
    ("estimator", "fields"),
    [
        ("riemannian_observer", {}),
        ("high_gain", {}),
        ("momentum_observer", {}),
        ("lagrangian_ekf", {}),
        ("lagrangian_ukf", {}),
        ("moving_horizon", {}),
        ("full_state", {"rate": 100.0}),
    ],
)
def test_an_estimator_that_does_not_model_them_is_refused_before_the_run(
    tmp_path: Path, estimator: str, fields: dict[str, Any]
) -> None:
    path = file(tmp_path, after=MUSCLE)
    message = rf"^estimator = {estimator}.* of the actuators m, which it does not model; allowed: filtered_differences"
    with pytest.raises(FieldError, match=message):
        closed_loop(path, estimator, estimator_fields=fields)


@pytest.mark.refused("MJCF", "actuators with states, by a tracker that inverts them")
def test_a_tracker_that_does_not_model_them_is_refused_and_a_system_has_no_force(tmp_path: Path) -> None:
    path = file(tmp_path, after=MUSCLE)
    with pytest.raises(FieldError, match=r"^controller = joint_tracking.* m, which it does not model; allowed: input_"):
        closed_loop(path, controller="joint_tracking")
    system, x = mn.MechanismSystem(mujoco.MjModel.from_xml_path(str(path))), np.zeros(4)
    for call in (system.force, system.step):
        with pytest.raises(FieldError, match="states or delays of the actuators m"):
            call(x[:2], x[2:], x[:2], *([0.01] if call == system.step else []))


@pytest.mark.honoured("MJCF", "files of dm_control with filters and muscles")
def test_names_of_dm_control_that_are_listed_are_simulated(tmp_path: Path) -> None:
    outcome = closed_loop("dm_control:quadruped", duration=0.02).run()
    assert outcome["truth.activation"].shape == (11, 12)
    with pytest.raises(FieldError, match=r"dm_control:NAME of its suite \(acrobot, .*dog, .*humanoid_CMU, manipulator"):
        closed_loop("dm_control:nosuch")
