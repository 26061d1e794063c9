"""Bounds of fields that planners of flight share; the upper limits are what still fits a machine."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from mathnavi.interfaces.bounds import Within

Nodes = Annotated[int, Within(Interval(ge=2, le=121), allowed="2 to 121")]
GridNodes = Annotated[int, Within(Interval(ge=3, le=513), allowed="3 to 513")]
GridLayers = Annotated[int, Within(Interval(ge=2, le=65), allowed="2 to 65")]
