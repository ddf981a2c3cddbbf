"""Collision avoidance (yielding): before a command is used, the next seconds are played through with all that moves.

Several options are played through: go on, go on a little and then stop, stop at once, turn while it stops, turn and
move aside, back off, drive off on an arc. The first that keeps its distance is taken; if none does, the one that leaves
the most room. If all would touch something, those count that go well for longest: the rover goes on to move aside if it
does so already, else it takes the one with which the two would meet at the lowest speed. Where the other is near
already, the most room counts that is left from then on.

The rover stops before the way of others, since going on is allowed only while there still is somewhere to stop; and it
waits there until going on is safe again. Once it stops for something it goes on only for good: else it would drive
along beside that, always about to pass in front of it. While it still rolls, stopping or moving off, it goes on only
where that keeps its distance: what is seen to move is not known exactly, and a rover that brakes and goes on in turn
does neither in time.
Of positions that are as good the first is told with which a rover that is left alone is not met, if there is one. Each
option says what the autopilot would be told and where the rover would then be at each moment; the ground there must be
clear and seen.

Nouns: collision avoidance, yielding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from companion.control.braking import blind_distance_m, farthest_m
from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.local_view import LocalView
from companion.control.motion_prediction import (
    PERIOD_S,
    TURN_RAD_S,
    Points,
    braked_m,
    driven_m,
    moved,
    moved_on_arc,
    places_ahead,
    steered_along,
)
from companion.control.point_controller import turn_to
from companion.control.reference_path import ReferencePath
from companion.control.safe_reach import BACK_LEAST_M_S, backing_speed_m_s, tail_reach_m
from companion.control.turning_room import may_turn_to
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.mapping.map_queries import ArcQueries, Until, look_along
from companion.perception.moving_obstacles import Moving
from companion.settings import GuidanceSettings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity

Foresees = Callable[[Points], Points | None]
"""Where the rover will be at these moments, seconds from now on."""
TurnedStops = Callable[[Points], Iterable[tuple[ControlCommand, Points]]]
"""Ways to stop while it turns that the ground allows, and where the rover then is at these moments."""
HALF_MARGIN = 0.5
"""Going on for good with half the margin, or stopping, is better than leaving the path. Not going on for a little: a
rover that brakes would spend the rest of the margin on it, and brake late."""
NEAR_M = 0.15
"""If every option touches something in the end, the option is taken that comes within this distance latest."""
AS_LATE_S = 0.5
"""Those that come within it up to so much earlier count as well."""
AS_SLOW_M_S = 0.15
"""Speeds at which the two meet that differ by less are equal; then it stops or backs off."""
AS_MUCH_M = 0.1
"""What leaves less room by so much counts as well, where the other is near already."""
GO_ON_S = (math.inf, 3.0, 1.5, 0.4)
"""How long the rover might go on before it stops, the longest first: 0.4 s is longer than to the next tick."""
ALONE_S = 15.0
"""A rover that is left alone with a position is not met there for so long: another companion may begin then."""
STRAIGHT_S = (1.0, 2.5)
"""How long it drives straight on before it stops, the shortest first; in the longer one it leaves the way of a van."""
ASIDE_M = (2.5, 1.5)
ASIDE_RAD = (0.5 * math.pi, -0.5 * math.pi, 0.25 * math.pi, -0.25 * math.pi)
"""How far it may move aside, and in which directions, counted from the course of the other."""
ASIDE_M_S = 1.2
OFF_M = 1.5
"""How far it backs off at most."""
ARC_M, ARC_M_S, ARC_SHARES = 2.5, 0.7, (0.0, -1.0, 1.0)
"""How far, how fast and with which shares of the sharpest curvature a rover drives off that cannot turn on the spot."""


REMEMBERS_S = 5.0
"""What left the view because the rover turned off, to stop for it, is expected to go on for so long.

