"""The last place: where the rover was when its autopilot last knew. An autopilot that has just been switched on tells
zeros, which are home or any other place on a map that was begun before.

Nouns: last place.
"""

from __future__ import annotations

from typing import Any

from companion.vehicle.state import EkfQuantity, VehicleState

Json = dict[str, Any]


def knows_place(vehicle: VehicleState) -> bool:
    """Whether the position that was heard last is one, and it is known from where it counts."""
    position, origin = vehicle.position, vehicle.origin
    if position is None or vehicle.ekf_lacks is EkfQuantity.POSITION:
        return False
    # The origin of before is not that of an autopilot that has restarted.
    return not vehicle.restarted or (origin is not None and origin.time_s > position.time_s - position.boot_s)


class LastPlace:
    """Keeps it for the moments in which it is not known. ``told`` must be given each frame, as it is shown."""

    def __init__(self) -> None:
        self._pose: list[float] | None = None
        self._time_s = 0.0

    def told(self, frame: Json, vehicle: VehicleState, now_s: float) -> Json:
        """A frame with its rates, with the last place and its age where the present one is not known."""
        if knows_place(vehicle):
            self._pose, self._time_s = frame["pose"], now_s
            return frame
        rates = frame["rates"]
        if self._pose is not None:
            age_s = round(now_s - self._time_s, 1)
            rates = {**rates, "position_age_s": max(rates["position_age_s"] or 0.0, age_s)}
        figures = {**frame["figures"], "clearance_m": None}
        return {**frame, "pose": self._pose, "rays": None, "figures": figures, "rates": rates}
