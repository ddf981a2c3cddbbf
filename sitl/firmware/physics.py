"""Physics for the real firmware: servo outputs in, the rover's state out, one time step for each new frame.

Plant, world and sensors are those of the simulated vehicle; autopilot and estimator are the firmware's. Time passes
only with answers: the firmware waits for each, and takes its clock from the answer's timestamp. So a run is a
function of mission, seed and frames.

Nouns: physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from sitl.autopilot.lidar import Scanner, ScannerPort
from sitl.autopilot.traffic import Traffic, TrafficPort
from sitl.firmware.json_frames import COUNTS, RANGES_MOST, BodyState, ServoFrame, decode, encode
from sitl.plant.closed_loop import NoiseSettings
from sitl.plant.outline import DISC, Outline
from sitl.plant.rover import GRAVITY_M_S2, SIM_ROVER, Drivetrain, drive, meet_movers, new_rover
from sitl.sensors.range_sensors import RangeSensing, SensorSuite
from sitl.world import geodesy
from sitl.world.truth import Collision, SimStart, collision_of
from sitl.world.world import Surroundings, World

PLANT_STEP_S = 0.005
"""The plant's longest step, as in the simulated vehicle."""
LONGEST_STEP_S = 0.09
"""The firmware rejects steps of 0.1 s and more; slower frame rates get this step."""
RANGE_INTERVAL_S = 0.02
"""Interval of rangefinders without their own rate: every main loop of ArduRover."""
MIDDLE_US, SPAN_US = 1500, 500
NO_PULSE_US = (800, 2200)
"""Outside these limits a motor controller sees no signal and stops; 0 is an output that is off."""


@njit(cache=True, nogil=True)
def advance(
    rovers: Any, surroundings: Surroundings, time_s: float, servos: tuple[float, float], steps: int, step_s: float
) -> None:
    """Move the rover by some steps from ``time_s`` on; ``servos``: outputs 1 and 3, -1 to 1."""
    rover = rovers[0]
    for step in range(steps):
        drive(rover, surroundings, servos[0], servos[1], step_s)
        if surroundings.fleet.radii_m.size > 0:
            meet_movers(rover, surroundings.fleet, time_s + (step + 1) * step_s)


def servo_output(pwm_us: int) -> float:
    """The servo output of a pulse, -1 to 1."""
    if not NO_PULSE_US[0] <= pwm_us <= NO_PULSE_US[1]:
        return 0.0
    return min(max((pwm_us - MIDDLE_US) / SPAN_US, -1.0), 1.0)


def frame_step_s(rate_hz: int) -> float:
    """The time step of a frame."""
    return min(1.0 / rate_hz, LONGEST_STEP_S)


@dataclass(slots=True)
class Tally:
    """Counts of what was received, over all starts of the firmware."""

    steps: int = 0
    repeated: int = 0
    """Repeated frames, answered as before."""
    lost: int = 0
    """Missing frames, by their numbers."""
    late: int = 0
    """Copies that arrived after newer frames; not answered."""
    bad: int = 0
    """Datagrams that are not frames; not answered."""
    strangers: int = 0
    """Frames from a second firmware; not answered."""
    starts: int = 0
    """Firmware starts."""


class FrameKind(Enum):
    """What a frame is, compared with the last one."""

    START = auto()
    NEXT = auto()
    REPEATED = auto()
    LATE = auto()
    STRANGER = auto()


class Motion(NamedTuple):
    """Position, heading and velocity of the rover, world frame."""

    north_m: float
    east_m: float
    heading_rad: float
    vel_north_m_s: float
    vel_east_m_s: float


