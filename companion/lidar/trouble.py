"""Why a lidar gives no views, by what was heard of it: in one set of words for doctor, run and lidar.

Nouns: lidar trouble.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.lidar.models import MODELS, LidarModel
from companion.lidar.reader import LidarReader

BAD_SHARE = 0.5
"""Of the bytes of another model some may look like readings."""
SOME_POINTS = 24
"""So many readings from a sample are no chance: other bytes hardly ever look like a packet twice."""
MAVLINK_2, MAVLINK_1 = 0xFD, 0xFE
MAVLINK_REST = {MAVLINK_2: 12, MAVLINK_1: 8}
"""Bytes of a packet besides its payload."""
MAVLINK_ROW = 4
"""Packets that follow each other without a gap."""


@dataclass(frozen=True, slots=True)
class LidarTrouble:
    """``name``: of the doctor's finding; ``says``: with the lidar and its port in front, without a full stop."""

    name: str
    says: str
    remedy: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.says}; {self.remedy}"


def trouble(reader: LidarReader) -> LidarTrouble | None:
    """What is wrong with a lidar that was listened to for a while; None if it has seen something."""
    who, counted, model = f"{reader.name} on {reader.spec.port}", reader.counters, reader.spec.model
    if not counted.bytes:
        remedy = "look at its power and cable, and that this is its port (`ls -l /dev/serial/by-id`)"
        return LidarTrouble("lidar-silent", f"{who}: nothing comes", remedy)
    if not counted.scans and counted.bad_bytes > BAD_SHARE * counted.bytes:
        share = "hardly any" if counted.points else "none"
        says = f"{who}: bytes come, but {share} is a packet of {_an(model.name)}"
        return LidarTrouble("lidar-unreadable", says, _instead(reader.sample, model))
    if not counted.scans:
        says, remedy = f"{who}: readings come, but no whole turns", "look whether its motor turns: it needs 5 V, 0.5 A"
        return LidarTrouble("lidar-stalled", says, remedy)
    if not reader.saw:
        says = f"{who}: turns come, but hardly an echo: open ground, or it is covered, masked or dazzled"
        remedy = "look at its window, at mask and min, and away from the sun; on open ground give it empty=5"
        return LidarTrouble("lidar-no-echo", says, remedy)
    return None


def _instead(sample: bytes, model: LidarModel) -> str:
    """What these bytes are, as far as that can be told. At a wrong speed of the line they are only noise."""
    if _is_mavlink(sample):
        return "they are MAVLink: is this the autopilot's port? Give the lidar's own"
    if found := senders_of(sample, model):
        return f"they are those of {found}: give --lidar that model"
    others = [one for one in MODELS if one.decoder is not model.decoder]
    names = ", ".join(one.name for one in others)
    return f"is it another model ({names}), or is something else on this port?"


def senders_of(sample: bytes, besides: LidarModel | None = None) -> str:
    """Which lidars send such bytes, in words; empty for none. ``besides``: of one that speaks otherwise than this."""
    others = [one for one in MODELS if besides is None or one.decoder is not besides.decoder]
    found = [one.name for one in others if len(one.decoder().feed(sample)) >= SOME_POINTS]
    return " or ".join(map(_an, found))


def _is_mavlink(sample: bytes) -> bool:
    return any(_row_from(sample, at) for at, byte in enumerate(sample) if byte in MAVLINK_REST)


def _row_from(sample: bytes, at: int) -> bool:
    for _ in range(MAVLINK_ROW):
        if at + 1 >= len(sample) or sample[at] not in MAVLINK_REST:
            return False
        at += sample[at + 1] + MAVLINK_REST[sample[at]]
    return True


def _an(name: str) -> str:
    return f"an {name}" if name[0] in "LR" else f"a {name}"
