"""Sensor suites from their descriptions in a mission or a sensors file."""

from __future__ import annotations

import math

from companion.mission.sensor_tables import BeamTable, LidarTable, ProximityTable, Sensors, SensorTable
from sitl.sensors.range_flaws import Flaws, Sun
from sitl.sensors.range_sensors import Beam, Lidar, ProximitySectors, SensorSuite, suite_named


def suite_of(sensors: Sensors) -> SensorSuite:
    """The suite with this name or description. Raises ValueError that lists the known names."""
    if isinstance(sensors, str):
        return suite_named(sensors)
    return SensorSuite(
        _lidar(sensors.lidar) if sensors.lidar else None,
        tuple(_beam(beam) for beam in sensors.beam),
        _proximity(sensors.proximity) if sensors.proximity else None,
    )


def _flaws(table: SensorTable) -> Flaws:
    low = table.sun
    sun = Sun(math.radians(low.bearing_deg), math.radians(low.width_deg), low.range_share) if low else None
    return Flaws(table.noise_m, table.dropout, table.false_echo, table.latency_s, sun)


def _lidar(table: LidarTable) -> Lidar:
    return Lidar(
        table.increment_deg, table.first_deg, table.min_m, table.max_m, table.rate_hz, table.rays, table.sectors,
        _flaws(table), table.message == "points",
    )  # fmt: skip


def _beam(table: BeamTable) -> Beam:
    return Beam(
        table.orientation, table.min_m, table.max_m, table.rate_hz, table.width_deg, _flaws(table), table.height_m
    )


def _proximity(table: ProximityTable) -> ProximitySectors:
    return ProximitySectors(tuple(table.sectors), table.min_m, table.max_m, table.rate_hz, _flaws(table))