After 3 s a walker who was taken for a tenth faster than he was had not passed yet.
"""
STEPS_M = 0.02
"""A way that gets on by less between two moments says nothing of the heading."""


@dataclass(frozen=True, eq=False, slots=True)
class Option:
    """Something to do, and where the rover then is at each moment.

    ``yields``: it is not what the controller said. ``aside_rad``: the bearing to which the rover moves aside with it.
    """

    command: ControlCommand
    places: Points
    yields: bool = True
    aside_rad: float | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Outlook:
    """A moment, and the moments from now on that count (``times_s``).

    ``backwards``: the rover rolls tail first. ``stops``: it was told to because of what moves.
    """

    view: LocalView
    times_s: Points
    backwards: bool = False
    stops: bool = False

    @property
    def goes_on_s(self) -> tuple[float, ...]:
        """How long it might go on before it stops."""
        return GO_ON_S[:1] if self.stops else GO_ON_S

    @property
    def guidance(self) -> GuidanceSettings:
        """How it brakes."""
        return self.view.settings.guidance

    @property
    def rolls_m(self) -> Points:
        """How far the rover still rolls, at each moment, if it is told to stop."""
        return braked_m(self.view.speed_m_s, self.times_s, self.guidance)

    def driven_m(self, wanted_m_s: float, goes_s: float) -> Points:
        """How far the rover drives, at each moment, if it goes on at this speed for ``goes_s`` and then stops."""
        return driven_m(self.view.speed_m_s, wanted_m_s, goes_s, self.times_s, self.view.settings.guidance)


def avoided(
    command: ControlCommand,
    line: ReferencePath | None,
    view: LocalView,
    moving: tuple[Moving, ...],
    *,
    aside_rad: float | None = None,
    stops: bool = False,
    makes_way: bool = False,
    backwards: bool = False,
    foresees: Foresees | None = None,
    turned_stops: TurnedStops | None = None,
    turned_rad_s: float = 0.0,
) -> Option:
    """What to do because of what moves, when the controller says ``command``; that command if nothing comes across.

    ``line``: what the rover is led along. ``aside_rad``: the bearing to which it moves aside already; it keeps to that.
    ``stops``: it stops already; ``makes_way``: it moves off already. ``backwards``: it rolls tail first. ``foresees``:
    where the rover will be with that command, if it is known better than that it follows the line. ``turned_stops``:
    how else it may stop; ``turned_rad_s``: it stops so already, and keeps to that side.
    """
    times_s = np.arange(0.0, view.settings.traffic.look_s + 1e-9, PERIOD_S)
    outlook = Outlook(view, times_s, backwards, stops)
    moving = tuple(one for one in moving if _matters(one, view))
    if not moving:
        return Option(command, _halted(outlook), yields=False)
    discs = _discs(moving, view)
    margins_m = view.settings.traffic.margin_m + view.settings.traffic.drift_m_s * times_s

    def room_m(option: Option, share: float) -> float:
        return least_room_m(_middles(option.places, view), discs, times_s, share * margins_m)

    places = foresees(times_s) if foresees is not None and command.purpose is Purpose.DRIVE else None
    if places is None:
        options = list(_on_the_way(outlook, command, line))
    else:
        options = list(_on_as_foreseen(outlook, command, places))
    for share, tried in ((1.0, options), (HALF_MARGIN, [options[0], options[-1]])):
        good = [option for option in tried if room_m(option, share) >= 0.0]
        if good:
            positions = (option for option in good if isinstance(option.command.setpoint, GuidedPosition))
            return next((one for one in positions if _may_be_the_last(one.command, view, discs)), good[0])
    turned = [Option(*way) for way in turned_stops(times_s)] if turned_stops is not None else []
    turned = [option for option in turned if _turn_rad_s(option) * turned_rad_s > 0.0] or turned
    rooms_m = [room_m(option, HALF_MARGIN) for option in turned]
    if rooms_m and max(rooms_m) >= 0.0:
        return turned[int(np.argmax(rooms_m))]
    options += turned
    turns_on_the_spot = view.rover.turning_radius_m == 0.0
    for option in _out_of_the_way(outlook, moving, aside_rad) if turns_on_the_spot else _on_arcs(outlook):
        if room_m(option, HALF_MARGIN) >= 0.0:
            return option
        options.append(option)
    if (stops or makes_way) and view.speed_m_s > view.settings.guidance.roll_out_m_s:
        options = [option for option in options if option.yields]
    return _least_bad(options, outlook, discs, aside_rad)


def _least_bad(options: list[Option], outlook: Outlook, discs: Points, aside_rad: float | None) -> Option:
    """Of options that all come too near: the one with most room, or with which the two meet late and slowly."""
    view = outlook.view
    ends = [(option, first_near(_middles(option.places, view), discs, outlook.times_s, NEAR_M)) for option in options]
    if any(near.least_m >= 0.0 for _, near in ends):
        return max(ends, key=lambda one: one[1].least_m)[0]
    latest_s = max(near.first_s for _, near in ends)
    if latest_s == 0.0:  # the other is so near already: when, and how fast now, is the same for all
        most_m = max(near.least_m for _, near in ends)
        return min((option for option, near in ends if near.least_m >= most_m - AS_MUCH_M), key=_told_m_s)
    late = [(option, near) for option, near in ends if near.first_s >= latest_s - AS_LATE_S]
    kept = [option for option, _ in late if aside_rad is not None and option.aside_rad == aside_rad]
    if kept:
        return kept[0]
    slowest_m_s = min(near.closing_m_s for _, near in late)
    return min((option for option, near in late if near.closing_m_s <= slowest_m_s + AS_SLOW_M_S), key=_told_m_s)


def _turn_rad_s(option: Option) -> float:
    """The turn rate with which the rover is told to stop; 0 where it is told something else."""
    command = option.command
    if command.purpose is not Purpose.BRAKE or not isinstance(command.setpoint, GuidedVelocity):
        return 0.0
    return command.setpoint.yaw_rate_rad_s


def _told_m_s(option: Option) -> float:
    """The speed that is told; inf for a position, which tells the rover to go on."""
    setpoint = option.command.setpoint
    return setpoint.forward_m_s if isinstance(setpoint, GuidedVelocity) else math.inf


def _may_be_the_last(command: ControlCommand, view: LocalView, discs: Points) -> bool:
    """Whether the rover, left alone with the position that is told, is not met on the way or there for ``ALONE_S``."""
    assert isinstance(command.setpoint, GuidedPosition)
    here, there = view.pose.point, command.setpoint.point
    times_s = np.arange(0.0, ALONE_S, PERIOD_S)
    along_m = np.minimum(Outlook(view, times_s).driven_m(command.speed_m_s, math.inf), here.distance_m(there))
    bearing_rad = here.bearing_rad(there)
    places = np.column_stack(
        (here.north_m + along_m * math.cos(bearing_rad), here.east_m + along_m * math.sin(bearing_rad))
    )
    margins_m = np.full(len(times_s), HALF_MARGIN * view.settings.traffic.margin_m)
    return least_room_m(_middles(places, view), discs, times_s, margins_m) >= 0.0


class CollisionAvoidance:
    """Remembers whether the rover stops or moves aside, what it turned off for, and since when it does not get on."""

    def __init__(self) -> None:
        self._aside_rad: float | None = None
        self._stops = self._makes_way = False
        self._turned_rad_s = 0.0
        self._since_s: float | None = None
        self._avoided_s = -math.inf
        self._turned_off_for: dict[str, tuple[Moving, float]] = {}
        """By name: what the rover turned off for, as it was known last, and when."""

    def with_what_it_turned_off_for(self, moving: tuple[Moving, ...], now_s: float) -> tuple[Moving, ...]:
        """``moving``, and what the rover turned off for, where that is not among it any more.

        Turned away the rover may not see it, and turned back it may stand in front of it: while it turns quickly it
        does not see all that moves (`companion/perception/object_tracker.py`).
        """
        for one in moving:
            if one.name in self._turned_off_for or self._turned_rad_s != 0.0:
                self._turned_off_for[one.name] = (one, now_s)
        self._turned_off_for = {
            name: (one, known_s)
            for name, (one, known_s) in self._turned_off_for.items()
            if now_s - known_s < REMEMBERS_S
        }
        if not moving and not self._turned_off_for:
            self._turned_rad_s = 0.0
        names = {one.name for one in moving}
        return moving + tuple(one for name, (one, _) in self._turned_off_for.items() if name not in names)

    def avoid(
        self,
        command: ControlCommand,
        line: ReferencePath | None,
        view: LocalView,
        moving: tuple[Moving, ...],
        *,
        backwards: bool,
        foresees: Foresees | None = None,
        turned_stops: TurnedStops | None = None,
    ) -> Option:
        """What to do, as ``avoided`` says. Where nothing has moved for ``REMEMBERS_S`` it begins anew."""
        if view.pose.time_s - self._avoided_s > REMEMBERS_S:
            self._aside_rad, self._stops, self._makes_way, self._since_s = None, False, False, None
        if moving:
            self._avoided_s = view.pose.time_s
        option = avoided(
            command, line, view, moving, aside_rad=self._aside_rad, stops=self._stops, makes_way=self._makes_way,
            backwards=backwards, foresees=foresees, turned_stops=turned_stops, turned_rad_s=self._turned_rad_s,
        )  # fmt: skip
        self._aside_rad = option.aside_rad
        self._stops = option.yields and option.command.purpose is Purpose.BRAKE
        self._makes_way = option.yields and not self._stops
        self._turned_rad_s = _turn_rad_s(option) or (self._turned_rad_s if self._stops else 0.0)
        return option

    def is_patient(self, now_s: float, patience_s: float, *, yields: bool) -> bool:
        """Whether avoiding keeps the rover from getting on (``yields``: at this moment), and not for too long yet."""
        if not yields:
            self._since_s = None
            return False
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s < patience_s


def _matters(one: Moving, view: LocalView) -> bool:
    """Whether it moves at all and the two could meet while the rover looks ahead."""
    traffic, rover, pose = view.settings.traffic, view.rover, view.pose
    reach_m = (one.speed_m_s + rover.cruise_speed_m_s) * traffic.look_s + one.radius_m + rover.radius_m
    return one.speed_m_s >= traffic.moving_m_s and one.at(pose.time_s).distance_m(pose.point) <= reach_m


def _discs(moving: tuple[Moving, ...], view: LocalView) -> Points:
    """Rows for ``least_room_m``: place now, velocity, and how near the middles may come."""
    rows, body, round_m = [], view.footprint, view.rover.radius_m
    if _ahead_m(view) != 0.0:
        round_m = math.hypot(0.5 * (body.front_m + body.rear_m), body.half_width_m)
    for one in moving:
        here = one.at(view.pose.time_s)
        rows.append((here.north_m, here.east_m, one.north_m_s, one.east_m_s, one.radius_m + round_m))
    return np.array(rows)


def _ahead_m(view: LocalView) -> float:
    """How far the middle of the outline lies ahead of the rover's place."""
    return 0.5 * (view.footprint.front_m - view.footprint.rear_m)


