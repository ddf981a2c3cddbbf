"""Frames and scenes: what a viewer shows of one moment of a run, as plain values that become JSON.

``page/model.js`` and the views beside it read them. Places are [north, east] in metres of the local frame, headings
radians clockwise from north.

Nouns: scene, frame.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from companion.app import Companion, Status
from companion.control.controller import ControlCommand
from companion.control.motion_controller import MotionController
from companion.control.motion_kernels import way_of
from companion.core.footprint import Footprint
from companion.core.frames import LocalFrame, NedPoint
from companion.core.scan import RangeScan
from companion.core.severity import Severity
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.executive.mission_run import MissionRun
from companion.mapping.map_queries import clearance_m
from companion.mission.bounds import Bound
from companion.mission.mission import Mission
from companion.navigation.field_step import Action
from companion.safety.mode_latch import Control
from companion.safety.reasons import Activity, EndReason, LatchReason, Reason, RunPhase, WaitReason
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity
from companion.vehicle.events import RoverMode
from companion.vehicle.mode_names import mode_name
from companion.vehicle.state import VehicleState
from companion.viewer.even_rays import even_rays
from companion.viewer.headway import Headway, Hindrance
from companion.viewer.map_tiles import TILE

FORMAT = 1
CIRCLE = 24
"""Corners of a round outline."""
MOST_PATH, MOST_RAYS = 200, 180
CLEARANCE_M = 5.0
"""No wider clearance is told."""
ROLLS_M_S = 0.15
"""A rover that is faster does not stand."""
MOST_MISSED = 3
"""So many targets that were not reached are named."""
REACHED = TargetStatus.REACHED
SOMEBODY = "a person, or by the autopilot itself"
BY_MODE = (WaitReason.PERSON_SETS_MODE, WaitReason.PERSON_SETS_MODE_AND_ARMS)
MAKES_WAY, SEPARATOR = str(Hindrance.MAKES_WAY.value), "; "
AGAIN = "trying again: the way was blocked"
BY_COMPANION = "the companion asked for HOLD"
PLAIN_ENDS = (EndReason.DONE, EndReason.STOPPED_BY_USER, EndReason.TERMINATED)
"""The others are told as what ended the run."""
PAUSED = "paused: after that it waits for Go on"
NOT_REACHED = {TargetStatus.PENDING: "not reached"}
NEWEST_S = 0.5
"""A scan or a planned motion that is older is not shown."""
STATES = {
    RunPhase.CONNECTING: "connecting",
    RunPhase.WAITING: "waiting",
    RunPhase.DRIVING: "driving",
    RunPhase.STAYING: "waiting",
    RunPhase.WAY_BLOCKED: "waiting",
    RunPhase.STOPPED: "stopped",
    RunPhase.STOPPED_AND_WAITING: "stopped",
    RunPhase.ENDED: "ended",
}
LEVELS = {Severity.WARNING: "warning", Severity.NOTICE: "notice", Severity.INFO: "info", Severity.DEBUG: "info"}
"""Whatever is worse is an error."""
AUTOPILOT = "autopilot: "
DRIVES = {
    RoverMode.MANUAL: "pilot",
    RoverMode.HOLD: "nobody",
    RoverMode.AUTO: "autopilot",
    RoverMode.RTL: "autopilot",
    RoverMode.GUIDED: "ground station",
}
"""Who drives where the companion does not; in a mode that is not named here it is the pilot."""
Json = dict[str, Any]


def scene_of(mission: Mission, run: MissionRun, epoch: int) -> Json:
    """What stays as it is for a while. ``epoch``: another number for another map."""
    executor, vehicle, places = run.executor, run.vehicle, run.places
    origin = None if places is None else places.origin
    home = None if places is None else LocalFrame(places.origin).to_ned(places.home)
    return {
        "kind": "scene",
        "format": FORMAT,
        "mission": mission.name,
        "map_epoch": epoch,
        "home": None if home is None else _place(home),
        "origin": None if origin is None else [origin.lat_deg, origin.lon_deg],
        "rover": {"outline": _outline(mission.rover.footprint), "cruise_m_s": mission.rover.cruise_speed_m_s},
        "targets": [] if places is None else [{"name": one.name, "place": _place(one.point)} for one in places.targets],
        "borders": [] if places is None else [border for one in places.bounds for border in _border(one)],
        "map": None if executor is None else _map(executor),
        "vehicle": None if vehicle.heartbeat is None else vehicle.heartbeat.system_id,
    }


def frame_of(companion: Companion, status: Status, headway: Headway | None = None) -> Json:
    """The moment. ``news`` are those of this tick alone."""
    run, executor = companion.mission_run, companion.executor
    vehicle, now_s, pose = run.vehicle, status.time_s, status.pose
    return {
        "kind": "frame",
        "t": round(now_s, 2),
        "pose": None if pose is None else [*_place(pose.point), round(pose.heading_rad, 4)],
        "speed": None if vehicle.position is None else round(vehicle.forward_m_s, 3),
        "turn": 0.0 if vehicle.attitude is None else round(vehicle.attitude.yaw_rate_rad_s, 3),
        **mode_of(vehicle, run),
        **doing_of(companion, status, headway),
        "held_up": "" if headway is None else headway.line,
        "makes_way": headway is not None and headway.stands_for_others,
        "statuses": statuses_of(run),
        "goal": _goal(executor),
        "path": _path(executor),
        "motion": _motion(executor, now_s),
        "setpoint": _setpoint(run.told),
        "rays": _rays(vehicle, now_s),
        "movers": [] if executor is None else _movers(executor, now_s),
        "figures": _figures(companion, status),
        "battery": _battery(vehicle),
        "gps": _gps(vehicle),
        "decision": 0 if executor is None else executor.decisions,
        "guard": None if executor is None else vehicle.guard_at(now_s) is not None,
        "paused": run.paused or run.start_paused,
        "news": news_of(status),
    }


def news_of(status: Status, headway: Headway | None = None) -> list[Json]:
    """The texts of this tick; the last one, where it begins now, why the rover does not get on."""
    news = [told(status.time_s, LEVELS.get(one.severity, "error"), one.text, own=one.own) for one in status.news]
    if headway is not None and headway.begins:
        news.append(told(status.time_s, "notice", headway.line))
    return news


def told(time_s: float, level: str, text: str, *, own: bool = True) -> Json:
    """One of the news. ``own``: it is not the autopilot that says it, whose name the page puts before it."""
    return {"t": round(time_s, 2), "level": level, "text": text if own else text.removeprefix(AUTOPILOT), "own": own}


def _place(point: NedPoint) -> list[float]:
    return [round(point.north_m, 3), round(point.east_m, 3)]


def _goal(executor: MissionExecutor | None) -> Json | None:
    """What the rover heads for. ``asked``: a person has asked for it on the way; it is none of the targets."""
    if executor is None or executor.progress.ended:
        return None
    goal = executor.progress.goal
    return {"name": goal.name, "place": _place(goal.point), "asked": executor.progress.requested is not None}


def _places(points: NDArray[np.float64], most: int) -> list[list[float]]:
    """Rows north and east, thinned to at most so many, with both ends."""
    if len(points) > most:
        points = points[np.linspace(0, len(points) - 1, most).astype(int)]
    rounded: list[list[float]] = np.round(points, 2).tolist()
    return rounded


def _outline(footprint: Footprint) -> list[list[float]]:
    """Corners: metres ahead and to the right."""
    if footprint.is_circle:
        angles = np.arange(CIRCLE) * (2.0 * math.pi / CIRCLE)
        corners = footprint.front_m * np.column_stack((np.cos(angles), np.sin(angles)))
        rounded: list[list[float]] = np.round(corners, 3).tolist()
        return rounded
    front, rear, side = footprint.front_m, -footprint.rear_m, footprint.half_width_m
    return [[front, side], [rear, side], [rear, -side], [front, -side]]


def _border(bound: Bound) -> list[Json]:
    """A border, one for each of its rings."""
    rings: list[BaseGeometry] = []
    for part in shapely.get_parts(bound.shape):
        rings += [part.exterior, *part.interiors] if hasattr(part, "exterior") else [part]
    return [
        {
            "name": bound.name,
            "keeps_in": bound.keeps_in,
            "corners": np.round(shapely.get_coordinates(ring)[:, ::-1], 3).tolist(),
        }
        for ring in rings
    ]


def _map(executor: MissionExecutor) -> Json:
    evidence = executor.evidence
    rows, columns = evidence.log_odds.shape
    corner = evidence.base.south_west
    return {
        "south_m": corner.north_m,
        "west_m": corner.east_m,
        "cell_m": evidence.evidence_m,
        "columns": columns,
        "rows": rows,
        "tile": TILE,
    }


def statuses_of(run: MissionRun) -> list[str]:
    """What has become of each target. One that will be tried again is no failure yet: it is waited for, or next."""
    statuses = [str(one) for _, one in run.statuses()]
    progress = None if run.executor is None else run.executor.progress
    if progress is not None and progress.tries_again and run.end is None:
        waits = progress.phase is MissionPhase.WAIT
        statuses[progress.index] = "waiting" if waits else str(TargetStatus.PENDING)
    return statuses


def doing_of(companion: Companion, status: Status, headway: Headway | None = None) -> Json:
    """One large line; then what is awaited where it says why the rover stands, or why it drives as it does."""
    activity, line, why = status.activity, status.doing, ""
    if activity.phase is RunPhase.DRIVING and status.target:
        line, why = _driving(companion, status, headway)
    elif activity.phase in (RunPhase.WAY_BLOCKED, RunPhase.STAYING) and companion.executor is not None:
        line, why = _standing(companion.executor, status)
    elif activity.phase is RunPhase.STOPPED_AND_WAITING:
        line, why = _stopped(companion, activity)
    elif activity.phase is RunPhase.WAITING:
        line, _, why = line.partition(" (")
        why = why.removesuffix(")")
        if companion.mission_run.start_paused and activity.awaited != Reason(WaitReason.REQUEST_TO_BEGIN):
            why = SEPARATOR.join(filter(None, (why, PAUSED)))
    state = STATES[activity.phase]
    if state == "driving" and headway is not None and headway.stands_for_others:
        state = "waiting"
    if state == "stopped" and (other := _driven_by(companion)):
        line, state = other, "waiting"
    elif state == "stopped" and abs(companion.vehicle.forward_m_s) > ROLLS_M_S:
        line = line.replace("stopped: ", "stopping: ", 1)
    elif activity.phase is RunPhase.ENDED and activity.reason is not None:
        line, why = ending_of(companion, activity.reason)
    return {"line": line, "why": why, "state": state}


def _driving(companion: Companion, status: Status, headway: Headway | None) -> tuple[str, str]:
    """Where to, that it goes back first, or why it does not get on.

    Then why early, that it makes way, and why it has just taken another way.
    """
    goes_back = status.decision is not None and status.decision.action is Action.BACKTRACK
    line = f"going back to find another way to {status.target}" if goes_back else f"driving to {status.target}"
    early = companion.outcome.broken_off
    why = [] if early is None else [str(early)]
    if headway is not None and (doing := headway.doing(status.target)):
        return doing, SEPARATOR.join(why)
    if companion.executor is not None and companion.executor.driver.makes_way:
        why.append(MAKES_WAY)
    if headway is not None and headway.rerouted:
        why.append(headway.rerouted)
    if not why and companion.executor is not None and companion.executor.progress.tries_again:
        why.append(AGAIN)
    return line, SEPARATOR.join(why)


def _standing(executor: MissionExecutor, status: Status) -> tuple[str, str]:
    """Where the rover stands and makes way or waits, for how long, and what comes then."""
    progress = executor.progress
    goal, left_s = progress.goal.name, progress.until_s - status.time_s
    if executor.phase is RunPhase.WAY_BLOCKED:
        since_s = executor.blocked_since_s
        why = [] if since_s is None else [f"blocked for {lasting(status.time_s - since_s)}"]
        why.append(f"tries again in {lasting(left_s)}")
        if since_s is not None and progress.give_up_s is not None:
            why.append(f"gives up in {lasting(progress.give_up_s - status.time_s)}")
        return f"waiting for the way to {goal} to clear", ", ".join(why)
    if progress.phase is not MissionPhase.STAY:
        return "staying here for the mission's commands", f"next: {goal}"
    if progress.statuses[progress.index] is not REACHED:  # AUTO has not handed over a leg
        return "staying where it is", ""
    stays = f"for {lasting(left_s)} more" if 0.0 < left_s < math.inf else ""
    commands = "until its commands are done" if progress.commands.keeps_here else ""
    last = progress.following >= len(progress.targets)
    then = "it is the last target" if last else f"next: {progress.targets[progress.following].name}"
    return f"staying at {goal}", SEPARATOR.join(filter(None, (stays or commands, then)))


def lasting(seconds: float) -> str:
    """A duration as the page tells them: 4 s, 3 min, 2 h."""
    if seconds < 100.0:
        return f"{max(seconds, 0.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.0f} h"


def _stopped(companion: Companion, activity: Activity) -> tuple[str, str]:
    """Why it stands, and what for. Data that is missing comes before the mode: mostly the one has led to the other.
    An autopilot that has restarted has led to everything else.
    """
    run, awaited = companion.mission_run, activity.awaited
    waiting = f"waiting for {awaited}"
    if activity.reason is not None and activity.reason.kind is LatchReason.RESTARTED:
        return f"stopped: {activity.reason}", waiting
    if awaited is not None and awaited.kind is WaitReason.GOOD_DATA_AND:
        data, person = awaited.figures
        return f"stopped: {data}", f"waiting for good data and {person}"
    if run.taken_over and awaited is not None and awaited.kind in BY_MODE:
        return f"stopped: {mode_name(companion.vehicle)} was set by {SOMEBODY}", waiting
    if run.held_for is not None:
        waiting = f"it had stopped: {run.held_for} ({BY_COMPANION}){SEPARATOR}{waiting}"
    return f"stopped: {activity.reason}", waiting


def _driven_by(companion: Companion) -> str:
    """Who drives in place of the companion; empty for nobody."""
    run, vehicle = companion.mission_run, companion.vehicle
    if run.stop is None or run.stop.reason is None or run.stop.reason.kind is not LatchReason.OTHER_MODE:
        return ""
    driver = mode_of(vehicle, run)["drives"]
    return "" if driver in ("nobody", "companion") else f"the {driver} drives ({mode_name(vehicle)})"


def ending_of(companion: Companion, reason: Reason[Enum]) -> tuple[str, str]:
    """How it ended; which targets were not reached, and how the rover is left where a person must know."""
    line = str(reason) if reason.kind in PLAIN_ENDS else f"ended, {reason}"
    before: list[str] = []
    if reason.kind is EndReason.NOBODY_HERE:
        line, before = "ended, nobody is here", [_unattended(companion)]
    statuses = companion.statuses()
    missed = [f"{name}: {NOT_REACHED.get(status, status)}" for name, status in statuses if status != REACHED]
    left = [] if companion.parting is None else [str(companion.parting)]
    if not missed:
        return line, SEPARATOR.join(before + left)
    more = f", and {len(missed) - MOST_MISSED} more" if len(missed) > MOST_MISSED else ""
    early = companion.outcome.broken_off
    if reason.kind is EndReason.DONE:
        line = "ended" if early is None else f"ended early, {early}"
    reached = f"{len(statuses) - len(missed)} of {len(statuses)} targets reached"
    return f"{line}: {reached}", SEPARATOR.join([*before, ", ".join(missed[:MOST_MISSED]) + more, *left])


def _unattended(companion: Companion) -> str:
    """What a run that nobody attended to waited for, and why the rover stood."""
    activity = companion.mission_run.under_way
    waited = str(activity) if activity.awaited is None else f"it waited for {activity.awaited}"
    if activity.phase is not RunPhase.STOPPED_AND_WAITING:
        return waited
    held_for = companion.mission_run.held_for
    stopped = _stopped(companion, activity)[0].removeprefix("stopped: ")
    if held_for is not None and (activity.reason is None or activity.reason.kind is not LatchReason.RESTARTED):
        stopped = f"{held_for} ({BY_COMPANION})"
    return f"{waited}{SEPARATOR}it had stopped: {stopped}"


def end_of(companion: Companion, reason: Reason[Enum]) -> Json:
    """What changes in the last frame of a run that ended otherwise than by itself."""
    line, why = ending_of(companion, reason)
    statuses = [str(one) for _, one in companion.statuses()]
    return {"state": "ended", "line": line, "why": why, "statuses": statuses}


def mode_of(vehicle: VehicleState, run: MissionRun) -> Json:
    """The mode, whether it is armed, and who drives."""
    heartbeat = vehicle.heartbeat
    if heartbeat is None:
        return {"mode": None, "armed": None, "drives": "nobody"}
    named = heartbeat.mode in RoverMode.__members__.values()
    drives = DRIVES[RoverMode(heartbeat.mode)] if named else "pilot"
    if vehicle.is_ours:  # in doubt it has given the rover up, and asked for HOLD
        drives = "companion" if run.latch.control is Control.COMPANION else "nobody"
    return {"mode": mode_name(vehicle), "armed": heartbeat.armed, "drives": drives if heartbeat.armed else "nobody"}


def _path(executor: MissionExecutor | None) -> list[list[float]]:
    path = None if executor is None else executor.driver.path
    return [] if path is None else _places(path.points[path.progress :], MOST_PATH)


def _motion(executor: MissionExecutor | None, now_s: float) -> list[list[float]]:
    """The motion that was planned last."""
    controller = None if executor is None else executor.driver.controller
    choice = controller.choice if isinstance(controller, MotionController) else None
    if choice is None or now_s - choice.time_s > NEWEST_S:
        return []
    corner = np.array((choice.corner.north_m, choice.corner.east_m))
    return _places(corner + way_of(choice.found.motion, choice.problem)[:, ::-1], MOST_PATH)


def _setpoint(told: ControlCommand | None) -> Json | None:
    match None if told is None else told.setpoint:
        case None:
            return None
        case GuidedPosition(point):
            return {"kind": "position", "place": _place(point)}
        case GuidedHeading(heading_rad):
            return {"kind": "heading", "heading": round(heading_rad, 3)}
        case GuidedVelocity(0.0, 0.0):
            return {"kind": "stop"}
        case GuidedVelocity(forward_m_s, yaw_rate_rad_s):
            return {"kind": "velocity", "speed": round(forward_m_s, 2), "turn": round(yaw_rate_rad_s, 3)}


def _rays(vehicle: VehicleState, now_s: float) -> Json | None:
    """The newest scan, thinned."""
    seen = vehicle.scan
    if seen is None or now_s - seen.time_s > NEWEST_S or len(seen.scan.bearing_rad) == 0:
        return None
    return {**_thinned(seen.scan), "age_s": round(now_s - seen.time_s, 2)}


def _thinned(scan: RangeScan) -> Json:
    first_rad, step_rad, ranges = even_rays(scan, MOST_RAYS)
    far_m = round(scan.max_range_m, 2)
    metres = [None if math.isnan(one) else (far_m if math.isinf(one) else round(one, 2)) for one in ranges.tolist()]
    return {"from": round(first_rad, 4), "step": round(step_rad, 5), "m": metres, "max_m": far_m}


def _movers(executor: MissionExecutor, now_s: float) -> list[Json]:
    return [
        {
            "place": _place(one.at(now_s)),
            "velocity": [round(one.north_m_s, 2), round(one.east_m_s, 2)],
            "radius_m": round(one.radius_m, 2),
            "name": one.name,
        }
        for one in executor.moving
    ]


def _figures(companion: Companion, status: Status) -> Json:
    run, executor, pose = companion.mission_run, companion.executor, status.pose
    ticks = companion.outcome.tick_seconds
    searches_s = [] if executor is None else executor.driver.searcher.seconds
    clear_m = None
    if executor is not None and pose is not None:
        room_m = clearance_m(executor.evidence, pose.point, CLEARANCE_M) - run.mission.rover.footprint.inscribed_m
        clear_m = round(max(room_m, 0.0), 2)
    return {
        "clearance_m": clear_m,
        "planning_ms": round(1e3 * searches_s[-1], 1) if searches_s else None,
        "latency_ms": round(1e3 * run.vehicle.latency_s, 1) or None,  # 0: not measured yet
        "tick_ms": round(1e3 * ticks[-1], 2) if ticks else None,
    }


def _battery(vehicle: VehicleState) -> Json | None:
    seen = vehicle.battery
    return None if seen is None else {"volts": seen.volts, "percent": seen.percent}


def _gps(vehicle: VehicleState) -> Json | None:
    seen = vehicle.gps
    return None if seen is None else {"fix": seen.fix.text, "satellites": seen.satellites}
