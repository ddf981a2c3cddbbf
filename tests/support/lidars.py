"""Lidars in a world, their bytes, and readers of them."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from companion.core.scan import RangeScan
from companion.lidar.points import Decoder, Points, joined
from companion.lidar.reader import Chunk, LidarReader
from companion.lidar.spec import parsed
from sitl.network.lidar_pty import LidarTerminal
from sitl.sensors.lidar_bytes import MAKES
from sitl.sensors.serial_lidar import LineFaults, MountedLidar, RoverPose, SerialLidar
from sitl.world.world import World

NAMES = tuple(MAKES)
SIDE_M = 8.0
"""Of the square room."""
STEP_S = 0.05


def room(noise_m: float = 0.0, name: str = "LD19", seed: int = 1, **mounted: object) -> SerialLidar:
    """A lidar in a square room of 8 m whose walls are a field thick."""
    obstacles = np.ones((10, 10), np.bool_)
    obstacles[1:9, 1:9] = False
    where = MountedLidar(MAKES[name], **mounted)  # type: ignore[arg-type]
    return SerialLidar(where, World(obstacles), noise_m, np.random.default_rng(seed))


def gateway(name: str) -> tuple[SerialLidar, World]:
    """A lidar before a wall with a gap of 1 m; behind the gap and round the lidar there is nothing within its reach."""
    obstacles = np.zeros((40, 40), np.bool_)
    obstacles[23, :] = True
    obstacles[23, 20] = False
    world = World(obstacles)
    return SerialLidar(MountedLidar(MAKES[name]), world, 0.0, np.random.default_rng(1)), world


MIDDLE = RoverPose(5.0, 5.0, 0.0)
"""Of that room; the rover looks north."""


def started(device: SerialLidar, reader_start: bytes) -> SerialLidar:
    """The same one, told to begin."""
    device.hear(reader_start)
    return device


def stream(device: SerialLidar, seconds: float, pose: RoverPose = MIDDLE) -> bytes:
    """What it sends meanwhile from a rover that stands."""
    data = b""
    for step in range(1, round(seconds / STEP_S) + 1):
        device.advance(step * STEP_S, pose)
        data += device.take()
    return data


def decoded(decoder: Decoder, data: bytes, cuts: list[int] | None = None) -> Points:
    """The points of these bytes, handed over in pieces that end at ``cuts``."""
    ends = [*sorted({cut for cut in cuts or [] if 0 < cut < len(data)}), len(data)]
    parts, at = [], 0
    for end in ends:
        parts.append(decoder.feed(data[at:end]))
        at = end
    return joined(parts)


def to_walls_m(bearing_rad: np.ndarray, north_m: float = 0.0, east_m: float = 0.0) -> np.ndarray:  # type: ignore[type-arg]
    """True ranges in the room from a place that far from its middle; bearings clockwise from north."""
    half = 0.5 * SIDE_M
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(np.cos(bearing_rad) > 0.0, half - north_m, -half - north_m) / np.cos(bearing_rad)
        across = np.where(np.sin(bearing_rad) > 0.0, half - east_m, -half - east_m) / np.sin(bearing_rad)
    return np.minimum(np.abs(along), np.abs(across))


@dataclass
class Desk:
    """A simulated lidar and a reader of it, on one clock."""

    text: str
    device: SerialLidar
    number: int = 1
    now_s: float = 0.0
    logged: list[tuple[int, float, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.reader = LidarReader(parsed(self.text, "desk"), self, self.number)
        self._cuts = self.device.cuts

    def run(self, seconds: float, speed_m_s: float = 0.0, rate_rad_s: float = 0.0) -> list[RangeScan]:
        """The scans meanwhile, of a rover that sets out from the middle of the room and moves evenly."""
        scans: list[RangeScan] = []
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.device.advance(self.now_s, self.pose(speed_m_s, rate_rad_s))
            scans += self.reader.poll(self.now_s, self)
        return scans

    def pose(self, speed_m_s: float, rate_rad_s: float) -> RoverPose:
        """Where it is now; it turns on the spot, or drives north."""
        heading_rad = math.remainder(rate_rad_s * self.now_s, 2.0 * math.pi)
        return RoverPose(5.0 + speed_m_s * self.now_s, 5.0, heading_rad)

    def read(self) -> list[Chunk]:
        """The port."""
        cut, self._cuts = self.device.cuts != self._cuts, self.device.cuts
        data = self.device.take()
        return [*([Chunk(self.now_s, b"")] if cut else []), *([Chunk(self.now_s, data)] if data else [])]

    def write(self, data: bytes) -> None:
        """Commands."""
        self.device.hear(data)

    def close(self) -> None:
        """Nothing to close."""

    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """The log."""
        self.logged.append((number, time_s, data))


def desk(name: str, options: str = "", noise_m: float = 0.0, **mounted: object) -> Desk:
    """A lidar in the middle of the room, and its reader."""
    return Desk(f"{name}{':' * bool(options)}{options}", room(noise_m, name, **mounted))


def faulty(**faults: object) -> LineFaults:
    """What is wrong with a line."""
    return LineFaults(**faults)  # type: ignore[arg-type]


class Spinning:
    """A lidar in the room on a pseudo-terminal, in a thread and in real time."""

    def __init__(self, path: Path, name: str = "LD19") -> None:
        self.device = room(0.01, name)
        self.path = path
        self._running = True
        self._terminal = LidarTerminal(self.device, str(path), lambda text: None)
        self._thread = threading.Thread(target=self._turn, daemon=True)
        self._thread.start()

    def _turn(self) -> None:
        began_s = time.monotonic()
        simulator: Any = None  # the terminal needs none
        while self._running:
            self.device.advance(time.monotonic() - began_s, MIDDLE)
            self._terminal.exchange(simulator, 0.0)
            time.sleep(0.01)

    def close(self) -> None:
        """Take it away."""
        self._running = False
        self._thread.join()
        self._terminal.close()


@contextmanager
def spinning(path: Path, name: str = "LD19") -> Iterator[Spinning]:
    """The same, taken away in the end."""
    lidar = Spinning(path, name)
    try:
        yield lidar
    finally:
        lidar.close()
