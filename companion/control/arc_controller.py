"""Guidance for a rover that cannot turn on the spot: it drives arcs, and where the route cannot be driven so, a manoeuvre.

It is told a speed and a turn rate, many times a second (pure pursuit of its route), for a guided position would leave it to the autopilot
which arc is driven, and only an arc that is known can be looked along.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from companion.control.arc_view import TOUCH_M, ArcView, Rolling
from companion.control.manoeuvre import Manoeuvre, Try, find_manoeuvre, tries
from companion.control.point_controller import ControlCommand
from companion.control.reference_path import Route
from companion.core.frames import Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap
from companion.settings import Settings

MEMORY_S = 0.3
"""Speed and curvature are those of the last moments."""
LEAST_M = 0.3
"""Less of a way than this is no way."""
LEG_ENDS_M = 0.15
GOES_ON_M = 1.5
"""With less than this left of a manoeuvre that ends tail first the next one is looked for."""
OFF_ROUTE_RADII = 1.0
"""A manoeuvre that ends farther from the route than so many turning radii leads nowhere any more."""


class ArcController:
    """Steers one rover. It remembers the manoeuvre under way and the last few poses. ``backwards``: the rover rolls tail first."""

    def __init__(self, evidence: EvidenceMap, settings: Settings) -> None:
        self.manoeuvre: Manoeuvre | None = None
        self._evidence = evidence
        self._settings = settings
        self._poses: deque[Pose] = deque()
        self._looked_s = -math.inf
        self._tries: deque[Try] = deque()
        self.backwards = False
        self._told_m = 0.0

    def retune(self, settings: Settings) -> None:
        """Other settings from now on."""
        self._settings = settings

    def reset(self) -> None:
        """The leg is over: no manoeuvre is under way."""
        self.manoeuvre = None
        self._looked_s = -math.inf

    def guide(self, route: Route, pose: Pose, speed_m_s: float, rover: RoverLimits) -> ControlCommand:
        """What to tell the autopilot now. ``speed_m_s``: over ground, without a sign."""
        rolling = self._rolling(pose, speed_m_s)
        self.backwards = rolling.speed_m_s < 0.0
        view = ArcView(self._evidence, rover, self._settings, pose, rolling, self._told_m)
        answer = self._answer(view, route, rover)
        self._told_m = view.told_m
        return answer

    def _answer(self, view: ArcView, route: Route, rover: RoverLimits) -> ControlCommand:
        """On with the manoeuvre, on along the route, or stop."""
        if view.would_touch():
            self.manoeuvre = None
            return view.brake()
        self._forget_what_leads_nowhere(route, rover)
        if self.manoeuvre is not None:
            answer = self._go_on(view, route)
            if answer is not None:
                return answer
        if view.rolling.speed_m_s < -self._settings.steering.stopped_m_s:
            return view.brake()
        steering = self._settings.steering
        room_m = steering.narrow_clearance_m if rover.narrow_sight else steering.clearance_m
        ahead = view.follow(route.points, route.progress, room_m, backwards=False)
        if ahead.clear_m < self._settings.steering.drives_on_m + view.needed_m:
            self._look_for_manoeuvre(route, view)
            if self.manoeuvre is not None:
                answer = self._go_on(view, route)
                if answer is not None:
                    return answer
        return view.drive(ahead, backwards=False, left_m=route.left_m)

    def _rolling(self, pose: Pose, speed_m_s: float) -> Rolling:
        """From the poses of the last moments."""
        if self._poses and not 0.0 < pose.time_s - self._poses[-1].time_s < 1.0:
            self._poses.clear()
        self._poses.append(pose)
        while pose.time_s - self._poses[0].time_s > MEMORY_S:
            self._poses.popleft()
        first = self._poses[0]
        moved_m = first.point.distance_m(pose.point)
        if moved_m < 0.02 or speed_m_s < 0.05:
            return Rolling(speed_m_s, 0.0)
        forwards = math.cos(first.point.bearing_rad(pose.point) - pose.heading_rad) >= 0.0
        turned_rad = wrap_pi_rad(pose.heading_rad - first.heading_rad)
        return Rolling(speed_m_s if forwards else -speed_m_s, turned_rad / max(moved_m, 0.1))

    def _forget_what_leads_nowhere(self, route: Route, rover: RoverLimits) -> None:
        """The route may have been laid anew: a manoeuvre that ends beside it is given up."""
        if self.manoeuvre is None:
            return
        end = self.manoeuvre.end
        ahead = route.points[route.progress :]
        off_m = float(np.hypot(ahead[:, 0] - end.north_m, ahead[:, 1] - end.east_m).min())
        if off_m > OFF_ROUTE_RADII * rover.turning_radius_m:
            self.manoeuvre = None

    def _go_on(self, view: ArcView, route: Route) -> ControlCommand | None:
        """The next moment of the manoeuvre; None when it is over, or cannot be driven any more."""
        manoeuvre = self.manoeuvre
        assert manoeuvre is not None
        leg, stopped = manoeuvre.leg, abs(view.rolling.speed_m_s) <= self._settings.steering.stopped_m_s
        if not stopped and leg.backwards != (view.rolling.speed_m_s < 0.0):
            return view.brake()
        progress, left_m = view.along(leg, manoeuvre.progress)
        if leg.backwards and len(manoeuvre.legs) == 1 and left_m < GOES_ON_M and self._look_for_manoeuvre(route, view):
            assert self.manoeuvre is not None
            manoeuvre, leg = self.manoeuvre, self.manoeuvre.leg
            progress, left_m = view.along(leg, 0)
        if left_m <= LEG_ENDS_M:
            self.manoeuvre = manoeuvre.after_leg()
            if self.manoeuvre is None and not leg.backwards:
                return None
            return view.brake()
        self.manoeuvre = manoeuvre.at(progress)
        ahead = view.follow(leg.points, progress, TOUCH_M, backwards=leg.backwards)
        if ahead.clear_m < view.needed_m + LEAST_M:
            self.manoeuvre = None
            return None if stopped else view.brake()
        return view.drive(ahead, backwards=leg.backwards, left_m=left_m)

    def _look_for_manoeuvre(self, route: Route, view: ArcView) -> bool:
        """Whether there is a new one. Only one thing is tried each time, so that no tick takes long.

        Who rolls must begin the way he rolls.
        """
        settings, speed_m_s, now_s = self._settings.steering, view.rolling.speed_m_s, view.pose.time_s
        if now_s - self._looked_s >= settings.manoeuvre_every_s:
            self._tries = deque(tries(route, view.rover, settings))
        if not self._tries:
            return False
        self._looked_s = now_s
        way = 0 if abs(speed_m_s) <= settings.stopped_m_s else 1 if speed_m_s > 0.0 else -1
        wanted = self._tries.popleft()
        found = find_manoeuvre(route, view.pose, self._evidence, view.rover, settings, wanted, way)
        if found is None:
            return False
        self.manoeuvre = found
        self._tries.clear()
        return True
