"""A lidar on a serial line of its own: it turns while the rover moves, and sends what it sees as bytes.

Nouns: SerialLidar.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sitl.sensors.lidar_bytes import LidarMake, encoder_of
from sitl.sensors.range_sensors import Defect
from sitl.world.world import Floats, World

OUTBOX_BYTES = 4096
"""What waits on a line that nobody reads."""


@dataclass(frozen=True, slots=True)
class MountedLidar:
    """A lidar on the rover: where its zero looks, clockwise from ahead, and its place, metres from the middle."""

    make: LidarMake
    yaw_rad: float = 0.0
    forward_m: float = 0.0
    right_m: float = 0.0
    flipped: bool = False


@dataclass(slots=True)
class LineFaults:
    """What is wrong with a lidar or its line now. ``lost``, ``damaged``: probability of each byte."""

    lost: float = 0.0
    damaged: float = 0.0
    noise_m: float = 0.0
    stalled: bool = False
    unplugged: bool = False
    defect: Defect | None = None


@dataclass(frozen=True, slots=True)
class RoverPose:
    """Where the rover is in the world."""

    north_m: float
    east_m: float
    heading_rad: float


@dataclass(slots=True)
class _Points:
    """Points of one turn, to be repeated."""

    angle_deg: list[float] = field(default_factory=list)
    range_m: list[float] = field(default_factory=list)

    def add(self, angle_deg: Floats, range_m: Floats) -> None:
        """Further points."""
        self.angle_deg += angle_deg.tolist()
        self.range_m += range_m.tolist()


class SerialLidar:
    """Measures as it turns. ``take`` gives its bytes, ``hear`` gives it commands."""

    def __init__(self, mounted: MountedLidar, world: World, noise_m: float, rng: np.random.Generator) -> None:
        """``noise_m``: standard deviation of a range."""
        self.mounted = mounted
        self.faults = LineFaults()
        self.cuts = 0
        """How often the cable was pulled and put in again."""
        self.clock_ahead_s = 0.0
        """Its own clock has gone on while the simulator stood still: else all that it sends later would count as
        late."""
        self._world = world
        self._noise_m = noise_m
        self._rng = rng
        self._encoder = encoder_of(mounted.make)
        self._outbox = bytearray()
        self._plugged = True
        self._measured = 0
        self._time_s = 0.0
        self._angle_deg = 0.0
        self._before: RoverPose | None = None
        self._turn, self._last_turn = _Points(), _Points()
        self._repeated = 0

    @property
    def plugged(self) -> bool:
        """Whether its cable is in."""
        return self._plugged

    def take(self) -> bytes:
        """The bytes since the last call."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    def hear(self, data: bytes) -> None:
        """Obey commands."""
        if self._plugged:
            self._send(self._encoder.hear(data))

    def advance(self, time_s: float, pose: RoverPose) -> None:
        """Turn and measure up to a moment, at which the rover is at ``pose``."""
        self._plug()
        before, self._before = self._before or pose, pose
        since_s, self._time_s = self._time_s, time_s
        make = self.mounted.make
        count = math.floor(time_s * make.points_hz + 1e-6) - self._measured
        if count <= 0:
            return
        share = np.clip(((self._measured + 1 + np.arange(count)) / make.points_hz - since_s) / (time_s - since_s), 0, 1)
        self._measured += count
        step_deg = 0.0 if self.faults.stalled else 360.0 * make.turns_hz / make.points_hz
        angle_deg: Floats = (self._angle_deg + step_deg * np.arange(1, count + 1, dtype=np.float64)) % 360.0
        self._angle_deg = float(angle_deg[-1])
        range_m = self._measure(angle_deg, share, before, pose, time_s)
        angle_deg, range_m = self._as_told(angle_deg, range_m)
        if self._plugged and self._encoder.talks and self.faults.defect is not Defect.SILENT:
            quality = np.where(range_m > 0.0, make.most_quality * (1.0 - 0.8 * range_m / make.max_m), 0.0)
            self._send(self._encoder.encode(angle_deg, range_m, quality, time_s + self.clock_ahead_s))

    def _plug(self) -> None:
        """A lidar that gets power again begins anew, and waits for commands."""
        if self.faults.unplugged and self._plugged:
            self._outbox.clear()
        elif not self.faults.unplugged and not self._plugged:
            self._encoder = encoder_of(self.mounted.make)
            self.cuts += 1
        self._plugged = not self.faults.unplugged

    def _measure(self, angle_deg: Floats, share: Floats, before: RoverPose, now: RoverPose, time_s: float) -> Floats:
        """The ranges, 0 without an echo; the rover turned evenly between the two poses."""
        mounted, make = self.mounted, self.mounted.make
        turned_rad = math.remainder(now.heading_rad - before.heading_rad, 2.0 * math.pi)
        heading_rad = before.heading_rad + share * turned_rad
        middle_rad = before.heading_rad + 0.5 * turned_rad
        north_m = 0.5 * (before.north_m + now.north_m) + _north(mounted.forward_m, mounted.right_m, middle_rad)
        east_m = 0.5 * (before.east_m + now.east_m) + _east(mounted.forward_m, mounted.right_m, middle_rad)
        seen_m = np.zeros(len(angle_deg))
        for _ in range(3 if make.name.startswith("YDLIDAR") else 1):  # there the direction depends on the range
            told_rad = np.radians(angle_deg + self._encoder.aside_deg(seen_m))
            bearings_rad = heading_rad + mounted.yaw_rad + (-told_rad if mounted.flipped else told_rad)
            true_m = self._world.rays_m(north_m, east_m, bearings_rad.reshape(-1, 1), make.max_m, time_s)
            seen_m = np.where(true_m < make.max_m, true_m, 0.0)
        spread_m = math.hypot(self._noise_m, self.faults.noise_m)
        noisy_m = np.clip(seen_m + spread_m * self._rng.standard_normal(len(seen_m)), 0.001, make.max_m)
        return np.where(seen_m > 0.0, noisy_m, 0.0)

    def _as_told(self, angle_deg: Floats, range_m: Floats) -> tuple[Floats, Floats]:
        """What is measured; of a lidar that is stuck, its last whole turn again and again."""
        if self.faults.defect in (Defect.STUCK, Defect.STUCK_IN_VIEW) and self._last_turn.angle_deg:
            count = len(self._last_turn.angle_deg)
            places = [(self._repeated + one) % count for one in range(len(angle_deg))]
            self._repeated = (self._repeated + len(angle_deg)) % count
            return np.array(self._last_turn.angle_deg)[places], np.array(self._last_turn.range_m)[places]
        before_deg = np.concatenate((self._turn.angle_deg[-1:] or [-math.inf], angle_deg[:-1]))
        begun = 0
        for begins in np.flatnonzero(angle_deg < before_deg).tolist():
            self._turn.add(angle_deg[begun:begins], range_m[begun:begins])
            self._last_turn, self._turn, self._repeated, begun = self._turn, _Points(), 0, begins
        self._turn.add(angle_deg[begun:], range_m[begun:])
        return angle_deg, range_m

    def _send(self, data: bytes) -> None:
        """Put bytes on the line, without those that it loses."""
        faults = self.faults
        if faults.lost or faults.damaged:
            raw = np.frombuffer(data, np.uint8).copy()
            lost, damaged = self._rng.random((2, len(raw)))
            flips = self._rng.integers(1, 256, len(raw), dtype=np.uint8)
            raw[damaged < faults.damaged] ^= flips[damaged < faults.damaged]
            data = raw[lost >= faults.lost].tobytes()
        self._outbox += data
        del self._outbox[: max(len(self._outbox) - OUTBOX_BYTES, 0)]


def _north(forward_m: float, right_m: float, heading_rad: float) -> float:
    return forward_m * math.cos(heading_rad) - right_m * math.sin(heading_rad)


def _east(forward_m: float, right_m: float, heading_rad: float) -> float:
    return forward_m * math.sin(heading_rad) + right_m * math.cos(heading_rad)