def _middles(places: Points, view: LocalView) -> Points:
    """Where the middle of the outline is while the rover's place is at ``places``.

    A circle round the place would be much larger than one round the middle where that lies far ahead or behind.
    """
    ahead_m = _ahead_m(view)
    return places if ahead_m == 0.0 else middles_of(places, view.pose.heading_rad, ahead_m)


def _halted(outlook: Outlook) -> Points:
    """Where the rover is while it comes to a stop."""
    rolls_m = outlook.rolls_m
    return places_ahead(outlook.view.pose, -rolls_m if outlook.backwards else rolls_m)


def _on_the_way(outlook: Outlook, command: ControlCommand, line: ReferencePath | None) -> Iterator[Option]:
    """Going on, going on a little, stopping."""
    view = outlook.view
    halted = _halted(outlook)
    if command.purpose is Purpose.DRIVE and line is not None:
        way = _told_way(command, line, view.pose)
        course_rad = view.pose.heading_rad + (math.pi if outlook.backwards else 0.0)
        for goes_s in outlook.goes_on_s:
            along_m = outlook.driven_m(command.speed_m_s, goes_s)
            places = steered_along(way, course_rad, along_m, view.rover.turning_radius_m)
            nearer = _nearer(command, view.pose, along_m)
            yield Option(command, places, yields=False) if nearer is None else Option(nearer, places)
    elif isinstance(command.setpoint, GuidedVelocity) and command.setpoint.forward_m_s < 0.0:
        yield Option(command, _backed_off(outlook, -command.setpoint.forward_m_s, math.inf), yields=False)
    else:
        yield Option(command, halted, yields=False)
    yield Option(stop_for(Purpose.BRAKE), halted)


