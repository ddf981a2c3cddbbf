"""Log lines of the physics: starts of the firmware, collisions, unexpected datagrams; a summary at the end."""

from __future__ import annotations

from collections.abc import Callable

from sitl.firmware.physics import Physics
from sitl.network.collision_log import CollisionLog


class PhysicsLog:
    """Reports what has happened since the last look, one line each, to ``tell``; ``now_s`` reads real seconds."""

    def __init__(self, physics: Physics, tell: Callable[[str], None], now_s: Callable[[], float]) -> None:
        self._physics = physics
        self._tell = tell
        self._starts = 0
        self._reported: set[str] = set()
        self._collisions = CollisionLog(tell, now_s)

    def look(self) -> None:
        """Report what is new."""
        tally = self._physics.tally
        if tally.starts != self._starts:
            again = "again: the rover is back at its start, the time is 0" if self._starts else "and is answered"
            self._tell(f"the firmware has started {again}")
            self._starts = tally.starts
            self._collisions.forget()
        if tally.bad:
            self._tell_once("a datagram was no frame of ArduPilot's JSON interface; ignored, like all that follow")
        if tally.strangers:
            self._tell_once(
                "a second firmware asks at the same port; ignored: start another physics with its own --port for it"
            )
        if tally.lost:
            self._tell_once("frames were lost; the rover's time does not count them")
        self._collisions.look(self._physics.collisions, self._physics.start)

    def end(self) -> None:
        """The last look: report the collisions that have not been told."""
        self._collisions.look(self._physics.collisions, self._physics.start, last=True)

    def _tell_once(self, line: str) -> None:
        if line not in self._reported:
            self._reported.add(line)
            self._tell(line)


def summary(physics: Physics) -> str:
    """One line about everything that was received."""
    tally, collisions = physics.tally, len(physics.collisions)
    counts = {
        "steps": tally.steps, "asked again": tally.repeated, "lost": tally.lost, "late": tally.late,
        "from another firmware": tally.strangers, "not frames": tally.bad,
    }  # fmt: skip
    frames = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    if not tally.starts:
        return f"stopped; no firmware has asked{f' ({frames})' if frames else ''}"
    touched = f"{collisions} collision{'s' if collisions != 1 else ''}"
    return f"stopped; {frames}; since the firmware's last start {physics.time_s:.0f} s and {touched}"