class Physics:
    """Answers the firmware's frames."""

    def __init__(
        self, world: World, start: SimStart, suite: SensorSuite, seed: int = 0, outline: Outline = DISC,
        turning_radius_m: float = 0.0, range_noise_m: float = NoiseSettings().range_m, *, linked: bool = False,
        drivetrain: Drivetrain = SIM_ROVER,
    ) -> None:  # fmt: skip
        """``linked``: scans and announcements go out, see ``take``; ``turning_radius_m``: 0 for skid steering.

        Raises ValueError for more rangefinders than the firmware accepts.
        """
        if len(suite.beams) > RANGES_MOST:
            raise ValueError(f"{len(suite.beams)} rangefinders: the firmware accepts at most {RANGES_MOST}")
        self.world, self.start, self.suite = world, start, suite
        self.tally = Tally()
        self._make = (seed, outline, turning_radius_m, range_noise_m)
        self._drivetrain = drivetrain
        self._linked = linked
        self._traffic_port = TrafficPort()
        self._port = ScannerPort()
        self._outbox = bytearray()
        self._sender: object = None
        self._last: ServoFrame | None = None
        self._answer = b""
        self._begin()

    def _begin(self) -> None:
        """Put the rover at its start, at rest, at time 0."""
        seed, outline, turning_radius_m, noise_m = self._make
        start, suite = self.start, self.suite
        self.time_s = 0.0
        self._port.begin()
        self.collisions: tuple[Collision, ...] = ()
        self._rover = new_rover(
            start.north_m, start.east_m, start.heading_rad, outline, turning_radius_m, self._drivetrain
        )
        rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(2)[1])
        self._sensing = RangeSensing(suite, self.world, noise_m, rng)
        self._scanner = Scanner(suite.lidar, self._sensing) if suite.lidar and self._linked else None
        place = (geodesy.to_units(start.home.lat_deg), geodesy.to_units(start.home.lon_deg))
        self._traffic = Traffic(self.world, place, (start.north_m, start.east_m))
        self._surroundings, self._doors_move_s = self.world.surroundings(0.0), self.world.next_change_s(0.0)
        self._ranges_m = [math.nan] * len(suite.beams)
        self._measured = 0

    def answer(self, datagram: bytes, sender: object = None) -> bytes:
        """The answer to ``sender``; empty if there is none."""
        frame = decode(datagram)
        if frame is None:
            self.tally.bad += 1
            return b""
        kind = self._kind(frame, sender)
        if kind is FrameKind.STRANGER:
            self.tally.strangers += 1
            return b""
        if kind is FrameKind.LATE:
            self.tally.late += 1
            return b""
        self._sender = sender
        if kind is FrameKind.REPEATED:
            self.tally.repeated += 1
            return self._answer
        if kind is FrameKind.START:
            self.tally.starts += 1
            self._begin()
        elif self._last is not None:
            self.tally.lost += (frame.count - self._last.count) % COUNTS - 1
        self._last = frame
        self._answer = self._stepped(frame)
        return self._answer

    def _kind(self, frame: ServoFrame, sender: object) -> FrameKind:
        """Compare a frame with the last one. The firmware counts from 0; its address may change while it runs."""
        if self._last is None:
            return FrameKind.START
        ahead = (frame.count - self._last.count) % COUNTS
        moved = sender != self._sender
        if frame.count == 0 and ahead != 1 and (moved or ahead != 0):
            return FrameKind.START
        if ahead == 0:
            return FrameKind.REPEATED
        if moved and ahead != 1:
            return FrameKind.STRANGER
        return FrameKind.NEXT if ahead <= COUNTS // 2 else FrameKind.LATE

    def rehearse(self) -> None:
        """Take one step and start over, so that everything is compiled before the firmware waits for an answer."""
        self._move(0.0, 0.0, PLANT_STEP_S)
        self._measure(self.motion)
        self._outbox.clear()
        self._port, self._traffic_port = ScannerPort(), TrafficPort()
        self._begin()

    @property
    def system(self) -> int | None:
        """System id of the autopilot heard on the link; None if none was."""
        return self._port.system

    def hear(self, data: bytes) -> None:
        """Take in bytes from the link."""
        self._port.hear(data)

    def take(self) -> bytes:
        """The scans and announcements since the last call."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    @property
    def announces(self) -> bool:
        """Whether something that moves announces itself."""
        return self._traffic.talks

    @property
    def motion(self) -> Motion:
        """The rover's true motion."""
        rover = self._rover[0]
        heading_rad, speed_m_s, slide_m_s = float(rover["heading_rad"]), float(rover["speed_m_s"]), rover["slide_m_s"]
        ahead_n, ahead_e = math.cos(heading_rad), math.sin(heading_rad)
        return Motion(
            float(rover["north_m"]),
            float(rover["east_m"]),
            heading_rad,
            float(speed_m_s * ahead_n - slide_m_s * ahead_e),
            float(speed_m_s * ahead_e + slide_m_s * ahead_n),
        )

    def _stepped(self, frame: ServoFrame) -> bytes:
        step_s = frame_step_s(frame.rate_hz)
        before = self.motion
        self._move(servo_output(frame.pwm_us[0]), servo_output(frame.pwm_us[2]), step_s)
        self.tally.steps += 1
        now = self.motion
        self._measure(now)
        return encode(self._body(before, now, step_s), -GRAVITY_M_S2, self._ranges_m)

    def _move(self, servo_1: float, servo_3: float, step_s: float) -> None:
        world = self.world
        if world.doors and self.time_s >= self._doors_move_s:
            self._surroundings, self._doors_move_s = world.surroundings(self.time_s), world.next_change_s(self.time_s)
        contacts = int(self._rover[0]["contacts"])
        steps = max(1, math.ceil(step_s / PLANT_STEP_S - 1e-6))
        advance(self._rover, self._surroundings, self.time_s, (servo_1, servo_3), steps, step_s / steps)
        self.time_s += step_s
        if int(self._rover[0]["contacts"]) > contacts:
            self.collisions += (collision_of(self._rover[0], world, self.time_s),)

    def _body(self, before: Motion, now: Motion, step_s: float) -> BodyState:
        """The reported state, with mean turn rate and acceleration of the step.

        Integrated, these give the reported heading and velocity. That holds for a collision too, which stops the
        rover within the step.
        """
        turned_rad = (now.heading_rad - before.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
        accel_n = (now.vel_north_m_s - before.vel_north_m_s) / step_s
        accel_e = (now.vel_east_m_s - before.vel_east_m_s) / step_s
        middle_rad = before.heading_rad + 0.5 * turned_rad
        cosine, sine = math.cos(middle_rad), math.sin(middle_rad)
        return BodyState(
            self.time_s, now.north_m - self.start.north_m, now.east_m - self.start.east_m,
            now.vel_north_m_s, now.vel_east_m_s, now.heading_rad, turned_rad / step_s,
            accel_n * cosine + accel_e * sine, accel_e * cosine - accel_n * sine,
        )  # fmt: skip

    def _measure(self, now: Motion) -> None:
        """Measure with every sensor that is due."""
        sensing, here = self._sensing, now[:3]
        sensing.time_s = self.time_s
        if sensing.samples and self.time_s >= sensing.next_due_s() - 1e-9:
            sensing.sample(*here)
        if self._ranges_m and self.time_s >= self._measured * RANGE_INTERVAL_S - 1e-9:
            self._measured = math.floor(self.time_s / RANGE_INTERVAL_S + 1e-6) + 1
            self._ranges_m = [math.nan] * len(self.suite.beams)
            for reading in sensing.wired(*here):
                # For the firmware a range beyond the maximum means that nothing was seen.
                seen_cm = reading.range_cm if reading.range_cm < reading.max_cm else reading.max_cm + 1
                self._ranges_m[reading.number] = seen_cm / 100.0
        time_us = round(self.time_s * 1e6)
        if self._scanner is not None and time_us >= self._scanner.next_due_us():
            self._outbox += self._port.packed(self._scanner.due(time_us, *here))
        if self._linked and self.time_s >= self._traffic.next_due_s():
            self._traffic_port.belong_to(self.system or 1)
            self._traffic.send_due(self.time_s, (self._traffic_port,))
            self._outbox += self._traffic_port.take()