def _on_as_foreseen(outlook: Outlook, command: ControlCommand, places: Points) -> Iterator[Option]:
    """Going on as foreseen, going on a little, stopping."""
    reached_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
    for goes_s in outlook.goes_on_s:
        last = int(np.searchsorted(outlook.times_s, goes_s, side="right")) - 1
        speed_m_s = (reached_m[last] - reached_m[max(last - 1, 0)]) / PERIOD_S
        rolls_m = braked_m(speed_m_s, np.maximum(outlook.times_s - outlook.times_s[last], 0.0), outlook.guidance)
        along_m = np.minimum(reached_m, reached_m[last]) + rolls_m
        stopping = np.column_stack([np.interp(along_m, reached_m, places[:, axis]) for axis in range(2)])
        yield Option(command, stopping if math.isfinite(goes_s) else places, yields=False)
    yield Option(stop_for(Purpose.BRAKE), _halted(outlook))


def _nearer(command: ControlCommand, pose: Pose, along_m: Points) -> ControlCommand | None:
    """The command with its position moved to where the rover should stop; None if it is not farther than that.

    The rover must stop there even if it hears nothing more.
    """
    if not isinstance(command.setpoint, GuidedPosition):
        return None
    stands_m, there = float(along_m[-1]), command.setpoint.point
    if stands_m >= pose.point.distance_m(there):
        return None
    nearer = pose.point.moved(pose.point.bearing_rad(there), stands_m)
    return ControlCommand(command.purpose, GuidedPosition(nearer), command.speed_m_s)


