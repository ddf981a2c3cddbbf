"""A lidar on the port that was given as the autopilot's: told by the bytes that come there."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from companion.diagnosis.finding import Finding, Level
from companion.lidar.models import MODELS
from companion.lidar.trouble import senders_of

NAME = "lidars-port"
REMEDY = "give --connect the autopilot's port, and --lidar this one"
INSTEAD_OF = ("no-autopilot", "port-damaged")
"""Findings that this one explains."""
FAMILIAR_S = 4.0
"""So long a run waits before it looks what the bytes are that come."""


def lidar_says(place: str, sample: bytes) -> str:
    """That a lidar sends here, in words without a full stop; empty if these bytes are no lidar's."""
    senders = senders_of(sample)
    return senders and f"{place} sends a lidar's data (those of {senders}): it is not the autopilot's port"


def findings_of_port(place: str, sample: bytes, listen: Callable[[int], bytes] | None) -> Iterator[Finding]:
    """The finding of the doctor. ``sample``: as in ``StrangePort.look``.

    ``listen``: what comes on this port at another baud rate, for at a wrong one all bytes are only noise; None for a
    link without.
    """
    speeds = sorted({one.baud for one in MODELS}) if sample and listen is not None else []
    for data in (sample, *map(listen or bytes, speeds)):
        if says := lidar_says(place, data):
            yield Finding(NAME, Level.STOP, f"{says}.", REMEDY)
            return


class StrangePort:
    """Tells once, while a run waits for a first packet, what comes on its link instead."""

    def __init__(self, place: str, tell: Callable[[str], None]) -> None:
        self._place = place
        self._tell = tell
        self._look_s: float | None = None

    def look(self, now_s: float, sample: bytes) -> None:
        """Call in every tick. ``sample``: the newest bytes of a link on which no packet has come yet."""
        if not sample:
            self._look_s = None
            return
        self._look_s = now_s + FAMILIAR_S if self._look_s is None else self._look_s
        if now_s < self._look_s:
            return
        self._look_s = float("inf")
        other = f"{self._place}: bytes come, but no MAVLink; look at port and baud rate, or ask the doctor"
        says = lidar_says(self._place, sample)
        self._tell(f"{says}; {REMEDY}" if says else other)
