"""Proximity sensing with PRX1_TYPE 2: the autopilot echoes obstacle distances and slows down for them (AP_Proximity).

Both can mislead a companion (measured): its own OBSTACLE_DISTANCE comes back as DISTANCE_SENSOR with ids 10 to 17,
and the rover's simple avoidance creeps to AVOID_MARGIN before an obstacle and stays there without any text.

Nouns: AP_Proximity.
"""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.vehicle import Vehicle

MAVLINK_SOURCE = 2

FIRST_ID = 10

OCTANTS = 8

AHEAD_DEG = 22.5

STALE_S = 0.5

UNKNOWN = 65535

BODY_FRAME = 12


def take_in(vehicle: Vehicle, message: Any) -> None:
    """Take in OBSTACLE_DISTANCE: keep the nearest range of each eighth of a turn, in centimetres."""
    increment_deg = message.increment_f or float(message.increment)
    usable = message.frame == BODY_FRAME and 0.0 < increment_deg <= 360.0 and math.isfinite(message.angle_offset)
    if int(vehicle.parameters["PRX1_TYPE"]) != MAVLINK_SOURCE or not usable:
        return
    nearest = [message.max_distance] * OCTANTS
    for number, range_cm in enumerate(message.distances[: math.ceil(360.0 / increment_deg)]):
        if message.min_distance <= range_cm <= message.max_distance:
            octant = round((message.angle_offset + number * increment_deg) / 45.0) % OCTANTS
            nearest[octant] = min(nearest[octant], range_cm)
    vehicle.proximity.octants_cm = nearest
    vehicle.proximity.limits_cm = (message.min_distance, message.max_distance)
    vehicle.proximity.heard_s = vehicle.time_s
    ahead_m = nearest[0] / 100.0
    vehicle.control["room_m"] = math.inf if nearest[0] >= message.max_distance else ahead_m


def forget_stale(vehicle: Vehicle) -> None:
    """Forget ranges that are not updated any more: the rover then drives on at full speed (measured)."""
    if vehicle.time_s - vehicle.proximity.heard_s > STALE_S:
        vehicle.proximity.octants_cm = []
        vehicle.control["room_m"] = math.inf


def echoes(vehicle: Vehicle) -> list[Any]:
    """DISTANCE_SENSOR for each eighth of a turn; ``current == max`` means no obstacle."""
    near_cm, far_cm = vehicle.proximity.limits_cm
    now_ms = vehicle.time_us // 1000
    return [
        mavlink.MAVLink_distance_sensor_message(now_ms, near_cm, far_cm, range_cm, 0, FIRST_ID + octant, octant, 0)
        for octant, range_cm in enumerate(vehicle.proximity.octants_cm)
    ]
