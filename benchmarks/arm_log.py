"""Joint velocities from the log of a real arm: the default observer and filters that are tuned on another log.

    python -m benchmarks.arm_log --tune LOG --test LOG --mechanism NAME|FILE.xml --position SIGNALS --inputs SIGNALS

The arm is identified on the log ``--tune`` (``mathnavi identify``), and every rival has the parameter of its grid that
is best there: Butterworth's low-pass of second order of differences, a Kalman filter of constant acceleration, and the
momentum observer with the identified arm. The default observer tunes itself while it runs. All of them get positions,
and those with a model the inputs, of ``--test`` only.

**The reference** is no truth: the slopes of polynomials of fifth degree about each reading, of zero phase, over 0.1 s
on either side. It knows the future, and shares the noise of the readings with the filters, about 1e-3 rad/s for
positions that are rounded to 1e-4 rad at 100 Hz. Velocities that a log has may be estimates of the arm's controller.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import butter, lfilter

from benchmarks.arguments import read_arguments
from mathnavi.commands.errors import one_line
from mathnavi.estimators.identification.local_polynomials import smooth
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.field_table import ValueName
from mathnavi.interfaces.reading.table_format import names_in
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.logs.formats import read_log
from mathnavi.sim.logs.identification import identify
from mathnavi.sim.plugin.registry import load

CUTOFFS = (4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 30.0, 36.0, 42.0, 46.0)  # [Hz]
JERKS = (0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 4.0)  # [rad/s^2.5] square roots of densities
BANDWIDTHS = (15.0, 25.0, 35.0, 45.0, 55.0, 70.0, 90.0)  # [1/s]
HALF_WINDOW, DEGREE = 0.1, 5
SETTLED = 1.0  # [s] from the start of a log


@configuration
class Arguments:
    """Compare observers of joint velocities on the log of a real arm."""

    tune: Annotated[Path, ValueName("LOG")]
    """log on which the arm is identified and the rivals are tuned"""
    test: Annotated[Path, ValueName("LOG")]
    """log on which all are compared"""
    mechanism: Annotated[str, ValueName("NAME|FILE.xml")]
    """arm with the inertial parameters of its links"""
    position: Annotated[str, ValueName("SIGNALS")]
    """signals of the positions of the joints, with commas between them"""
    inputs: Annotated[str, ValueName("SIGNALS")]
    """signals of currents or torques, with commas between them"""
    noise: float = 4e-5
    """standard deviation of a position that the filters assume [rad]"""
    out: Path = Path("renders/out/arm_log.json")
    """file of the figures"""


@dataclass(frozen=True, eq=False)
class ArmLog:
    """Readings of a log and its reference."""

    t: Array  # (n,) [s]
    q: Array  # (n, nv)
    u: Array  # (n, nv)
    reference: Array  # (n, nv) NaN at the ends

    def error(self, v: Array) -> float:
        """Root mean square error [rad/s] of velocities (n, nv), over all joints."""
        judged = np.isfinite(self.reference[:, 0]) & (self.t >= self.t[0] + SETTLED)
        return float(np.sqrt(np.mean(np.square(v - self.reference)[judged])))


def arm_log(path: Path, position: str, inputs: str) -> ArmLog:
    """Read a log whose positions and inputs have the same stamps."""
    own = read_log(path).sensor_log(readings={"q": names_in(position), "u": names_in(inputs)})
    q, u = own.readings["q"], own.readings["u"]
    good = np.isfinite(q).all(axis=1) & np.isfinite(u).all(axis=1)
    t, q, u = own.t[good], q[good], u[good]
    return ArmLog(t, q, u, smooth(t, q, HALF_WINDOW, DEGREE).slope)


def low_pass(log: ArmLog, cutoff: float) -> Array:
    """Velocity by differences through Butterworth's filter of second order."""
    steps = np.diff(log.t)
    b, a = butter(2, cutoff, fs=1.0 / steps.mean())
    v: Array = lfilter(b, a, np.diff(log.q, axis=0) / steps[:, np.newaxis], axis=0)
    return np.vstack([np.zeros(log.q.shape[1]), v])


