"""Controller that plans motions: each tick a motion planner finds what to do next, and its beginning is told.

It is told only as long as the rover may be left alone with it: held for as long as a velocity lasts
(``guidance.velocity_lasts_s``), and braked then, the rover stays on ground that is free and seen. Without a guard
that is slow, and where a position leads on faster that takes its place (``position_ahead``).

Nouns: motion controller.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.control.blind_behind import backwards_m_s
from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.following import GUARDED_S, SOON_S, Following, alone_s, turn_gains
from companion.control.last_command_kernels import admitted_speeds, braking_spares_m, may_be_last
from companion.control.local_view import LocalView
from companion.control.motion_ground import NEAR_M, Window, comes_from_m, look_round
from companion.control.motion_kernels import (
    Body,
    MotionProblem,
    RoverModel,
    Start,
    Weights,
    way_of,
)
from companion.control.motion_planners import Found, MotionPlanner
from companion.control.position_ahead import PositionAhead
from companion.control.reference_path import Points, ReferencePath
from companion.control.standstill import STANDS_M_S, Standstill
from companion.control.told import ToldVelocity, in_force
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint
from companion.vehicle.commands import GuidedVelocity

HORIZON_S, STEP_S = 2.5, 0.1
ALONE_STEP_S = 0.05
"""Of the way of a rover that is left alone: a turn that begins so much earlier ends decimetres away."""
LOOKS_S = 0.09
"""The ground is looked at anew after so long, and whenever a scan was mapped: the last look knows that scan, too."""
WEIGHTS = Weights(
    margin_m=0.03,
    margin_s=0.06,
    tight=4.0,
    near_m=0.4,
    risk=0.5,
    unseen=0.3,
    turn=0.5,
    change=0.1,
    late=0.4,
    in_line=2.0,
)
SHARES = (1.0, 0.7, 0.4, 0.15)
"""Of the speed that was planned, tried in turn until the rover may be left alone with it."""
BRAKE_TURNS = np.array([0.0, -0.5, 0.5, -1.0, 1.0])
"""Turn rates to brake with, as shares of the fastest."""
ENOUGH_M = 0.1
"""With so much room it does not turn while it brakes."""
STRAIGHTER_M = 0.03
"""Nor where turning keeps less room than this and hardly more than braking straight on: no model of a rover is that
exact."""
DRAGGED_STRAIGHTER_M = 0.1
"""The same on ground that drags it."""
TURN_SHARES = np.linspace(-1.0, 1.0, 17)
"""Turn rates for which the fastest speed is looked for that may be told, as shares of the fastest."""
NONE_ADMITTED = np.zeros((len(TURN_SHARES), 2))
FASTER_S, BLUR_S, MOST_BLUR_RAD = 0.04, 1.15, math.radians(10.0)
"""Left alone, the rover keeps so much more room for each m/s; more where a reading speaks for a wide angle: how far to
the side something ends that is as far away as the rover needs to stop is known only to within half of that."""
LONGER_BLUR = 0.5
"""Half of that angle, for each second longer than with a guard that a velocity lasts: so much farther away it is."""
DRIFT_SHARE = 0.05
"""For each second longer than with a guard that a velocity lasts, a rover that is left alone keeps so much more room
for each m/s: meanwhile its position, by which the map was made, drifts, and small errors grow."""
FASTER_DRAGGED_M_S = 1.0
"""A rover that the ground drags is told no more than so much above its speed. ArduRover opens the throttle for what is
told, and told to stand begins from there: it took 2 s until the throttle began to close. Half of it brought the rover
over gravel later than no limit at all, all of it sooner: it brakes less (7 drives through ``depot``)."""
PLANNED_SHARE = 0.95
"""Motions are planned with so much of the braking there should be, so that the last look seldom says no."""


Problems = tuple[MotionProblem, ...]
"""Of rovers that obey at different times: what is told must be safe for each."""


@dataclass(frozen=True, eq=False, slots=True)
class MotionChoice:
    """What was judged in one tick, and what was told then. Places: metres east and north of ``corner``.

    ``ahead``: told in its place, as it leads on faster.
    """

    time_s: float
    problem: MotionProblem
    found: Found
    told: ToldVelocity
    corner: NedPoint
    outline: Footprint
    ahead: ControlCommand | None = None


class MotionController:
    """Remembers the ground it looked at."""

    def __init__(self, footprint: Footprint, planner: MotionPlanner) -> None:
        self._outline = footprint
        places_m, radius_m = footprint.discs()
        self._body = Body(places_m, radius_m, float(np.abs(places_m).max()) + radius_m)
        self._planner = planner
        self._position = PositionAhead()
        self._window: Window | None = None
        self._looked_s = self._time_s = -math.inf
        self._looked_scans = 0
        self._began: NedPoint | None = None
        """Where it was first led on the map as it is."""
        self._came_m = 0.0
        """So far it has rolled forwards since."""
        self._worst: Problems = ()
        self.choice: MotionChoice | None = None
        """The last one."""
        self.backwards = False
        """Whether the rover rolled tail first when it was last led."""
        self._standstill = Standstill()

    def line_ahead(self, path: ReferencePath | None) -> ReferencePath | None:
        """The path itself."""
        return path

    def foreseen(self, path: ReferencePath, view: LocalView, times_s: Points) -> Points | None:
        """The motion that was chosen, as told, and then on along the path; None while a position leads along it."""
        if self.choice is None or self.choice.time_s != view.pose.time_s or self.choice.ahead is not None:
            return None
        motion = self.choice.found.motion.copy()
        motion[0] = self.choice.told.speed_m_s, self.choice.told.turn_rad_s
        way = self._way(motion, view)
        last_s = STEP_S * (len(way) - 1)
        places = _at_moments(way, times_s)
        ahead = path.points[path.progress :]
        on = np.vstack((way[-1], ahead[int(np.argmin(((ahead - way[-1]) ** 2).sum(axis=1))) + 1 :]))
        reached_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(on, axis=0).T))))
        along_m = (times_s - last_s) * view.rover.cruise_speed_m_s
        further = np.column_stack([np.interp(along_m, reached_m, on[:, axis]) for axis in range(2)])
        return np.where((times_s > last_s)[:, None], further, places)

    def turned_stops(self, view: LocalView, times_s: Points) -> Iterator[tuple[ControlCommand, Points]]:
        """See ``Controller``: those that keep clear however much the rover turns."""
        if self.choice is None or self.choice.time_s != view.pose.time_s or view.speed_m_s <= STANDS_M_S:
            return
        turns_rad_s = BRAKE_TURNS[BRAKE_TURNS != 0.0] * self.choice.problem.model.turn_fastest_rad_s
        spares_m = _braking_spares_m(turns_rad_s, view, self._worst)
        for turn_rad_s in turns_rad_s[spares_m >= STRAIGHTER_M]:
            motion = np.tile((0.0, turn_rad_s), (len(self.choice.found.motion), 1))
            command = ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, float(turn_rad_s)), 0.0)
            yield command, _at_moments(self._way(motion, view), times_s)

    def _way(self, motion: NDArray[np.float64], view: LocalView) -> Points:
        """Where a motion leads, every ``STEP_S``.

        It brakes no better than a rover that is told to stand is taken to: else going on would seem to end sooner.
        """
        assert self.choice is not None
        problem, corner = self.choice.problem, self.choice.corner
        brakes_m_s2 = min(problem.model.decel_m_s2, view.settings.guidance.deceleration_m_s2)
        problem = problem._replace(model=problem.model._replace(decel_m_s2=brakes_m_s2))
        places: Points = way_of(motion, problem)[:, ::-1] + (corner.north_m, corner.east_m)
        return places

    def reset(self) -> None:
        """The path is void, and what was planned along it."""
        self._planner.forget()
        self._position = PositionAhead()
        self._window = None

    def follow(self, path: ReferencePath, view: LocalView) -> ControlCommand:
        """The beginning of the best motion, or of a slower one, or to brake; or a position that leads on faster."""
        now_s, model = view.pose.time_s, rover_model(view)
        self.backwards = view.rolls_back
        passed_s = min(max(now_s - self._time_s, 0.0), 1.0)
        self._time_s = now_s
        self._standstill.note(view)
        self._note_way(view, passed_s)
        problem = self._problem(path, view, model)
        assert self._window is not None
        if not self._window.is_known:  # the first scan is still to come
            return stop_for(Purpose.BLOCKED)
        later = problem._replace(
            start=problem.start._replace(speed_m_s=view.shoots_m_s),
            model=worst_model(model, view.following),
            pending=_pending(view, _latest(view), ALONE_STEP_S),
            step_s=ALONE_STEP_S,
        )
        worst = self._worst = _sooner_or_later(later, view)
        problem = problem._replace(admitted_m_s=_admitted(view, worst))
        if view.speed_m_s < STANDS_M_S and not _leads_on(problem):
            return stop_for(Purpose.BLOCKED)
        found = self._planner.plan(problem, passed_s)
        told = self._against_roll(self._safe(found.motion[0], view, worst), view, worst)
        self._standstill.told(told.speed_m_s, view, guarded=_is_guarded(view))
        ahead = self._position.faster_than(told.speed_m_s, path, view)
        self.choice = MotionChoice(now_s, problem, found, told, self._window.corner, self._outline, ahead)
        if ahead is not None:
            return ahead
        if abs(told.speed_m_s) < 1e-6:
            if view.speed_m_s > STANDS_M_S:
                return ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, told.turn_rad_s), 0.0)
            if told.turn_rad_s == 0.0:
                return stop_for(Purpose.BLOCKED)
        return ControlCommand(Purpose.DRIVE, GuidedVelocity(told.speed_m_s, told.turn_rad_s), abs(told.speed_m_s))

    def _note_way(self, view: LocalView, passed_s: float) -> None:
        """The ground under a rover is seen: where that is forgotten, the map was begun anew."""
        if self._began is None or not _is_seen(view, self._began):
            self._began, self._came_m = view.pose.point, 0.0
        elif view.forward_m_s > STANDS_M_S:
            self._came_m += view.forward_m_s * passed_s

    def _problem(self, path: ReferencePath, view: LocalView, model: RoverModel) -> MotionProblem:
        now_s, pose = view.pose.time_s, view.pose
        if self._window is None or view.scans != self._looked_scans or now_s - self._looked_s >= LOOKS_S:
            came_here = self._came_m > comes_from_m(self._body)
            self._window = look_round(
                view.evidence, pose.point, path, self._body, model.fastest_m_s,
                stops_at=_stops_at(view, model), came_here=came_here,
            )  # fmt: skip
            self._looked_s, self._looked_scans = now_s, view.scans
        start = Start(*self._window.place(pose.point), pose.heading_rad, view.forward_m_s, view.yaw_rate_rad_s)
        pending = _pending(view, round(model.dead_s / STEP_S), STEP_S)
        return MotionProblem(
            start, pending, self._window.ground, self._body, model, WEIGHTS, NONE_ADMITTED, HORIZON_S, STEP_S
        )

    def _safe(self, wanted: NDArray[np.float64], view: LocalView, worst: Problems) -> ToldVelocity:
        """This command, or a slower one, or the best way to brake."""
        now_s, speed_m_s, turn_rad_s = self._time_s, float(wanted[0]), float(wanted[1])
        for share in SHARES:
            # On the same arc; a rover that hardly moves keeps its turn rate.
            slower_m_s, turns_rad_s = share * speed_m_s, (share if abs(speed_m_s) > 0.1 else 1.0) * turn_rad_s
            told = ToldVelocity(now_s, 0.0 if self._is_to_stand(slower_m_s, view) else slower_m_s, turns_rad_s)
            if _may_be_left_alone(told, view, worst):
                return told
        return self._braking(view, worst)

    def _is_to_stand(self, speed_m_s: float, view: LocalView) -> bool:
        """Whether it must have stood before it is told this."""
        return self._standstill.is_needed_for(speed_m_s, view, guarded=_is_guarded(view))

    def _against_roll(self, told: ToldVelocity, view: LocalView, worst: Problems) -> ToldVelocity:
        """Against its roll, where it is to stand and rolls back."""
        against_m_s = 0.0 if told.speed_m_s else self._standstill.against_roll_m_s(view)
        against = told._replace(speed_m_s=against_m_s)
        return against if against_m_s and _may_be_left_alone(against, view, worst) else told

    def _braking(self, view: LocalView, worst: Problems) -> ToldVelocity:
        """The way to brake that keeps most room; straight on where there is enough, or where dragged and in doubt."""
        now_s, fastest_rad_s = self._time_s, worst[0].model.turn_fastest_rad_s
        spares_m = _braking_spares_m(BRAKE_TURNS * fastest_rad_s, view, worst)
        doubtful = (BRAKE_TURNS != 0.0) & (spares_m < STRAIGHTER_M)
        # How fast it shoots ahead where ground ends that drags it is a guess, and so is where it turns meanwhile.
        worse_m = STRAIGHTER_M if view.dragged_m_s == 0.0 else DRAGGED_STRAIGHTER_M
        best = float(BRAKE_TURNS[np.argmax(np.minimum(spares_m, ENOUGH_M) - np.where(doubtful, worse_m, 0.0))])
        rolls = abs(worst[0].start.speed_m_s) > STANDS_M_S
        return ToldVelocity(now_s, 0.0, best * fastest_rad_s if rolls else 0.0)


def _at_moments(way: Points, times_s: Points) -> Points:
    """Where the rover is at these moments on a way with a place every ``STEP_S``; at its end afterwards."""
    at_s = np.arange(len(way)) * STEP_S
    return np.column_stack([np.interp(times_s, at_s, way[:, axis]) for axis in range(2)])


def _stops_at(view: LocalView, model: RoverModel) -> NedPoint:
    """Where it comes to stand if it brakes straight on, as late and as little as is to be reckoned with."""
    worst, speed_m_s = worst_model(model, view.following), abs(view.shoots_m_s)
    stops_m = speed_m_s * _latest(view) * ALONE_STEP_S + speed_m_s**2 / (2.0 * worst.decel_m_s2)
    course_rad = view.pose.heading_rad + (math.pi if view.rolls_back else 0.0)
    return view.pose.point.moved(course_rad, stops_m)


def _is_seen(view: LocalView, point: NedPoint) -> bool:
    """Whether the map knows the ground there."""
    x, y = (math.floor(v) for v in view.evidence.frame.xy(point))
    height, width = view.evidence.log_odds.shape
    return 0 <= x < width and 0 <= y < height and bool(view.evidence.log_odds[y, x] != 0.0)


def _admitted(view: LocalView, worst: Problems) -> NDArray[np.float64]:
    """See ``MotionProblem.admitted_m_s``: the rover may be left alone with these."""
    turns_rad_s = TURN_SHARES * worst[0].model.turn_fastest_rad_s
    lasts_s = view.settings.guidance.velocity_lasts_s
    gains = turn_gains(view.following, lasts_s)
    admitted: NDArray[np.float64] = np.minimum.reduce(
        [admitted_speeds(turns_rad_s, lasts_s, gains, WEIGHTS.margin_m, _faster_s(view), one) for one in worst]
    )
    return admitted


def _is_guarded(view: LocalView) -> bool:
    """Whether what is told ends as soon as with a guard."""
    return view.settings.guidance.velocity_lasts_s <= GUARDED_S


def _faster_s(view: LocalView) -> float:
    """Room for each m/s."""
    left_s, beam_rad = alone_s(view.settings.guidance.velocity_lasts_s), min(view.rover.beam_rad, MOST_BLUR_RAD)
    return max(FASTER_S, (BLUR_S + LONGER_BLUR * left_s) * beam_rad) + DRIFT_SHARE * left_s


def _braking_spares_m(turns_rad_s: NDArray[np.float64], view: LocalView, worst: Problems) -> NDArray[np.float64]:
    """The room that is left where the rover brakes and turns at each of these rates, however much it turns."""
    lasts_s = view.settings.guidance.velocity_lasts_s
    gains = turn_gains(view.following, lasts_s)
    spares_m: NDArray[np.float64] = np.minimum.reduce(
        [braking_spares_m(turns_rad_s, lasts_s, gains, ENOUGH_M, one) for one in worst]
    )
    return spares_m


def _may_be_left_alone(told: ToldVelocity, view: LocalView, worst: Problems) -> bool:
    """Whether this may be the last command, however the rover turns."""
    lasts_s, margin_m, faster_s = view.settings.guidance.velocity_lasts_s, WEIGHTS.margin_m, _faster_s(view)
    gains = turn_gains(view.following, lasts_s)
    return all(may_be_last(told.speed_m_s, told.turn_rad_s, lasts_s, gains, margin_m, faster_s, one) for one in worst)


def _sooner_or_later(later: MotionProblem, view: LocalView) -> Problems:
    """The problem of a rover that obeys as late as may be; over a late link, and of a velocity that lasts, also that of
    one that obeys soon.

    A turn that is under way leads elsewhere if it ends sooner: over a late link that is half a second of turning, and
    in the three seconds without a guard a few degrees become half a metre.
    """
    if view.soonest_s >= view.following.dead_s and view.settings.guidance.velocity_lasts_s <= SOON_S:
        return (later,)
    return later, later._replace(pending=_pending(view, _soonest(view), ALONE_STEP_S))


def _latest(view: LocalView) -> int:
    """After how many steps a command has its effect at the latest."""
    return math.ceil(view.following.dead_s * (1.0 + view.following.off_model) / ALONE_STEP_S - 1e-6)


def _soonest(view: LocalView) -> int:
    """After how many steps a command has its effect at the soonest."""
    soonest_s = min(view.soonest_s, view.following.dead_s)
    return math.floor(soonest_s * (1.0 - view.following.off_model) / ALONE_STEP_S + 1e-6)


def _pending(view: LocalView, steps: int, step_s: float) -> NDArray[np.float64]:
    """What was told and has not had its effect yet, one row a step.

    Where that was no velocity, the rover goes on as it does; a position tells it to drive on, as fast as was told for
    that; as fast as the mission says where that is not known.
    """
    rows, now_s, on_m_s = np.zeros((steps, 2)), view.pose.time_s, view.forward_m_s
    if view.by_position(now_s - steps * step_s):
        on_m_s = view.placed_m_s if math.isfinite(view.placed_m_s) else view.rover.cruise_speed_m_s
    for step, row in enumerate(rows):
        told = in_force(view.lately, now_s + (step + 0.5 - steps) * step_s)
        row[:] = (on_m_s, view.yaw_rate_rad_s) if told is None else (told.speed_m_s, told.turn_rad_s)
    return rows


def _leads_on(problem: MotionProblem) -> bool:
    """Whether a way to the end is known from the rover's place or from one near by."""
    ground, start = problem.ground, problem.start
    x, y, near = (round(v / ground.togo_cell_m) for v in (start.x_m, start.y_m, NEAR_M))
    around = ground.togo_s[max(y - near, 0) : y + near + 1, max(x - near, 0) : x + near + 1]
    return bool(np.isfinite(around).any())


def worst_model(model: RoverModel, follows: Following) -> RoverModel:
    """A rover that gathers speed as fast as may be, and brakes worse than it should."""
    brakes_m_s2 = model.decel_m_s2 * (1.0 - follows.off_model) / PLANNED_SHARE
    return model._replace(accel_m_s2=follows.gains_most_m_s2, decel_m_s2=brakes_m_s2)


def rover_model(view: LocalView) -> RoverModel:
    """How the rover follows commands, as far as is known."""
    own, limits, rover = view.following, view.settings.motion, view.rover
    fastest_m_s = min(rover.cruise_speed_m_s, rover.told_most_m_s)
    if view.may_be_dragged:
        fastest_m_s = min(fastest_m_s, view.speed_m_s + FASTER_DRAGGED_M_S)
    back_m_s = backwards_m_s(min(limits.backwards_m_s, fastest_m_s), view)
    return RoverModel(
        own.dead_s, own.acceleration_m_s2, PLANNED_SHARE * own.deceleration_m_s2, own.turn_acceleration_rad_s2,
        fastest_m_s, back_m_s, min(limits.turn_rad_s, rover.turns_most_rad_s),
        own.turn_gain,
    )  # fmt: skip
