"""Setpoint check: the last look at each setpoint before it is sent, against the map and the borders.

A setpoint may be the last one that the autopilot receives, and it is followed to its end. So each one is asked
whether the rover may be left alone with it. One that may not is replaced by velocity zero, reported and counted.
That this never happens is the task of the controllers. What lies on the way is reckoned anew, in ``left_alone``; only
the formulas of how far the rover goes beyond a point, and brakes, and by how much it may turn more or less than told
are those of the controllers.

Nouns: setpoint check.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from companion.control.braking import blind_distance_m, braking_distance_m, farthest_m, overshoot_m
from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.left_alone import (
    PIECE_M,
    Met,
    Places,
    along,
    first_met,
    once_turned_back,
    turned_on_the_spot,
    ways_left_alone,
)
from companion.control.local_view import LocalView
from companion.core.frames import NedPoint, wrap_pi_rad
from companion.core.severity import Severity, TextSink
from companion.mission.bounds import Bounds
from companion.safety.reasons import Reason, SetpointFault
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity, Setpoint

SLACK_M = 0.1
"""The controllers look in steps, and let a line end a few centimetres before an obstacle."""
NEARER_M = 0.05
"""The rover's disc may overlap evidence by this much: evidence has an error, and a rover at a wall must get away."""
PASSES_M = 0.04
"""The same on the way to a position: guidance lets a rover that stands beside something come nearer by a tenth of a
cell, of 0.2 m or less, and looks in other steps."""
STANDS_M_S = 0.05
PIVOTS_RAD = math.radians(20.0)
"""A standing rover turns on the spot for a position that lies farther aside."""
ARC_PIECES = 8
"""Straight pieces that an arc is made of where borders are concerned."""

Fault = Reason[SetpointFault]

Rule = Callable[[Setpoint, LocalView, Bounds], Fault | None]
"""What is wrong with a setpoint; None for nothing. Pure."""


def position_in_sight(setpoint: Setpoint, view: LocalView, bounds: Bounds) -> Fault | None:
    """A guided position lies within horizon and stopping distance, the straight way there is clear and seen.

    So is the ground beyond it onto which the rover may overshoot, as far as clear is concerned.

    It may lie beyond seen ground by what the slowest rover needs to brake, which creeps where a look shows nothing.
    """
    if not isinstance(setpoint, GuidedPosition):
        return None
    settings, evidence = view.settings.guidance, view.evidence
    here, there = view.pose.point, setpoint.point
    distance_m = here.distance_m(there)
    if not distance_m <= farthest_m(view.speed_m_s, settings, narrow=view.rover.narrow_sight) + SLACK_M:
        return Reason(SetpointFault.BEYOND_HORIZON)
    overshoots_m = overshoot_m(distance_m, view.speed_m_s, settings) + view.further_m
    stands = here.moved(here.bearing_rad(there), distance_m + overshoots_m)
    if not evidence.base.contains(evidence.base.cell_at(stands)):
        overshoots_m = 0.0  # nothing is known beyond the edge of the map
    way = _way(here, here.bearing_rad(there), 0.0, distance_m + overshoots_m - SLACK_M)
    clear, seen = along(way, view.rover.radius_m, evidence, deep_m=PASSES_M)
    if clear < len(way):
        return Reason(SetpointFault.BEHIND_OBSTACLE)
    beyond_m = braking_distance_m(settings.min_speed_m_s, settings)
    if seen * PIECE_M + beyond_m < distance_m - SLACK_M:
        return Reason(SetpointFault.ON_UNSEEN_GROUND)
    return None


