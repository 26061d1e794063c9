"""Steps without collision detection and constraints, while nothing is near enough to touch.

Both are a third of the cost of a step of a point mass, four times a step, and in most of a flight they find nothing to
do. A survey detects collisions once, within a distance M: if it finds none, nothing touches anything before it has
moved by M - m, m the distance at which the model's own margins begin a contact, and until then steps without
constraints are the same, bit for bit. Passive forces are not computed either in a model that has none.
"""

from __future__ import annotations

import copy
import math

import mujoco

_NO_CONSTRAINTS = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)  # contacts among them
_NO_PASSIVE_FORCES = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
_ONE_MARGIN = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_FARTHEST, _NEAREST = 256.0, 1.0  # [m] margins
_PAUSE = 8  # calls without a survey after one that found something even with a small margin


class ContactFree:
    """Surveys of one simulation in which nothing moves but a vehicle on slide joints, with forces held over a step.

    ``model`` is a copy without constraints, and without passive forces if none act, to step ``data`` with. It is a copy
    because other simulations may step the original at the same time; a later change of the original does not affect it.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model = copy.copy(model)
        self.model.opt.disableflags |= _NO_CONSTRAINTS
        if not _resisted(model):  # terms that are zero are not computed
            self.model.opt.disableflags |= _NO_PASSIVE_FORCES
        self._surveyed = mujoco.MjData(self.model)
        self._q, self._v = data.qpos, data.qvel
        self._spread = math.sqrt(len(self._v))  # a point moves by the norm of q, times this where axes are not square
        self._begins = _contact_distance(model)
        self._origin = self._q.tolist()
        self._free = -math.inf  # [m] from the origin within which nothing touches
        self._margin = 0.25 * _FARTHEST  # [m] of the last survey
        self._pause = 0

    @staticmethod
    def applies(model: mujoco.MjModel, slides: int) -> bool:
        """Return True if only this number of slide joints of a vehicle move, only contacts constrain it, only motors
        act on it, and no mocap body collides.

        A spring, a servo or a callback of MuJoCo may exert a force that changes within a step.
        """
        colliding = (model.geom_contype | model.geom_conaffinity) != 0
        moved_from_outside = model.body_mocapid[model.body_rootid[model.geom_bodyid]] >= 0
        constrained = model.neq or model.ntendon or model.jnt_limited.any() or model.dof_frictionloss.any()
        springs = model.jnt_stiffness.any() or model.jnt_stiffnesspoly.any()
        pulled = springs or _actuated_unevenly(model) or _called_back()
        visited = (colliding & moved_from_outside).any() or (model.npair and model.nmocap)
        alone = model.nv == slides and model.nflex == 0 and not visited
        return bool(alone and not constrained and not pulled)

    def ahead(self, duration: float) -> bool:
        """Return True if nothing can touch anything in the next ``duration`` [s], unless the vehicle becomes much
        faster.
        """
        if self.within(duration):
            return True
        if self._pause:
            self._pause -= 1
            return False
        self._origin = self._q.tolist()
        least = max(2.0 * self._reach(duration), _NEAREST)
        margin = min(2.0 * self._margin, _FARTHEST)
        while margin >= least:
            if self._nothing_within(margin + self._begins):
                self._free = self._margin = margin
                return True
            margin *= 0.5
        self._free, self._margin, self._pause = -math.inf, max(margin, _NEAREST), _PAUSE
        return False

    def within(self, duration: float) -> bool:
        """Return True if all that the vehicle can reach in ``duration`` [s] at twice its speed is free.

        If that holds before and after a step of that duration, it was within at all stages of the step: under a force
        that is held, the speed along an axis is never greater than at both ends.
        """
        return self._reach(duration) <= self._free

    def _reach(self, duration: float) -> float:
        return self._spread * (
            math.dist(self._q.tolist(), self._origin) + 2.0 * duration * math.hypot(*self._v.tolist())
        )

    def _nothing_within(self, margin: float) -> bool:
        model, data = self.model, self._surveyed
        data.qpos = self._origin
        model.opt.disableflags &= ~_NO_CONSTRAINTS
        model.opt.enableflags |= _ONE_MARGIN
        model.opt.o_margin = margin
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        model.opt.enableflags &= ~_ONE_MARGIN
        model.opt.disableflags |= _NO_CONSTRAINTS
        return int(data.ncon) == 0


def _contact_distance(model: mujoco.MjModel) -> float:
    """Greatest distance [m] at which a contact begins: the sum of the margins of two geoms, or the margin of a pair."""
    if model.opt.enableflags & _ONE_MARGIN:
        return float(model.opt.o_margin)
    return max(2.0 * float(model.geom_margin.max(initial=0.0)), float(model.pair_margin.max(initial=0.0)))


def _actuated_unevenly(model: mujoco.MjModel) -> bool:
    """Return True if the force of an actuator may change while its control is held."""
    of_the_state = model.actuator_gaintype.any() or model.actuator_biastype.any() or model.na
    late = model.actuator_delay.any()
    return bool(of_the_state or late or (model.actuator_trntype != _JOINT).any())


def _called_back() -> bool:
    """Return True if user code acts within the steps."""
    callbacks = (mujoco.get_mjcb_passive(), mujoco.get_mjcb_control(), mujoco.get_mjcb_contactfilter())
    gains = (mujoco.get_mjcb_act_gain(), mujoco.get_mjcb_act_bias())
    return any(each is not None for each in (*callbacks, *gains))


def _resisted(model: mujoco.MjModel) -> bool:
    """Return True if passive forces other than springs act: dampers, a fluid, a plug-in, or forces against gravity."""
    dampers = (model.dof_damping, model.dof_dampingpoly, model.actuator_damping, model.actuator_dampingpoly)
    fluid = model.opt.density or model.opt.viscosity
    return bool(any(each.any() for each in dampers) or fluid or model.body_gravcomp.any() or model.nplugin)
