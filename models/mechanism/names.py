"""Names of the mechanisms that come with the software."""

from typing import Literal

MechanismName = Literal["rigid-body", "cart-pendulum", "two-link", "seven-joint"]
"""names of mechanisms with a torque motor on each joint, or about each of its axes"""

ServoArmName = Literal["servo-six", "servo-seven", "servo-gripper"]
"""names of arms with stiff position servos, joint limits, damping, armature and friction, like industrial robots"""

FloatingName = Literal["swimmer", "quadruped"]
"""names of mechanisms with a free base: a planar chain of six links in a viscous fluid with a torque motor on each of
its hinges, and a robot on four legs with position servos, an IMU and foot switches"""
