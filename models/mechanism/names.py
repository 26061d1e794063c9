"""The mechanisms that come with the software."""

from typing import Literal

MechanismName = Literal["rigid-body", "cart-pendulum", "two-link", "seven-joint"]
"""Mechanisms with a torque motor on each joint, or about each of its axes."""

ServoArmName = Literal["servo-six", "servo-seven", "servo-gripper"]
"""Arms with stiff position servos, joint limits, damping, armature and friction, as industrial robots have them."""

FloatingName = Literal["swimmer", "quadruped"]
"""Mechanisms that nothing holds: a planar chain of six links in a viscous fluid with a torque motor on each of its
hinges, and a robot on four legs with position servos, an IMU and foot switches."""
