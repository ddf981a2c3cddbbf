"""The last look before a setpoint goes out: whatever led to it, it must hold to what is known of the ground.

A setpoint may be the last one that the autopilot ever gets, and it is followed to its end. So each one is asked, with the map as it is now,
whether the rover may be left alone with it. One that may not is replaced by velocity zero, said and counted. That it never happens is
the task of guidance; this file knows nothing of how guidance comes to its answers.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from companion.control.braking import blind_distance_m, braking_distance_m, farthest_m
from companion.control.point_controller import STOP, ControlCommand, Motion
from companion.core.frames import NedPoint, Pose
from companion.core.rover_limits import RoverLimits
from companion.core.severity import Severity
from companion.mapping.arc_kernels import BLOCKED, arc_clear, kept_room
from companion.mapping.evidence_map import EvidenceMap, ground_of, in_cells, look_along
from companion.mission.bounds import Bounds
from companion.settings import Settings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity, Setpoint

SLACK_M = 0.1
"""Guidance looks in steps, and lets a line end a few centimetres before something."""
NEARER_M = 0.05
"""The rover's disc may overlap evidence by so much: evidence has an error, and who stands at a wall must get away from it."""
ARC_PIECES = 8
"""Straight pieces that an arc is made of where borders are concerned."""

Tell = Callable[[str, Severity], None]
"""Says a text with its severity to the people."""


@dataclass(frozen=True, slots=True)
class Output:
    """A setpoint that is about to be sent, and the rover at this moment. ``speed_m_s``: over ground, without a sign."""

    setpoint: Setpoint
    pose: Pose
    speed_m_s: float


@dataclass(frozen=True, eq=False, slots=True)
class Surroundings:
    """What setpoints are held against."""

    evidence: EvidenceMap
    rover: RoverLimits
    settings: Settings
    bounds: Bounds = field(default_factory=Bounds)


Rule = Callable[[Output, Surroundings], str]
"""What is wrong with a setpoint, in a few words without figures; empty for nothing. Pure."""


def position_in_sight(output: Output, known: Surroundings) -> str:
    """A guided position lies within the horizon and stopping distance, and the straight way there is clear and has been seen.

    It may lie beyond seen ground by what the slowest rover needs to brake, for that creeps where a look shows nothing.
    """
    if not isinstance(output.setpoint, GuidedPosition):
        return ""
    settings, evidence = known.settings.guidance, known.evidence
    here, there = output.pose.point, output.setpoint.point
    distance_m = here.distance_m(there)
    if not distance_m <= farthest_m(output.speed_m_s, settings) + SLACK_M:
        return "target farther away than the horizon"
    line = look_along(evidence, here, there, evidence.rover_radius_m)
    if line.clear_m < distance_m - SLACK_M:
        return "target behind something"
    beyond_m = braking_distance_m(settings.min_speed_m_s, settings)
    if line.seen_m + beyond_m < distance_m - SLACK_M:
        return "target on ground not seen"
    return ""


def velocity_stops_in_time(output: Output, known: Surroundings) -> str:
    """A guided velocity that is told no more ends, on the arc it is told, before the rover touches anything that is known."""
    if not isinstance(output.setpoint, GuidedVelocity) or output.setpoint.forward_m_s == 0.0:
        return ""
    forward_m_s, evidence, pose = output.setpoint.forward_m_s, known.evidence, output.pose
    if not math.isfinite(forward_m_s) or not math.isfinite(output.setpoint.yaw_rate_rad_s):
        return "velocity is not a number"
    scale, ground = 1.0 / evidence.evidence_m, ground_of(evidence, pose)
    x, y = in_cells(np.array([[pose.north_m, pose.east_m]]), evidence)[0].tolist()
    base_m_s = max(abs(output.speed_m_s), known.settings.steering.scale_base_m_s)
    curvature_m = output.setpoint.yaw_rate_rad_s / base_m_s
    course_rad = pose.heading_rad + (math.pi if forward_m_s < 0.0 else 0.0)
    reach = blind_distance_m(abs(forward_m_s), known.settings.guidance) * scale
    radius = (evidence.rover_radius_m - NEARER_M) * scale
    room = kept_room(ground, x, y, radius, 0.0)
    if arc_clear(ground, x, y, course_rad, curvature_m / scale, room, reach, BLOCKED) < reach - SLACK_M * scale:
        return "velocity leads into something"
    return ""


def inside_borders(output: Output, known: Surroundings) -> str:
    """The straight way to a guided position, and the way on which a rover with a guided velocity comes to stand, cross no border."""
    setpoint, pose = output.setpoint, output.pose
    if len(known.bounds) == 0:
        return ""
    if isinstance(setpoint, GuidedPosition):
        name = known.bounds.fault((pose.point, setpoint.point))
    elif isinstance(setpoint, GuidedVelocity) and setpoint.forward_m_s != 0.0:
        name = known.bounds.fault(_way_of(setpoint, output, known))
    else:
        return ""
    return f"setpoint leads over the border of {name}" if name else ""


def _way_of(velocity: GuidedVelocity, output: Output, known: Surroundings) -> list[NedPoint]:
    """The arc on which the rover comes to stand, were the velocity ended now: its stopping way, in straight pieces."""
    point, course_rad = output.pose.point, output.pose.heading_rad + (math.pi if velocity.forward_m_s < 0.0 else 0.0)
    fastest_m_s = max(abs(velocity.forward_m_s), output.speed_m_s)
    piece_m = braking_distance_m(fastest_m_s, known.settings.guidance) / ARC_PIECES
    turn_rad = velocity.yaw_rate_rad_s / max(output.speed_m_s, known.settings.steering.scale_base_m_s) * piece_m
    way = [point]
    for i in range(ARC_PIECES):
        way.append(way[-1].moved(course_rad + (i + 0.5) * turn_rad, piece_m))
    return way


RULES: tuple[Rule, ...] = (position_in_sight, velocity_stops_in_time, inside_borders)


def fault_of(output: Output, known: Surroundings, rules: tuple[Rule, ...] = RULES) -> str:
    """What is wrong with a setpoint by the first rule that it breaks; empty for nothing."""
    for rule in rules:
        if fault := rule(output, known):
            return fault
    return ""


class SetpointCheck:
    """Stands between guidance and the outbox. ``refused``: how often each rule was broken."""

    def __init__(self, tell: Tell, rules: tuple[Rule, ...] = RULES) -> None:
        self.refused: Counter[str] = Counter()
        self._tell = tell
        self._rules = rules

    def passed(self, guide: ControlCommand, pose: Pose, speed_m_s: float, known: Surroundings) -> ControlCommand:
        """The same guide, or velocity zero in its place if its setpoint breaks a rule."""
        fault = fault_of(Output(guide.setpoint, pose, speed_m_s), known, self._rules)
        if not fault:
            return guide
        self.refused[fault] += 1
        self._tell(f"Stopping: {fault}", Severity.WARNING)
        return ControlCommand(Motion.BRAKE, STOP, 0.0)
