"""Textbook systems by name."""

from __future__ import annotations

from mathnavi.models.textbook.camera_and_flags import camera_and_flags
from mathnavi.models.textbook.example_2_1 import EXAMPLE_2_1
from mathnavi.models.textbook.example_2_2 import EXAMPLE_2_2
from mathnavi.models.textbook.kazantzis_kravaris import KAZANTZIS_KRAVARIS
from mathnavi.models.textbook.krener_isidori import KRENER_ISIDORI
from mathnavi.models.textbook.system import System

SYSTEMS: dict[str, System] = {
    system.name: system for system in (EXAMPLE_2_1, EXAMPLE_2_2, camera_and_flags(), KRENER_ISIDORI, KAZANTZIS_KRAVARIS)
}
