"""Our simulated autopilot in the firmware's place: rover, world and lidar are at the other end of the JSON interface.

Its state comes only from the interface's answers, its outputs go there as pulses, and the lidar comes in on a MAVLink
channel of its own. To clients it looks like a ``Simulator``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.control.records import LOOP_HZ
from sitl.autopilot.control.tasks import run_task
from sitl.autopilot.vehicle import Vehicle
from sitl.firmware.physics import Physics
from sitl.plant.closed_loop import SUBSTEPS, measure
from sitl.plant.outline import DISC
from sitl.plant.rover import new_rover
from sitl.sensors.range_sensors import SUITES, RangeSensing
from sitl.sim_link import SimLink
from sitl.world.geodesy import to_units
from sitl.world.world import World
from tests.support.firmware import Firmware


class SplitVehicle:
    """One frame a main loop, 50 a second."""

    def __init__(self, behind: Physics, parameters: Mapping[str, float] | None = None) -> None:
        start = behind.start
        origin = (to_units(start.home.lat_deg), to_units(start.home.lon_deg))
        here = (start.north_m, start.east_m)
        blind = RangeSensing(SUITES["none"], World.open(), 0.0, np.random.default_rng(0))
        self.behind = behind
        self.firmware = Firmware(behind.answer, rate_hz=LOOP_HZ)
        rover = new_rover(*here, start.heading_rad, DISC)
        self.vehicle = Vehicle(rover, origin, here, blind, parameters or {})
        self.vehicle.control["tick"] = 0
        self.autopilot = Autopilot(self.vehicle)
        self._links: list[SimLink] = []
        self._lidar = self.autopilot.open_channel()
        assert self.firmware.update()
        self._loops = 0

    @property
    def time_s(self) -> float:
        return self._loops / LOOP_HZ

    def connect(self) -> SimLink:
        self._links.append(SimLink(self.autopilot.open_channel(), len(self._links)))
        return self._links[-1]

    def advance_to_s(self, time_s: float) -> None:
        while self._loops < math.floor(time_s * LOOP_HZ + 1e-6):
            self._loop()

    def _loop(self) -> None:
        self._loops += 1
        for link in self._links:
            data, link.inbox = bytes(link.inbox), bytearray()
            self.autopilot.receive(link.channel, data)
        self.autopilot.receive(self._lidar, self.behind.take())
        self.behind.hear(self._lidar.take())
        vehicle = self.vehicle
        vehicle.control["tick"] += 1
        self._believe()
        run_task(vehicle.control[0], vehicle.tuning[0], vehicle.estimate[0])
        pulses = [1500 + round(500.0 * float(vehicle.control[0][name])) for name in ("servo_1", "servo_3")]
        assert self.firmware.update(*pulses), self.firmware.complaints
        self.autopilot.run_due()

    def _believe(self) -> None:
        """The answers' position, velocity, heading, turn rate and acceleration, without any error of an estimator."""
        told, believed = self.firmware.state, self.vehicle.estimate
        heading_rad = self.firmware.heading_rad
        cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
        ahead, right, _ = told["imu/accel_body"]
        believed["north_m"], believed["east_m"], _ = told["position"]
        believed["vel_n"], believed["vel_e"], _ = told["velocity"]
        for _ in range(SUBSTEPS):
            measure(believed[0], self.vehicle.tuning[0], told["imu/gyro"][2], ahead, right)
        ahead, right = believed[0]["imu_ahead"], believed[0]["imu_aside"]
        believed["accel_n"], believed["accel_e"] = ahead * cosine - right * sine, ahead * sine + right * cosine
        believed["heading_rad"], believed["yaw_rate_rad_s"] = heading_rad, believed["imu_yaw_rate"]
