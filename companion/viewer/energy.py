"""Energy that the rover has drawn from its first battery, from the current and voltage that the autopilot reports.

Nouns: energy.
"""

from __future__ import annotations

from companion.vehicle.events import BatterySeen

MOST_S = 10.0
"""A reading stands for no longer than this: what was drawn in a longer silence is not known."""


class EnergyMeter:
    """Adds up readings of one battery. ``charge_ah`` and ``energy_wh`` are None while no current has been told."""

    def __init__(self) -> None:
        self.charge_ah: float | None = None
        self.energy_wh: float | None = None
        self._before: BatterySeen | None = None

    def take(self, seen: BatterySeen | None) -> None:
        """The newest reading; the same one may be given again."""
        before = self._before
        if seen is None or (before is not None and seen.time_s <= before.time_s):
            return
        self._before = seen
        if seen.amperes is not None and self.charge_ah is None:
            self.charge_ah = 0.0
        if before is None or before.amperes is None:
            return
        hours = min(seen.time_s - before.time_s, MOST_S) / 3600.0
        self.charge_ah = (self.charge_ah or 0.0) + before.amperes * hours
        if before.volts is not None:
            self.energy_wh = (self.energy_wh or 0.0) + before.volts * before.amperes * hours