def velocity_stops_in_time(setpoint: Setpoint, view: LocalView, bounds: Bounds) -> Fault | None:
    """A guided velocity, if nothing more is told, ends before the rover touches anything that is known.

    Where motions are planned the whole outline is looked at, and it stays on seen ground: see ``left_alone``.
    """
    if not isinstance(setpoint, GuidedVelocity):
        return None
    forward_m_s, yaw_rate_rad_s = setpoint.forward_m_s, setpoint.yaw_rate_rad_s
    if not math.isfinite(forward_m_s) or not math.isfinite(yaw_rate_rad_s):
        return Reason(SetpointFault.NOT_A_NUMBER)
    if view.settings.guidance.controller != "points":
        return None if forward_m_s == yaw_rate_rad_s == 0.0 else _left_alone(setpoint, view)
    if forward_m_s == 0.0:
        return None
    base_m_s = max(view.speed_m_s, view.settings.steering.scale_base_m_s)
    reach_m = blind_distance_m(abs(forward_m_s), view.settings.guidance) - SLACK_M
    way = _way(view.pose.point, _course_rad(setpoint, view), yaw_rate_rad_s / base_m_s, reach_m)
    clear, _ = along(way, view.rover.radius_m - NEARER_M, view.evidence, away=0.0, deep_m=0.0)
    return Reason(SetpointFault.INTO_OBSTACLE) if clear < len(way) else None


def _way(start: NedPoint, course_rad: float, curvature_per_m: float, length_m: float) -> NDArray[np.float64]:
    """Places on an arc, a piece apart; shape (n, 2), metres north and east. Its first one is where it begins."""
    gone_m = np.arange(0.0, max(length_m, 0.0) + 0.5 * PIECE_M, PIECE_M)
    courses_rad = course_rad + curvature_per_m * (gone_m[1:] - 0.5 * PIECE_M)
    steps = PIECE_M * np.column_stack((np.cos(courses_rad), np.sin(courses_rad)))
    return np.cumsum(np.vstack(((start.north_m, start.east_m), steps)), axis=0)


def _left_alone(setpoint: GuidedVelocity, view: LocalView) -> Fault | None:
    """A planned velocity: nothing that the outline meets, however much the rover turns.

    A rover that is told to stand, or to roll the other way, brakes first. What it would meet on a plain stop, too, is
    no reason to refuse; what it meets only because it turns meanwhile is one.
    """
    ways, stops = ways_left_alone(setpoint, view), GuidedVelocity(0.0, 0.0)
    fault = _fault_on(ways, view)
    if fault is None or not _brakes(setpoint, view) or _fault_on(ways_left_alone(stops, view), view) is None:
        return fault
    if setpoint.forward_m_s == 0.0 or ways is None:
        return None
    return _fault_on([once_turned_back(way, setpoint, view) for way in ways], view)


def _brakes(setpoint: GuidedVelocity, view: LocalView) -> bool:
    """Whether the rover rolls, and is told to stand or to roll the other way."""
    return view.speed_m_s > STANDS_M_S and setpoint.forward_m_s * view.forward_m_s <= 0.0


def _fault_on(ways: list[Places] | None, view: LocalView) -> Fault | None:
    """What is met on any of the ways; None stands for a rover that would never stand."""
    if ways is None:
        return Reason(SetpointFault.INTO_OBSTACLE)
    for way in ways:
        if (met := first_met(way, view)) is not Met.NOTHING:
            return Reason(SetpointFault.ONTO_UNSEEN if met is Met.UNSEEN else SetpointFault.INTO_OBSTACLE)
    return None


def turning_meets_nothing(setpoint: Setpoint, view: LocalView, bounds: Bounds) -> Fault | None:
    """A rover that turns on the spot, to a heading or before a position aside, meets nothing with its outline.

    Where points lead, the map keeps the circle round the outline, and the rover may turn anywhere.
    """
    if view.settings.guidance.controller == "points":
        return None
    if isinstance(setpoint, GuidedHeading):
        bearing_rad = setpoint.heading_rad
    elif isinstance(setpoint, GuidedPosition) and view.speed_m_s <= STANDS_M_S:
        bearing_rad = view.pose.point.bearing_rad(setpoint.point)
        if abs(wrap_pi_rad(bearing_rad - view.pose.heading_rad)) <= PIVOTS_RAD:
            return None
    else:
        return None
    met = first_met(turned_on_the_spot(bearing_rad, view), view)
    return Reason(SetpointFault.TURNS_INTO_OBSTACLE) if met is Met.OBSTACLE else None


