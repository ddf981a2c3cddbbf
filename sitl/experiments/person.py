"""The person beside the rover, who sets GUIDED and arms where the companion waits for that.

Nouns: person.
"""

from __future__ import annotations

from companion.safety.reasons import Activity
from sitl.autopilot.modes import arm, arming_faults, set_mode
from sitl.autopilot.state import Mode
from sitl.lockstep import Drive

PERSON_S = 8.0
"""So long the person looks before doing what the companion waits for."""
PATIENCE = 5
"""So often in a row the person tries."""


class Person:
    """Looks on; helps when asked to for long enough, and no pilot has the rover.

    ``helped``: how often. ``gave_up``: why the rover was carried home, if it was.
    """

    def __init__(self) -> None:
        self.helped = 0
        self.gave_up = ""
        self._asked_s: float | None = None
        self._in_vain = 0

    def look(self, drive: Drive, activity: Activity) -> None:
        """To be called often."""
        now_s = drive.simulator.time_s
        if not activity.needs_person or drive.simulator.pilot_acts:
            self._asked_s = None
            return
        self._asked_s = now_s if self._asked_s is None else self._asked_s
        if now_s - self._asked_s < PERSON_S:
            return
        vehicle = drive.simulator.vehicle
        self._asked_s = None
        if set_mode(vehicle, Mode.GUIDED) and arm(vehicle):
            self.helped, self._in_vain = self.helped + 1, 0
            return
        self._in_vain += 1
        if self._in_vain == PATIENCE:
            faults = "; ".join(fault.text for fault in arming_faults(vehicle))
            self.gave_up = faults or "GUIDED refused"
            drive.companion.stop()
