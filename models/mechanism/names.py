"""The mechanisms that come with the software."""

from typing import Literal

MechanismName = Literal["rigid-body", "cart-pendulum", "two-link", "seven-joint"]