def _told_way(command: ControlCommand, line: ReferencePath, pose: Pose) -> Points:
    """Where it drives: straight to the position that it is told, and on from there along the line.

    That position lies some metres ahead. If the line bends before it, the rover cuts the corner and leaves the line.
    """
    ahead = line.points[line.progress + 1 :]
    here = (pose.north_m, pose.east_m)
    if isinstance(command.setpoint, GuidedPosition) and len(ahead) > 0:
        told = np.array((command.setpoint.point.north_m, command.setpoint.point.east_m))
        nearest = int(np.argmin(((ahead - told) ** 2).sum(axis=1)))
        if nearest > 0:  # else it is not ahead any more
            return np.vstack((here, told, ahead[nearest + 1 :]))
    return np.vstack((here, ahead))


def _out_of_the_way(outlook: Outlook, moving: tuple[Moving, ...], aside_rad: float | None) -> Iterator[Option]:
    """Where a rover that turns on the spot might move to, best first, worked out only when it is asked for."""
    pose = outlook.view.pose
    yield from _straight_on(outlook)
    if aside_rad is not None:
        yield from _aside(outlook, aside_rad, under_way=True)
    nearest = min(moving, key=lambda one: one.at(pose.time_s).distance_m(pose.point) - one.radius_m)
    course_rad = math.atan2(nearest.east_m_s, nearest.north_m_s)
    for turned_rad in ASIDE_RAD:
        yield from _aside(outlook, wrap_pi_rad(course_rad + turned_rad))
    yield from _back_off(outlook)


def _straight_on(outlook: Outlook) -> Iterator[Option]:
    """Drive straight on, then stop. A new path may turn off in front of something that crosses."""
    view, guidance = outlook.view, outlook.guidance
    if view.speed_m_s <= guidance.roll_out_m_s:
        return
    for goes_s in STRAIGHT_S[:1] if outlook.stops else STRAIGHT_S:
        along_m = outlook.driven_m(view.speed_m_s, goes_s)
        ahead_m = float(along_m[-1])
        there = view.pose.point.moved(view.pose.heading_rad, ahead_m)
        if ahead_m <= farthest_m(view.speed_m_s, guidance, narrow=view.rover.narrow_sight) and _may_stand(view, there):
            command = ControlCommand(Purpose.LOOK, GuidedPosition(there), view.speed_m_s)
            yield Option(command, places_ahead(view.pose, along_m))


