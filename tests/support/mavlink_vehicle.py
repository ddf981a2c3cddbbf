"""Packets as a vehicle, a lidar or a ground station would send them, made with pymavlink."""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

NAN_QUATERNION = [0.0, 0.0, 0.0, 0.0]


class Station:
    """Somebody on the network with an identity of its own."""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        self._mav = mavlink.MAVLink(None, system_id, component_id)

    def pack(self, message: Any, *, version_1: bool = False) -> bytes:
        raw = bytes(message.pack(self._mav, force_mavlink1=version_1))
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw

    def heartbeat(self, mode: int = 0, *, armed: bool = False, kind: int = 10, autopilot: int = 3) -> bytes:
        return self.pack(mavlink.MAVLink_heartbeat_message(kind, autopilot, 128 if armed else 0, mode, 4, 3))

    def local_position(self, boot_ms: int, north_m: float = 0.0, east_m: float = 0.0) -> bytes:
        return self.pack(mavlink.MAVLink_local_position_ned_message(boot_ms, north_m, east_m, 0.0, 0.5, -0.25, 0.0))

    def origin(self, lat_e7: int = -353632613, lon_e7: int = 1491652299) -> bytes:
        return self.pack(mavlink.MAVLink_gps_global_origin_message(lat_e7, lon_e7, 584000))

    def home(self, lat_e7: int = -353632613, lon_e7: int = 1491652299) -> bytes:
        return self.pack(
            mavlink.MAVLink_home_position_message(lat_e7, lon_e7, 0, 0.0, 0.0, 0.0, NAN_QUATERNION, 0.0, 0.0, 0.0)
        )

    def ack(self, command: int, result: int = 0, to_system: int = 1, to_component: int = 191) -> bytes:
        return self.pack(mavlink.MAVLink_command_ack_message(command, result, 0, 0, to_system, to_component))

    def target(self, lat_e7: int, lon_e7: int) -> bytes:
        return self.pack(mavlink.MAVLink_position_target_global_int_message(0, 0, 65016, lat_e7, lon_e7, *[0.0] * 9))

    def distance(
        self,
        current_cm: int,
        orientation: int = 0,
        sensor_id: int = 0,
        *,
        min_cm: int = 20,
        max_cm: int = 2000,
        quality: int = 0,
        fov_rad: float = 0.0,
        quaternion: list[float] | None = None,
        time_boot_ms: int = 0,
    ) -> bytes:
        return self.pack(
            mavlink.MAVLink_distance_sensor_message(
                time_boot_ms, min_cm, max_cm, current_cm, 0, sensor_id, orientation, 0, fov_rad, 0.0,
                quaternion or NAN_QUATERNION, quality,
            )
        )  # fmt: skip

    def cells(
        self,
        distances_cm: list[int],
        *,
        increment: int = 5,
        increment_f: float = 0.0,
        offset_deg: float = 0.0,
        min_cm: int = 20,
        max_cm: int = 800,
        frame: int = 12,
        time_usec: int = 0,
    ) -> bytes:
        filled = distances_cm + [65535] * (72 - len(distances_cm))
        return self.pack(
            mavlink.MAVLink_obstacle_distance_message(
                time_usec, 0, filled, increment, min_cm, max_cm, increment_f, offset_deg, frame
            )
        )

    def rangefinder(self, distance_m: float) -> bytes:
        return self.pack(mavlink.MAVLink_rangefinder_message(distance_m, 0.0))

    def text(self, text: bytes, text_id: int = 0, chunk: int = 0, severity: int = 6) -> bytes:
        return self.pack(mavlink.MAVLink_statustext_message(severity, text, text_id, chunk))
