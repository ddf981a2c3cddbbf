"""A drive of the real firmware that ended at a wall's end: the same setpoints give the same track, and the contact.

The rover of that drive turns 2.4 times as much for a motor output as the one that the firmware's gains are made for,
with a lag. So it turns up to 40 % faster than it is told, and swings out.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.mission.toml_reader import load
from companion.recording.reader import load_record
from sitl.scenario import scenario_from_mission
from sitl.simulator import Simulator
from tests.support.shared_data import SHARED, needs_shared
from tests.support.sitl_client import ready

FOLDER = SHARED / "data" / "real-firmware" / "wall-end"
CLOCK_S = -3351.485
"""From the record's clock to that of the track, known to 0.05 s: telemetry then shows the places of 0.04 s before."""
PLACED_S, FROM_S, UNTIL_S = 67.5, 67.6, 72.75
"""The rover is put on the track at the first time, and compared until just before the contact at 72.8 s."""

MISSION = """
[rover]
radius_m = 0.4
[[target]]
north_m = 5.0
east_m = 0.0
[sitl]
world = "world.toml"
start = [10, 10]
[sitl.drivetrain]
top_speed_m_s = 3.46
lag_s = 0.25
track_m = 0.6
"""
WORLD = """
size_m = [60.0, 60.0]
"""
WALL = """
[[obstacle]]
polygon_m = [[25.0, 45.0], [35.0, 45.0], [35.0, 45.5], [25.0, 45.5]]
"""
"""Its south-west corner, 34.5 m east and 14.5 m north of where the rover began."""


class Pose(NamedTuple):
    """Places in metres from the start, heading clockwise from north."""

    time_s: float
    east_m: float
    north_m: float
    heading_rad: float
    speed_m_s: float


@cache
def track() -> NDArray[np.float64]:
    """The true track: rows time, east, north, heading (radians, unwrapped), speed."""
    with (FOLDER / "truth.csv").open() as file:
        rows = np.array([[float(value) for value in row] for row in list(csv.reader(file))[1:]])
    rows[:, 3] = np.unwrap(np.radians(rows[:, 3]))
    return rows


def true_pose(time_s: float) -> Pose:
    rows = track()
    return Pose(time_s, *(float(np.interp(time_s, rows[:, 0], rows[:, column])) for column in (1, 2, 3, 4)))


@cache
def said() -> list[tuple[float, bytes]]:
    """What the companion sent, on the track's clock."""
    return [(tick.entry.time_s + CLOCK_S, packet) for tick in load_record(FOLDER).ticks() for packet in tick.said]


class Again:
    """The drive again, with the simulated autopilot."""

    def __init__(self, folder: Path, world: str) -> None:
        (folder / "world.toml").write_text(world)
        (folder / "wall.toml").write_text(MISSION)
        scenario = scenario_from_mission(load(folder / "wall.toml"))
        parameters = {**scenario.parameters, "WP_SPEED": 2.0, "WP_RADIUS": 1.0, "WP_JERK": 0.0}
        start = replace(scenario.start, heading_rad=float(track()[0, 3]))
        self.simulator: Simulator = replace(scenario, parameters=parameters, start=start).simulator(0, noise=False)
        self.north_m, self.east_m = start.north_m, start.east_m
        ready(self.simulator)
        self.ahead_s = self.simulator.time_s - said()[0][0]

    def drive(self) -> Iterator[Pose]:
        """Poses every 0.02 s, from when the rover is put on the track on."""
        link, waiting, placed = self.simulator.connect(), list(reversed(said())), False
        time_s = waiting[-1][0]
        while time_s < UNTIL_S + 1.0:
            while waiting and waiting[-1][0] <= time_s:
                link.receive(waiting.pop()[1])
            if not placed and time_s >= PLACED_S:
                placed = True
                self._place(true_pose(time_s))
            time_s += 0.02
            self.simulator.advance_to_s(time_s + self.ahead_s)
            truth = self.simulator.truth
            if placed:
                yield Pose(
                    time_s, truth.east_m - self.east_m, truth.north_m - self.north_m, truth.heading_rad, truth.speed_m_s
                )

    def _place(self, pose: Pose) -> None:
        """Put the rover on the track, and with it the inner target that it follows."""
        rover, control = self.simulator._rover, self.simulator._vehicle.control
        moved_n = pose.north_m + self.north_m - rover["north_m"]
        moved_e = pose.east_m + self.east_m - rover["east_m"]
        for record, north, east in ((rover, "north_m", "east_m"), (control, "shaped_n", "shaped_e")):
            record[north] += moved_n
            record[east] += moved_e
        rover["heading_rad"], rover["speed_m_s"] = pose.heading_rad, pose.speed_m_s


@needs_shared
def test_the_same_setpoints_give_the_same_track(tmp_path: Path) -> None:
    """As asked for: within 0.3 m and 10 degrees over the five seconds before the contact."""
    off_m, off_deg = [0.0], [0.0]
    for pose in Again(tmp_path, WORLD).drive():
        if FROM_S <= pose.time_s <= UNTIL_S:
            there = true_pose(pose.time_s)
            off_m.append(math.hypot(pose.east_m - there.east_m, pose.north_m - there.north_m))
            off_deg.append(abs(math.degrees(math.remainder(pose.heading_rad - there.heading_rad, math.tau))))
    assert len(off_m) > 250 and max(off_m) < 0.2 and max(off_deg) < 8.0


@needs_shared
def test_the_rover_touches_the_wall_as_it_did(tmp_path: Path) -> None:
    again = Again(tmp_path, WORLD + WALL)
    for _ in again.drive():
        pass
    (collision,) = again.simulator.collisions
    assert collision.time_s - again.ahead_s == pytest.approx(72.8, abs=0.3)
    assert 0.15 < collision.speed_m_s < 0.75, "a tenth of a metre later than the real one, which had 0.6 m/s left"
    assert collision.east_m - again.east_m == pytest.approx(34.1, abs=0.15)
    assert collision.north_m - again.north_m == pytest.approx(15.26, abs=0.25)