def _may_stand(view: LocalView, there: NedPoint) -> bool:
    """Whether the way to a place, and a little farther, is clear and seen."""
    here, guidance = view.pose.point, view.settings.guidance
    reach_m = here.distance_m(there) + guidance.overshoot_m + view.further_m
    beyond = here.moved(here.bearing_rad(there), reach_m)
    line = look_along(view.evidence, here, beyond, view.rover.radius_m + guidance.clearance_m)
    return min(line.clear_m, line.seen_m) >= reach_m - 0.05


def _aside(outlook: Outlook, bearing_rad: float, *, under_way: bool = False) -> list[Option]:
    """Turn to a bearing and drive a little, if the ground there is free, and round the rover.

    A rover that is ``under_way`` there, and points there, does not stop before it.
    """
    view, pose, guidance = outlook.view, outlook.view.pose, outlook.view.settings.guidance
    if not may_turn_to(bearing_rad, view):
        return []
    error_rad = abs(wrap_pi_rad(bearing_rad - pose.heading_rad))
    turns_s = error_rad / TURN_RAD_S + view.speed_m_s / guidance.deceleration_m_s2
    going_m_s = min(view.rover.cruise_speed_m_s, ASIDE_M_S)
    for aside_m in ASIDE_M:
        there = pose.point.moved(bearing_rad, aside_m)
        if aside_m > farthest_m(0.0, guidance, narrow=view.rover.narrow_sight) or not _may_stand(view, there):
            continue
        after_s = np.maximum(outlook.times_s - turns_s, 0.0)
        along_m = np.minimum(0.5 * guidance.deceleration_m_s2 * after_s**2, aside_m)
        along_m = np.minimum(along_m, going_m_s * after_s)
        places = moved(places_ahead(pose, outlook.rolls_m), bearing_rad, along_m)
        if error_rad > math.radians(guidance.turn_until_close_deg):
            return [Option(turn_to(bearing_rad, view), places, aside_rad=bearing_rad)]
        if under_way:
            along_m = np.minimum(outlook.driven_m(going_m_s, math.inf), aside_m)
            places = moved(np.tile((pose.north_m, pose.east_m), (len(along_m), 1)), bearing_rad, along_m)
        going = ControlCommand(Purpose.LOOK, GuidedPosition(there), going_m_s)
        return [Option(going, places, aside_rad=bearing_rad)]
    return []


def _back_off(outlook: Outlook) -> list[Option]:
    """Straight back over ground that is known to be free."""
    view, guidance = outlook.view, outlook.view.settings.guidance
    back_m_s = backing_speed_m_s(view)
    if back_m_s < BACK_LEAST_M_S or view.speed_m_s > guidance.roll_out_m_s + guidance.back_out_speed_m_s:
        return []
    command = ControlCommand(Purpose.LOOK, GuidedVelocity(-back_m_s, 0.0), back_m_s)
    return [Option(command, _backed_off(outlook, back_m_s, OFF_M))]


def _backed_off(outlook: Outlook, back_m_s: float, most_m: float) -> Points:
    """Where the rover is while it goes straight back, once it stands, and no farther than ``most_m``."""
    view, guidance = outlook.view, outlook.guidance
    if view.rolls_back:
        return places_ahead(view.pose, -np.minimum(outlook.times_s * back_m_s, most_m))
    stands_s = guidance.brake_delay_s + view.speed_m_s / guidance.deceleration_m_s2
    back_m = np.minimum(np.maximum(outlook.times_s - stands_s, 0.0) * back_m_s, most_m)
    return places_ahead(view.pose, outlook.rolls_m - back_m)