def inside_borders(setpoint: Setpoint, view: LocalView, bounds: Bounds) -> Fault | None:
    """The straight way to a guided position, and the way on which a guided velocity ends, cross no border."""
    if len(bounds) == 0:
        return None
    name = ""
    if isinstance(setpoint, GuidedPosition):
        name = bounds.fault((view.pose.point, setpoint.point))
    elif isinstance(setpoint, GuidedVelocity) and setpoint.forward_m_s != 0.0:
        name = _crossed(setpoint, view, bounds)
    elif isinstance(setpoint, GuidedVelocity) and _stops_and_turns(setpoint, view):
        name = _crossed(setpoint, view, bounds)
        if name and not _may_just_stop(view, bounds):
            name = ""
    return Reason(SetpointFault.OVER_BORDER, (name,)) if name else None


def _stops_and_turns(velocity: GuidedVelocity, view: LocalView) -> bool:
    """Whether a rover whose motions are planned turns while it comes to a stop."""
    planned = view.settings.guidance.controller != "points"
    return planned and velocity.yaw_rate_rad_s != 0.0 and view.speed_m_s > STANDS_M_S


def _may_just_stop(view: LocalView, bounds: Bounds) -> bool:
    """Whether a plain stop would cross no border and meet nothing: else it is no better than what it replaces."""
    stops = GuidedVelocity(0.0, 0.0)
    return not _crossed(stops, view, bounds) and _fault_on(ways_left_alone(stops, view), view) is None


def _crossed(velocity: GuidedVelocity, view: LocalView, bounds: Bounds) -> str:
    """The first border on any of the ways on which it may end; empty for none."""
    return next((name for way in _ways(velocity, view) if (name := bounds.fault(way))), "")


def _ways(velocity: GuidedVelocity, view: LocalView) -> list[list[NedPoint]]:
    """The ways on which it may end."""
    if view.settings.guidance.controller == "points":
        return [_stopping_way(velocity, view)]
    corner = view.evidence.base.south_west
    return [
        [
            NedPoint(corner.north_m + float(north_m), corner.east_m + float(east_m))
            for north_m, east_m in once_turned_back(way, velocity, view)[:, :2]
        ]
        for way in ways_left_alone(velocity, view) or []
    ]


def _course_rad(velocity: GuidedVelocity, view: LocalView) -> float:
    """The direction of travel."""
    return view.pose.heading_rad + (math.pi if velocity.forward_m_s < 0.0 else 0.0)


def _stopping_way(velocity: GuidedVelocity, view: LocalView) -> list[NedPoint]:
    """The arc on which the rover comes to stand if the velocity ends now, in straight pieces."""
    fastest_m_s = max(abs(velocity.forward_m_s), view.speed_m_s)
    piece_m = braking_distance_m(fastest_m_s, view.settings.guidance) / ARC_PIECES
    turn_rad = velocity.yaw_rate_rad_s / max(view.speed_m_s, view.settings.steering.scale_base_m_s) * piece_m
    course_rad, way = _course_rad(velocity, view), [view.pose.point]
    for i in range(ARC_PIECES):
        way.append(way[-1].moved(course_rad + (i + 0.5) * turn_rad, piece_m))
    return way


RULES: tuple[Rule, ...] = (position_in_sight, velocity_stops_in_time, turning_meets_nothing, inside_borders)


def fault_of(setpoint: Setpoint, view: LocalView, bounds: Bounds, rules: tuple[Rule, ...] = RULES) -> Fault | None:
    """What is wrong with a setpoint by the first rule that it breaks; None for nothing."""
    for rule in rules:
        if (fault := rule(setpoint, view, bounds)) is not None:
            return fault
    return None


class SetpointCheck:
    """Stands between the controllers and what is sent. ``refused``: how often for each fault."""

    def __init__(self, notifier: TextSink, rules: tuple[Rule, ...] = RULES) -> None:
        self.refused: Counter[SetpointFault] = Counter()
        self._notifier = notifier
        self._rules = rules

    def passed(self, command: ControlCommand, view: LocalView, bounds: Bounds) -> ControlCommand:
        """The same command, or velocity zero in its place if its setpoint breaks a rule."""
        fault = fault_of(command.setpoint, view, bounds, self._rules)
        if fault is None:
            return command
        self.refused[fault.kind] += 1
        self._notifier.tell(f"Stopping: {fault}", Severity.WARNING)
        return stop_for(Purpose.BRAKE)
