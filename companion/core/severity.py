"""How severe a text for people is (the eight levels of MAV_SEVERITY and syslog), and what takes such texts."""

from __future__ import annotations

from enum import IntEnum
from typing import Protocol


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


class TextSink(Protocol):
    """Takes texts for people: the ``Notifier``, or what stands in for it."""

    def tell(self, text: str, severity: Severity) -> None:
        """One text."""
        ...
