"""Names of what is read of beacons, by a robot on the ground and by a vehicle in the air, and of the sensors of it."""

from __future__ import annotations

from typing import Literal

BeaconKind = Literal["ranges", "bearings", "range-differences"]
RANGES, BEARINGS, DIFFERENCES = "beacon_ranges", "beacon_bearings", "beacon_differences"
"""names of the sensors, in the order of their kinds 0, 1 and 2"""
SENSORS: dict[BeaconKind, str] = {"ranges": RANGES, "bearings": BEARINGS, "range-differences": DIFFERENCES}
"""sensor of each kind of readings, in their order"""
