"""Recordings of ArduRover 4.7, and the sent half of each replayed against the simulator at the same vehicle times."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.sensors.range_sensors import Beam, SensorSuite
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.shared_data import SHARED
from tests.support.sitl_client import HOME, Client

AUTOPILOT = (1, 1)
STEP_S = 0.05
WORLD_M = 60


@dataclass(frozen=True)
class Recording:
    """Conditions of a recording: the rover's heading, its sensors, and how much earlier its start-up was.

    ``put_ahead``: at this vehicle time the rover, which stands, is put so many metres ahead, to where the recorded one
    stood: what it then does depends on the side of WP_RADIUS on which it is.
    """

    name: str
    heading_deg: float = 0.0
    early_s: float = 0.0
    beams: tuple[Beam, ...] = ()
    post_m: tuple[float, float] | None = None
    folder: str = "ardurover-4.7-transcripts"
    parameters: tuple[tuple[str, float], ...] = ()
    put_ahead: tuple[float, float] | None = None


RECORDINGS = (
    Recording("boot-to-armed", -9.9),
    Recording("commands-and-acks", -7.8),
    Recording("guided-drive", -7.8),
    # A rover with other parameters, driven by other physics: its EKF was ready a second earlier.
    Recording(
        "rangefinders",
        heading_deg=-0.2,
        early_s=1.0,
        beams=(Beam(0, 0.2, 20.0), Beam(7, 0.2, 20.0), Beam(1, 0.2, 20.0)),
        post_m=(14.7, 0.1),
    ),
)


FAST_SKID = (("WP_SPEED", 2.0), ("WP_RADIUS", 1.0))
FAST = (
    Recording("velocity-and-turn-rate", -10.0, folder="real-firmware"),
    Recording("turns-at-speed-jerk-0", -10.0, folder="real-firmware", parameters=(*FAST_SKID, ("WP_JERK", 0.0))),
    Recording(
        "turns-at-speed-jerk-3",
        -10.0,
        folder="real-firmware",
        parameters=(*FAST_SKID, ("WP_JERK", 3.0)),
        put_ahead=(129.0, 0.067),  # 1.033 m beyond its last place instead of 0.966 m
    ),
)
"""Recordings of motion alone, at up to 2 m/s: velocities with turn rates, and positions far to the side."""


@dataclass(frozen=True)
class Heard:
    """A message of the autopilot and when it came, vehicle seconds."""

    time_s: float
    message: Any


@dataclass(frozen=True)
class Replay:
    """What the firmware sent, and what the simulator sent when it was told the same."""

    recording: Recording
    asked: tuple[Any, ...]
    real: tuple[Heard, ...]
    ours: tuple[Heard, ...]


def stamped(path: Path) -> Iterator[tuple[float, Any, bytes]]:
    """The log's clock (seconds), message and bytes of every packet."""
    data, at, parser = path.read_bytes(), 0, mavlink.MAVLink(None)
    while at + 11 <= len(data):
        (stamp_us,) = struct.unpack(">Q", data[at : at + 8])
        raw = data[at + 8 : at + 8 + data[at + 9] + 12]
        for message in parser.parse_buffer(raw) or []:
            yield stamp_us / 1e6, message, raw
        at += 8 + len(raw)


def source(message: Any) -> tuple[int, int]:
    """System and component that sent a message."""
    return message.get_srcSystem(), message.get_srcComponent()


def read(path: Path) -> tuple[list[Heard], list[tuple[float, Any, bytes]]]:
    """What the autopilot sent, and what it was sent, with vehicle times.

    Vehicle time runs several times faster than the log's clock; between two messages that tell it, it is interpolated.
    """
    packets = list(stamped(path))
    log_s: list[float] = []
    boot_s: list[float] = []
    for stamp_s, message, _ in packets:
        told_s = getattr(message, "time_boot_ms", 0) / 1000 if source(message) == AUTOPILOT else 0.0
        if told_s > (boot_s[-1] if boot_s else 0.0):
            log_s.append(stamp_s)
            boot_s.append(told_s)
    times_s = np.interp([stamp_s for stamp_s, _, _ in packets], log_s, boot_s, left=0.0).tolist()
    heard, sent = [], []
    for time_s, (_, message, raw) in zip(times_s, packets, strict=True):
        if source(message) == AUTOPILOT:
            heard.append(Heard(time_s, message))
        else:
            sent.append((time_s, message, raw))
    return heard, sent


def simulator_for(recording: Recording) -> Simulator:
    """The rover of a recording, without noise, on open ground or before its post."""
    heading_rad = math.radians(recording.heading_deg)
    if recording.post_m is None:
        start, parameters = SimStart(0.0, 0.0, heading_rad, HOME), dict(recording.parameters)
        return Simulator(World.open(), start, "none", parameters=parameters, noise=False)
    cell_m, middle_m = 0.1, WORLD_M / 2
    row, column = (int((metres + middle_m) / cell_m) for metres in recording.post_m)
    obstacles = np.zeros((int(WORLD_M / cell_m),) * 2, dtype=np.bool_)
    obstacles[row - 1 : row + 4, column - 5 : column + 6] = True
    world = World(obstacles, cell_m, -middle_m, -middle_m)
    suite = SensorSuite(beams=recording.beams)
    return Simulator(world, SimStart(0.0, 0.0, heading_rad, HOME), suite, noise=False)


def put_ahead(simulator: Simulator, distance_m: float) -> None:
    """Put the rover so far ahead."""
    heading_rad, rover = simulator.truth.heading_rad, simulator._rover
    rover["north_m"] += distance_m * math.cos(heading_rad)
    rover["east_m"] += distance_m * math.sin(heading_rad)


def replay(recording: Recording) -> Replay:
    """Send the recorded packets to the simulator at their vehicle times, and keep what it sends."""
    real, sent = read(SHARED / "data" / recording.folder / f"{recording.name}.tlog")
    client = Client(simulator_for(recording), *source(sent[0][1]))
    ours: list[Heard] = []
    ahead_s, ahead_m = recording.put_ahead or (math.inf, 0.0)

    def run_to(time_s: float) -> None:
        now_s = client.simulator.time_s
        for step_s in np.append(np.arange(now_s + STEP_S, time_s, STEP_S), time_s).tolist():
            fresh = client.run_to(step_s)
            ours.extend(Heard(step_s - recording.early_s, message) for message in fresh if source(message) == AUTOPILOT)

    for time_s, _, raw in sent:
        if time_s >= ahead_s:
            ahead_s = math.inf
            put_ahead(client.simulator, ahead_m)
        run_to(time_s + recording.early_s)
        client.link.receive(raw)
    run_to(real[-1].time_s + recording.early_s + 0.1)
    return Replay(recording, tuple(message for _, message, _ in sent), tuple(real), tuple(ours))
