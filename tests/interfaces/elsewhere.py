"""Base class whose types have names that mean nothing in the modules of its subclasses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Size = Literal["small", "large"]


@dataclass(frozen=True)
class Base:
    size: Size
    """of the whole"""
