"""GPS fix: how good a receiver says that its position is.

Nouns: GPS fix.
"""

from __future__ import annotations

from enum import IntEnum
from types import MappingProxyType


class GpsFix(IntEnum):
    """By GPS_FIX_TYPE; a larger one is better."""

    NO_GPS = 0
    NO_FIX = 1
    FIX_2D = 2
    FIX_3D = 3
    DGPS = 4
    RTK_FLOAT = 5
    RTK_FIXED = 6

    @property
    def text(self) -> str:
        """For people."""
        return TEXTS[self]

    @property
    def is_position(self) -> bool:
        """Whether an autopilot uses the receiver's position."""
        return self >= GpsFix.FIX_3D


TEXTS = MappingProxyType(
    dict(zip(GpsFix, ("no GPS", "no fix", "2D", "3D", "3D DGPS", "RTK float", "RTK fixed"), strict=True))
)
NEEDED = MappingProxyType(
    {"3d": GpsFix.FIX_3D, "dgps": GpsFix.DGPS, "rtk-float": GpsFix.RTK_FLOAT, "rtk-fixed": GpsFix.RTK_FIXED}
)
"""The fix that a value of ``safety.gps_fix`` asks for; ``any`` asks for none."""
STATIC, PPP = 7, 8


def gps_fix_of(fix_type: int) -> GpsFix:
    """The fix of a GPS_RAW_INT. A static or PPP fix counts as DGPS: better than 3D, not RTK. Unknown ones are none."""
    if fix_type in (STATIC, PPP):
        return GpsFix.DGPS
    return GpsFix(fix_type) if fix_type in TEXTS else GpsFix.NO_FIX
