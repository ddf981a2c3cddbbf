"""How severe a text for people is: the eight levels of MAVLink (MAV_SEVERITY) and syslog."""

from __future__ import annotations

from enum import IntEnum


class Severity(IntEnum):
    """The smaller, the worse."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7
