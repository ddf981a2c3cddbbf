"""A lidar as a component of its own on the rover's network: OBSTACLE_DISTANCE and heartbeats.

Nouns: obstacle publisher.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.scan import RangeScan
from companion.mavlink.framing import AUTOPILOT, Framer
from companion.mavlink.signing import Signer

CELLS = 72
UNKNOWN_CM = 65535
HEARTBEAT_S = 1.0
COMPONENT = mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE


class ObstaclePublisher:
    """Makes the packets of one lidar. ``component_id``: its own; its system is the rover's, once that is heard."""

    def __init__(self, component_id: int = COMPONENT, system_id: int = 1, signer: Signer | None = None) -> None:
        self._mav = mavlink.MAVLink(None, system_id, component_id)
        self._framer = Framer()
        self._heartbeat_s = -math.inf
        self._signer = signer
        if signer is not None:
            self._mav.signing.secret_key = signer.key
            self._mav.signing.sign_outgoing = True

    @property
    def system_id(self) -> int:
        """The rover's, or the first guess."""
        return int(self._mav.srcSystem)

    def hear(self, data: bytes) -> None:
        """Take in what the link has heard: the rover's heartbeat tells its system id."""
        for packet in self._framer.feed(data):
            if packet.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT or packet.component_id != AUTOPILOT:
                continue
            if self._signer is None or self._signer.accepts(packet):
                self._mav.srcSystem = packet.system_id

    def heartbeat(self, now_s: float) -> bytes:
        """A heartbeat if one is due, else nothing."""
        if now_s - self._heartbeat_s < HEARTBEAT_S - 1e-6:
            return b""
        self._heartbeat_s = now_s
        kind, state = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_STATE_ACTIVE
        return self._packed(mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, state, 3))

    def scan(self, scan: RangeScan) -> bytes:
        """A scan as OBSTACLE_DISTANCE: 72 cells of 5 degrees, of which the first looks straight ahead."""
        return self._packed(
            mavlink.MAVLink_obstacle_distance_message(
                round(1e6 * scan.time_s),
                mavlink.MAV_DISTANCE_SENSOR_LASER,
                cells_cm(scan),
                round(360 / CELLS),
                max(1, round(100.0 * scan.min_range_m)),
                round(100.0 * scan.sight_m),
                360.0 / CELLS,
                0.0,
                mavlink.MAV_FRAME_BODY_FRD,
            )
        )

    def _packed(self, message: Any) -> bytes:
        if self._signer is not None:
            self._mav.signing.timestamp = self._signer.next_timestamp()
        raw = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw


def cells_cm(scan: RangeScan) -> list[int]:
    """The nearest reading of each cell in cm: one more than the maximum where nothing was seen, 65535 where unknown.

    A reading nearer than the minimum is told as the minimum, since receivers ignore nearer ones.
    """
    most_cm = round(100.0 * scan.sight_m)
    cells = np.rint(np.degrees(scan.bearing_rad) / (360.0 / CELLS)).astype(np.int64) % CELLS
    known = ~np.isnan(scan.range_m)
    nearest_m = np.full(CELLS, np.nan)
    np.fmin.at(nearest_m, cells[known], scan.range_m[known])
    cm = np.minimum(np.rint(100.0 * np.where(np.isfinite(nearest_m), nearest_m, 1e6)), most_cm + 1)
    cm = np.maximum(cm, max(1, round(100.0 * scan.min_range_m)))
    return [UNKNOWN_CM if math.isnan(one) else int(told) for one, told in zip(nearest_m.tolist(), cm, strict=True)]
