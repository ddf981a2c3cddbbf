"""Compiles every hot loop before the rover may move, so that no compilation falls into a drive.

Nouns: warm-up.
"""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
from numba.core import event

from companion.control.arc_controller import ArcController
from companion.control.collision_avoidance import first_near, least_room_m
from companion.control.following import Following
from companion.control.local_view import LocalView
from companion.control.model_estimate import fit_of
from companion.control.motion_controller import MotionController
from companion.control.motion_planners import motion_planner
from companion.control.motion_prediction import steered
from companion.control.reference_path import ReferencePath
from companion.control.safe_reach import farthest_clear
from companion.control.setpoint_check import velocity_stops_in_time
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.own_parts import OwnKind, blamed
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.mapping.evidence_map import integrate, new_map, penalise
from companion.mapping.map_edits import move
from companion.mapping.map_queries import clearance_m, look_along, unseen_beside
from companion.mission.bounds import Bounds
from companion.perception.object_tracker import ObjectTracker
from companion.perception.range_age import FEW, RangeAges
from companion.planning import registry
from companion.settings import Settings
from companion.settings.settings_file import by_points
from companion.vehicle.commands import GuidedVelocity
from companion.vehicle.events import AttitudeSeen
from companion.vehicle.state import VehicleState

COMPILING = "compiling, once on this machine: about a minute, several on a Raspberry Pi"
"""Shown before a ``warm_up`` that has something to compile."""


def warm_up(settings: Settings, turning_radius_m: float = 0.0) -> None:
    """Run every compiled kernel that a drive of such a rover with these settings uses once, with the types it uses.

    Those for points, too: whether motions can be planned is known only once the sensors are.
    """
    registry.warm_up((settings.navigator.planner,), settings.planner)
    evidence = new_map(empty_grid(8, 8), 0.35, settings.mapping)
    bearings = np.array([0.0, 0.5])
    scan = RangeScan(0.0, bearings, np.array([2.0, np.inf]), 0.2, 4.0, 0.1, "warm-up")
    integrate(evidence, Pose(4.0, 4.0, 0.0, 0.0), scan, 1)
    penalise(evidence, evidence.base.cell_at(NedPoint(1.0, 1.0)), 0.1)
    move(evidence, 0.0, 0.0)
    look_along(evidence, NedPoint(4.0, 4.0), NedPoint(6.0, 4.0), 0.5)
    unseen_beside(evidence, NedPoint(4.0, 4.0), NedPoint(6.0, 4.0), 0.3, 0.5)
    clearance_m(evidence, NedPoint(4.0, 4.0), 1.0)
    view = RangeScan(0.0, np.linspace(-0.5, 0.5, 8), np.full(8, 2.0), 0.2, 4.0, 0.02, "warm-up")
    ObjectTracker(evidence).take(Pose(4.0, 4.0, 0.0, 0.0), 0.0, view)
    places = np.zeros((2, 2))
    _age_of_ranges(view)
    least_room_m(places, np.ones((1, 5)), np.array([0.0, 0.2]), np.array([0.3, 0.3]))
    steered(0.0, 0.0, 0.0, places, np.zeros(2), np.zeros(1))
    first_near(places, np.ones((1, 5)), np.array([0.0, 0.2]), 0.1)
    at = LocalView(Pose(4.0, 4.0, 0.0, 0.0), 0.2, evidence, RoverLimits(0.35, 2.0, 4.0), by_points(settings))
    farthest_clear(ReferencePath(np.column_stack((np.linspace(4.0, 7.0, 13), np.full(13, 4.0)))), at)
    velocity_stops_in_time(GuidedVelocity(0.2, 0.1), at, Bounds())
    if turning_radius_m > 0.0:
        _steer(by_points(settings))
    if settings.guidance.controller != "points":
        _plan_motions(settings)


def _age_of_ranges(view: RangeScan) -> None:
    """Two scans, of a rover that begins to turn."""
    ages, far = RangeAges(), replace(view, bearing_rad=np.linspace(-0.5, 0.5, FEW), range_m=np.full(FEW, 2.0))
    for time_s, rate_rad_s in ((0.0, 0.0), (1.0, 0.0), (2.0, 1.0)):
        ages.hear(VehicleState(attitude=AttitudeSeen(time_s, time_s, 0.0, rate_rad_s)))
        ages.note(far, Pose(4.0, 4.0, 0.0, time_s), 0.0, rate_rad_s)


def _plan_motions(settings: Settings) -> None:
    """Two ticks on ground that is seen, and one with something before the rover."""
    evidence = new_map(empty_grid(16, 16), 0.35, settings.mapping)
    evidence.log_odds.fill(-1.0)
    path = ReferencePath(np.column_stack((np.linspace(3.0, 12.0, 37), np.full(37, 8.0))))
    fit_of(Following(), np.zeros((2, 5)), 0.0)
    planner = motion_planner(settings.guidance.controller)
    controller, rover = MotionController(Footprint.rectangle(0.7, 0.5), planner), RoverLimits(0.35, 2.0, 8.0)
    for tick in range(3):
        view = LocalView(Pose(3.0, 8.0, 0.0, 0.2 * tick), 1.0, evidence, rover, settings)
        velocity_stops_in_time(GuidedVelocity(0.2, 0.1), view, Bounds())
        with blamed(OwnKind.CONTROLLER, settings.guidance.controller):
            controller.follow(path, view)
        evidence.log_odds[40:44] = 3.0


def settle() -> None:
    """For a process that drives once: take what lives now out of garbage collection, since it lives to the end.

    A collection that walked through it would stall a tick for a tenth of a second.
    """
    gc.collect()
    gc.freeze()


class _ColdError(Exception):
    """A kernel would have to be compiled."""


class _NoCompiler(event.Listener):
    """Stops the compiler before it begins."""

    def on_start(self, event: event.Event) -> None:
        """A kernel is not in the cache."""
        raise _ColdError

    def on_end(self, event: event.Event) -> None:
        """Never called: no compilation begins."""


def kernels_warm(settings: Settings, turning_radius_m: float = 0.0) -> bool:
    """Whether ``warm_up`` has nothing to compile on this machine. Loads all kernels: about a second."""
    try:
        with event.install_listener("numba:compile", _NoCompiler()):
            warm_up(settings, turning_radius_m)
    except _ColdError:
        return False
    return True


def _steer(settings: Settings) -> None:
    """To a place behind, standing and rolling, with the controller of a rover that cannot turn on the spot."""
    evidence = new_map(empty_grid(16, 16), 0.35, settings.mapping)
    path = ReferencePath(np.column_stack((np.linspace(8.0, 2.0, 25), np.full(25, 8.0))))
    controller, rover = ArcController(), RoverLimits(0.35, 2.0, 8.0, turning_radius_m=1.0)
    for tick in range(8):
        pose, speed_m_s = Pose(8.0 + 0.05 * tick, 8.0, 0.0, 0.05 * tick), 1.0 if tick > 4 else 0.0
        controller.follow(path, LocalView(pose, speed_m_s, evidence, rover, settings))