def _on_arcs(outlook: Outlook) -> Iterator[Option]:
    """Where a rover that drives arcs might go: straight or at full lock, the way it rolls; standing, either way."""
    view, pose, rover = outlook.view, outlook.view.pose, outlook.view.rover
    guidance, steering = view.settings.guidance, view.settings.steering
    arcs = ArcQueries(view.evidence, pose)
    room_m = arcs.kept_room_m(rover.radius_m + guidance.clearance_m, rover.radius_m - 0.05)
    sharpest_per_m = 1.0 / (rover.turning_radius_m * steering.planned_radius)
    for tail_first in (outlook.backwards,) if view.speed_m_s > steering.stopped_m_s else (False, True):
        going_m_s = min(guidance.back_out_speed_m_s if tail_first else rover.cruise_speed_m_s, ARC_M_S)
        course_rad = pose.heading_rad + (math.pi if tail_first else 0.0)
        tail_m = tail_reach_m(rover.radius_m, backwards=tail_first)
        for share in ARC_SHARES:
            curvature_per_m = share * sharpest_per_m
            reach_m = max(ARC_M, blind_distance_m(going_m_s, guidance))
            if not arcs.arc_is_clear(course_rad, curvature_per_m, room_m, reach_m, Until.UNSEEN, tail_m):
                continue
            along_m = np.minimum(outlook.driven_m(going_m_s, math.inf), ARC_M)
            turn_rate = curvature_per_m * max(view.speed_m_s, steering.scale_base_m_s)
            setpoint = GuidedVelocity(-going_m_s if tail_first else going_m_s, round(turn_rate, 2))
            places = moved_on_arc(pose, course_rad, curvature_per_m, along_m)
            yield Option(ControlCommand(Purpose.LOOK, setpoint, going_m_s), places)


@njit(cache=True, nogil=True)
def least_room_m(places: Points, discs: Points, times_s: Points, margins_m: Points) -> float:
    """The least room beyond the margin that is left between the rover and anything that moves; negative: too little.

    A thing that is nearer than the margin already must not come nearer still.
    """
    least_m = math.inf
    for row in range(discs.shape[0]):
        north_m, east_m, north_m_s, east_m_s, touch_m = discs[row]
        now_m = math.hypot(north_m - places[0, 0], east_m - places[0, 1]) - touch_m
        for i in range(times_s.size):
            time_s = times_s[i]
            to_n, to_e = north_m + north_m_s * time_s - places[i, 0], east_m + east_m_s * time_s - places[i, 1]
            room_m = math.hypot(to_n, to_e) - touch_m - min(margins_m[i], max(now_m - 0.02, 0.0))
            least_m = min(least_m, room_m)
    return least_m


@njit(cache=True, nogil=True)
def middles_of(places: Points, heading_rad: float, ahead_m: float) -> Points:
    """Each place moved ahead along the heading there: that of the way, or against it where the rover rolls back.

    A rover that hardly moves keeps its heading.
    """
    middles = np.empty_like(places)
    for i in range(places.shape[0]):
        if i > 0:
            north_m, east_m = places[i, 0] - places[i - 1, 0], places[i, 1] - places[i - 1, 1]
            if math.hypot(north_m, east_m) > STEPS_M:
                course_rad = math.atan2(east_m, north_m)
                if math.cos(course_rad - heading_rad) < 0.0:
                    course_rad += math.pi
                heading_rad = course_rad
        middles[i, 0] = places[i, 0] + ahead_m * math.cos(heading_rad)
        middles[i, 1] = places[i, 1] + ahead_m * math.sin(heading_rad)
    return middles


class Near(NamedTuple):
    """How near an option comes to what moves; ``first_s`` is inf if it never comes near."""

    first_s: float
    least_m: float
    closing_m_s: float
    """How fast the two then move against each other."""


@njit(cache=True, nogil=True)
def first_near(places: Points, discs: Points, times_s: Points, near_m: float) -> Near:
    """When anything that moves first comes within ``near_m``, and the least room at any time."""
    first_s, least_m, closing_m_s = math.inf, math.inf, 0.0
    for row in range(discs.shape[0]):
        north_m, east_m, north_m_s, east_m_s, touch_m = discs[row]
        for i in range(times_s.size):
            to_n = north_m + north_m_s * times_s[i] - places[i, 0]
            to_e = east_m + east_m_s * times_s[i] - places[i, 1]
            room_m = math.hypot(to_n, to_e) - touch_m
            least_m = min(least_m, room_m)
            if room_m < near_m and times_s[i] < first_s:
                first_s = times_s[i]
                j = max(i, 1)
                step_s = times_s[j] - times_s[j - 1]
                apart_n = north_m_s - (places[j, 0] - places[j - 1, 0]) / step_s
                apart_e = east_m_s - (places[j, 1] - places[j - 1, 1]) / step_s
                closing_m_s = math.hypot(apart_n, apart_e)
    return Near(first_s, least_m, closing_m_s)