def constant_acceleration(log: ArmLog, jerk: float, noise: float) -> Array:
    """Velocity by a Kalman filter of (q, v, a) of each joint, a' being white with the density ``jerk``^2."""
    x = np.zeros((3, log.q.shape[1]))
    x[0] = log.q[0]
    P, v = np.diag([noise**2, 1.0, 10.0]), np.zeros_like(log.q)
    for k, h in enumerate(np.diff(log.t), start=1):
        F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        Q = jerk**2 * np.array([
            [h**5 / 20.0, h**4 / 8.0, h**3 / 6.0], [h**4 / 8.0, h**3 / 3.0, h**2 / 2.0], [h**3 / 6.0, h**2 / 2.0, h]
        ])  # fmt: skip
        x, P = F @ x, F @ P @ F.T + Q
        K = P[:, 0] / (P[0, 0] + noise**2)
        x = x + np.outer(K, log.q[k] - x[0])
        P = P - np.outer(K, P[0])
        v[k] = x[1]
    return v


def observed(log: ArmLog, model: mujoco.MjModel, method: str, noise: float, **fields: float) -> Array:
    """Velocity by an observer with the identified arm."""
    period = float(np.median(np.diff(log.t)))
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(noise=noise), period, 20.0)
    plugin = load("estimators", method)
    estimator = plugin.build(plugin.Config(**fields), mission)
    v = []
    for k, t in enumerate(log.t):
        held = 0.5 * (log.u[max(k - 1, 0)] + log.u[k])
        v.append(estimator.update(float(t), [Measurement(POSITION, float(t), log.q[k])], held).x[model.nq :])
    return np.array(v)


def best(log: ArmLog, grid: tuple[float, ...], velocity: Callable[[ArmLog, float], Array]) -> float:
    """Parameter of a grid with the least error on a log."""
    return min(grid, key=lambda value: log.error(velocity(log, value)))


def compare(arguments: Arguments) -> Mapping[str, tuple[str, float]]:
    """Parameter in words and root mean square error [rad/s] on the test, by filter."""
    tune, test = (arm_log(each, arguments.position, arguments.inputs) for each in (arguments.tune, arguments.test))
    position, inputs = names_in(arguments.position), names_in(arguments.inputs)
    model = identify(arguments.tune, arguments.mechanism, position=position, inputs=inputs).model()
    noise = arguments.noise
    rivals: dict[str, tuple[str, tuple[float, ...], Callable[[ArmLog, float], Array]]] = {
        "Butterworth of differences": ("{:g} Hz", CUTOFFS, low_pass),
        "constant-acceleration Kalman": ("{:g} rad/s^2.5", JERKS, lambda log, s: constant_acceleration(log, s, noise)),
        "momentum_observer": (
            "{:g} /s",
            BANDWIDTHS,
            lambda log, w: observed(log, model, "momentum_observer", noise, bandwidth=w),
        ),
    }
    found = {}
    for name, (words, grid, velocity) in rivals.items():
        tuned = best(tune, grid, velocity)
        found[name] = words.format(tuned), test.error(velocity(test, tuned))
    found["riemannian_observer"] = "tunes itself", test.error(observed(test, model, "riemannian_observer", noise))
    return found


def main() -> None:
    arguments = read_arguments(Arguments)
    try:
        found = compare(arguments)
    except (ValueError, OSError) as error:  # no such log, for one: such data are not part of this repository
        print(f"python -m benchmarks.arm_log: {one_line(str(error))}", file=sys.stderr)
        sys.exit(2)
    table = Table(title=f"velocity on {arguments.test}, tuned on {arguments.tune}", box=None)
    for heading in ("filter", "parameter", "error, RMS [rad/s]"):
        table.add_column(heading)
    for name, (parameter, rms) in found.items():
        table.add_row(name, parameter, f"{rms:.5f}")
    Console(markup=False, emoji=False).print(table)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps({name: rms for name, (_, rms) in found.items()}, indent=2))


if __name__ == "__main__":
    main()
