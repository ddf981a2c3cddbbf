"""The steady frame: viewers' north and east count from the first origin of a run, also when the autopilot has got
another one (its power failed on the way, say). So what was told before stays where it is.

Nouns: steady frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import GeoPoint, LocalFrame, NedPoint

Json = dict[str, Any]
Place = list[float]


class SteadyFrame:
    """Moves places of the companion's local frame into that of the first origin. ``note`` must be told each origin."""

    def __init__(self) -> None:
        self.origin: GeoPoint | None = None
        """The first one; None before there is any."""
        self._north_m = self._east_m = 0.0

    def note(self, origin: GeoPoint | None) -> None:
        """Where the companion's local frame begins now; None: unknown."""
        if origin is None:
            return
        if self.origin is None:
            self.origin = origin
        moved = LocalFrame(self.origin).to_ned(origin)
        self._north_m, self._east_m = moved.north_m, moved.east_m

    def frame(self, frame: Json) -> Json:
        """A frame of ``frame_of``."""
        if self._is_there:
            return frame
        pose, goal, setpoint = frame["pose"], frame["goal"], frame["setpoint"]
        return {
            **frame,
            "pose": None if pose is None else [*self._place(pose), *pose[2:]],
            "goal": None if goal is None else self._with_place(goal),
            "setpoint": self._with_place(setpoint) if setpoint and "place" in setpoint else setpoint,
            "path": [self._place(one) for one in frame["path"]],
            "motion": [self._place(one) for one in frame["motion"]],
            "movers": [self._with_place(one) for one in frame["movers"]],
        }

    def scene(self, scene: Json) -> Json:
        """A scene of ``scene_of``."""
        if self._is_there or self.origin is None:
            return scene
        ground, home = scene["map"], scene["home"]
        return {
            **scene,
            "home": None if home is None else self._place(home),
            "origin": [self.origin.lat_deg, self.origin.lon_deg],
            "targets": [self._with_place(one) for one in scene["targets"]],
            "borders": [
                {**one, "corners": [self._place(corner) for corner in one["corners"]]} for one in scene["borders"]
            ],
            "map": ground
            and {
                **ground,
                "south_m": round(ground["south_m"] + self._north_m, 3),
                "west_m": round(ground["west_m"] + self._east_m, 3),
            },
        }

    def point(self, point: NedPoint) -> NedPoint:
        """One place."""
        return NedPoint(point.north_m + self._north_m, point.east_m + self._east_m)

    def places(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rows north and east, in metres."""
        return places if self._is_there else places + np.array((self._north_m, self._east_m))

    @property
    def _is_there(self) -> bool:
        """Whether nothing is to be moved, as in nearly every run."""
        return self._north_m == self._east_m == 0.0

    def _place(self, place: Place) -> Place:
        return [round(place[0] + self._north_m, 3), round(place[1] + self._east_m, 3)]

    def _with_place(self, one: Json) -> Json:
        return {**one, "place": self._place(one["place"])}
