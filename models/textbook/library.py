"""The systems by name."""

from __future__ import annotations

from models.textbook.camera_and_flags import camera_and_flags
from models.textbook.example_2_1 import EXAMPLE_2_1
from models.textbook.example_2_2 import EXAMPLE_2_2
from models.textbook.kazantzis_kravaris import KAZANTZIS_KRAVARIS
from models.textbook.krener_isidori import KRENER_ISIDORI
from models.textbook.system import System

SYSTEMS: dict[str, System] = {
    system.name: system for system in (EXAMPLE_2_1, EXAMPLE_2_2, camera_and_flags(), KRENER_ISIDORI, KAZANTZIS_KRAVARIS)
}
