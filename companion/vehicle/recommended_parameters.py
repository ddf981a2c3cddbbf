"""ArduRover's parameters as the companion wants them: the doctor names what differs, the simulated rover has them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

RECOMMENDED_PARAMETERS: Mapping[str, float] = MappingProxyType(
    {
        # The companion goes round obstacles; the autopilot's own avoidance would work against it.
        "OA_TYPE": 0.0,
        "AVOID_ENABLE": 0.0,
        # Metres: it aims far ahead, and a small radius keeps the rover on its line.
        "WP_RADIUS": 1.0,
        # m/s³: with 0 it is WP_ACCEL's number, which is usually 1, and every approach takes longer.
        "WP_JERK": 3.0,
    }
)
"""What holds for every rover and mission."""
