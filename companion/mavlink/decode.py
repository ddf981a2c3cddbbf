"""Decodes MAVLink packets into events: which senders count, which packets are old, and the units of their fields."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink import positions, ranges, requests
from companion.mavlink.framing import AUTOPILOT, Packet
from companion.mavlink.points import Band
from companion.mavlink.positions import point_of
from companion.mavlink.ranges import RangeDecoder
from companion.mavlink.statustext import TextAssembler
from companion.vehicle import guard
from companion.vehicle.events import (
    AckSeen,
    AttitudeSeen,
    BatterySeen,
    EkfStatusSeen,
    Event,
    FenceStatusSeen,
    GlobalPositionSeen,
    GpsSeen,
    GuardSeen,
    HeartbeatSeen,
    HomeSeen,
    ItemCurrentSeen,
    ItemReachedSeen,
    LegSeen,
    LocalPositionSeen,
    OriginSeen,
    ParameterSeen,
    PlanChangedSeen,
    PlanCountSeen,
    PlanItemSeen,
    PrearmSeen,
    RangeSeen,
    TargetSeen,
    TextSeen,
    ThrottleSeen,
)
from companion.vehicle.gps_fix import gps_fix_of
from companion.vehicle.link_latency import TimeAnswered
from companion.vehicle.rc_input import SticksSeen

ROVERS = (mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT)
REBOOT_MS = 5000
"""If the boot time runs back by more than this (more than packets overtake each other), the autopilot has restarted."""
MISSION_ACK_COMMAND = -1
WHOLE_NUMBERS = (
    mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE,
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
)
"""Mission items whose x and y are p5 and p6 as they are (AP_Mission)."""
NOT_TOLD = 0xFFFF
"""``total`` of MISSION_CURRENT."""
NO_CELL_MV = 65535
NO_SATELLITES = 255
OF_SYS_STATUS = -1
MIN_GUARD_MS, MAX_GUARD_MS = 50.0, 5000.0
"""Another script may use the guard's name for something else."""


class Decoder:
    """Turns packets into events; keeps the vehicle's id, its clock and the last packets."""

    def __init__(self, system_id: int, component_id: int, band: Band, companion: int | None = None) -> None:
        """``band``: the heights of obstacle points that count.

        ``companion``: the component whose guard counts; None: this one itself.
        """
        self.system_id = system_id
        self.component_id = component_id
        self.vehicle_known = False
        self.origin: GeoPoint | None = None
        self.boot_ms = 0
        self.other_systems = 0
        self.refused_type: int | None = None
        """MAV_TYPE of an autopilot that was heard but is not an ArduPilot rover."""
        self.impostor_type: int | None = None
        """MAV_TYPE of another vehicle that uses the rover's own ids."""
        self.message_counts: dict[int, int] = {}
        self._mav: Any = mavlink.MAVLink(None)
        self._last: dict[int, Packet] = {}
        self.lost = 0
        self._newest_ms: dict[int, int] = {}
        self._texts = TextAssembler()
        self._ranges = RangeDecoder(band)
        self._guards_name = guard.name_of(component_id if companion is None else companion)
        self._readers: dict[int, Callable[[Any, float], Event | None]] = {
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery_status,
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: _fence_status,
            mavlink.MAVLINK_MSG_ID_PARAM_VALUE: _parameter,
            mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: self._guard,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_MISSION_ACK: self._mission_ack,
            mavlink.MAVLINK_MSG_ID_MISSION_COUNT: self._plan_count,
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._plan_item,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._gps_origin,
            mavlink.MAVLINK_MSG_ID_COMMAND_ACK: self._command_ack,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _target,
            mavlink.MAVLINK_MSG_ID_RANGEFINDER: self._rangefinder,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._leg,
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED: _item_reached,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: _item_current,
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: _ekf,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: _throttle,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _gps,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: _home,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: _time_answered,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: _sticks,
        }

    def decode(self, packet: Packet, time_s: float) -> list[Event]:
        """The events of one packet, after those of obstacle points that are complete with earlier bytes.

        None of its own if it is of no interest, from another system, repeated or too old.
        """
        whole = [RangeSeen(scan.time_s, scan) for scan in self._ranges.complete(time_s)]
        return [*whole, *self._of_packet(packet, time_s)]

    def _of_packet(self, packet: Packet, time_s: float) -> list[Event]:
        if packet.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and not self.vehicle_known:
            self._learn_vehicle(packet)
        if packet.message_id in requests.PARAMETER_REQUESTS and self.vehicle_known:
            asked = requests.parameter_asked(self._message(packet), self.system_id, self.component_id, time_s)
            return [] if asked is None else [asked]
        if packet.system_id != self.system_id or not self.vehicle_known:
            self.other_systems += 1
            return self._of_others(packet, time_s) if self.vehicle_known else []
        if packet.component_id == self.component_id or self._is_repeated(packet):
            return []
        self._ranges.vehicle_heard(time_s)
        if packet.component_id == AUTOPILOT:
            self.message_counts[packet.message_id] = self.message_counts.get(packet.message_id, 0) + 1
            return self._of_autopilot(packet, time_s)
        if packet.message_id in ranges.MESSAGES:
            return self._range(packet, time_s)
        ours = (*positions.RECEIVED, *requests.REQUESTS)
        return self._of_others(packet, time_s) if packet.message_id in ours else []

    def _asked(self, packet: Packet, time_s: float) -> list[Event]:
        """What is asked of this component; requests to all components or to others are not answered."""
        message = self._message(packet)
        if (message.target_system, message.target_component) != (self.system_id, self.component_id):
            return []
        event = requests.asked(message, time_s)
        return [] if event is None else [event]

    def _of_others(self, packet: Packet, time_s: float) -> list[Event]:
        """The position of another vehicle, or a request to the companion."""
        if packet.message_id in requests.REQUESTS:
            return self._asked(packet, time_s)
        if packet.message_id not in positions.READERS:
            return []
        event = positions.READERS[packet.message_id](self._message(packet), time_s)
        return [] if event is None else [event]

    def _learn_vehicle(self, packet: Packet) -> None:
        """The first ArduPilot rover that is heard becomes the vehicle."""
        if packet.component_id != AUTOPILOT:
            return
        message = self._message(packet)
        if message.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA or message.type not in ROVERS:
            if message.type != mavlink.MAV_TYPE_GCS:
                self.refused_type = message.type
            return
        self.system_id = packet.system_id
        self.vehicle_known = True
        self.refused_type = None

    def _of_autopilot(self, packet: Packet, time_s: float) -> list[Event]:
        if packet.message_id in ranges.MESSAGES:
            return self._range(packet, time_s)
        if packet.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            beat = self._heartbeat(self._message(packet), time_s)
            return [*self._texts.late(time_s), *([] if beat is None else [beat])]
        if packet.message_id == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
            message = self._message(packet)
            return [*self._texts.add(TextSeen(time_s, message.severity, message.text), message.id, message.chunk_seq)]
        if packet.message_id == mavlink.MAVLINK_MSG_ID_SYS_STATUS:
            message = self._message(packet)
            return [_prearm(message, time_s), _sys_status(message, time_s)]
        if packet.message_id in positions.RECEIVED:
            return self._of_others(packet, time_s)
        reader = self._readers.get(packet.message_id)
        event = reader(self._message(packet), time_s) if reader is not None else None
        return [] if event is None else [event]

    def _message(self, packet: Packet) -> Any:
        return self._mav.decode(bytearray(packet.raw))

    def _is_repeated(self, packet: Packet) -> bool:
        """Whether the same packet has just been heard, over another link; also counts lost packets."""
        last = self._last.get(packet.component_id)
        self._last[packet.component_id] = packet
        if last is None:
            return False
        if packet.raw == last.raw:
            return True
        if packet.component_id == AUTOPILOT:
            gap = (packet.sequence - last.sequence - 1) & 0xFF
            self.lost += gap if gap < 128 else 0
        return False

    def _is_late(self, message: Any) -> bool:
        """Whether this message or a newer one of its kind has been heard. A restart of the autopilot resets that.

        A message that is repeated is as old as its boot time: its content becomes stale.
        """
        message_id, now_ms = message.get_msgId(), message.time_boot_ms
        newest_ms = self._newest_ms.get(message_id, -1)
        if newest_ms - REBOOT_MS < now_ms <= newest_ms:
            return True
        if now_ms < newest_ms:
            self.origin = None
            self._newest_ms.clear()
        self._newest_ms[message_id] = self.boot_ms = now_ms
        return False

    def _range(self, packet: Packet, time_s: float) -> list[Event]:
        scan = self._ranges.scan(self._message(packet), time_s, packet.component_id)
        return [] if scan is None else [RangeSeen(scan.time_s, scan)]

    def _rangefinder(self, message: Any, time_s: float) -> Event | None:
        scan = self._ranges.rangefinder(message, time_s)
        return None if scan is None else RangeSeen(time_s, scan)

    def _heartbeat(self, message: Any, time_s: float) -> Event | None:
        if message.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA or message.type not in ROVERS:
            self.impostor_type = message.type
            return None
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        return HeartbeatSeen(time_s, message.custom_mode, armed, self.system_id)

    def _local_position(self, message: Any, time_s: float) -> Event | None:
        values = (message.x, message.y, message.vx, message.vy)
        if self._is_late(message) or not all(map(math.isfinite, values)):
            return None
        return LocalPositionSeen(time_s, message.time_boot_ms / 1000.0, *values)

    def _guard(self, message: Any, time_s: float) -> Event | None:
        """NAMED_VALUE_FLOAT: only that of a guard which watches the companion counts."""
        ours = message.name == self._guards_name
        if not ours or not MIN_GUARD_MS <= abs(message.value) <= MAX_GUARD_MS:
            return None
        return GuardSeen(time_s, 1e-3 * abs(message.value), message.value < 0.0)

    def _attitude(self, message: Any, time_s: float) -> Event | None:
        if self._is_late(message) or not (math.isfinite(message.yaw) and math.isfinite(message.yawspeed)):
            return None
        return AttitudeSeen(time_s, message.time_boot_ms / 1000.0, message.yaw, message.yawspeed)

    def _global_position(self, message: Any, time_s: float) -> Event | None:
        point = point_of(message.lat, message.lon)
        if self._is_late(message) or point is None:
            return None
        return GlobalPositionSeen(time_s, message.time_boot_ms / 1000.0, point, message.alt / 1000.0)

    def _gps_origin(self, message: Any, time_s: float) -> Event | None:
        self.origin = point_of(message.latitude, message.longitude) or self.origin
        return None if self.origin is None else OriginSeen(time_s, self.origin)

    def _command_ack(self, message: Any, time_s: float) -> Event | None:
        ours = self._is_for_us(message)
        return AckSeen(time_s, message.command, message.result) if ours else None

    def _mission_ack(self, message: Any, time_s: float) -> Event | None:
        if self._is_for_us(message):
            return AckSeen(time_s, MISSION_ACK_COMMAND, message.type, message.mission_type)
        accepted = message.type == mavlink.MAV_MISSION_ACCEPTED
        return PlanChangedSeen(time_s, message.mission_type) if accepted else None

    def _plan_count(self, message: Any, time_s: float) -> Event | None:
        if not self._is_for_us(message):
            return None
        return PlanCountSeen(time_s, message.mission_type, message.count)

    def _plan_item(self, message: Any, time_s: float) -> Event | None:
        """One item of a download; nan stays nan, for the reader of the list to judge."""
        if not self._is_for_us(message):
            return None
        params = (message.param1, message.param2, message.param3, message.param4)
        scale = 1.0 if message.command in WHOLE_NUMBERS else 1e7
        place = (message.x / scale, message.y / scale)
        head = (message.mission_type, message.seq, message.command, message.frame)
        return PlanItemSeen(time_s, *head, params, *place, bool(message.autocontinue), message.z)

    def _leg(self, message: Any, time_s: float) -> Event | None:
        """A leg of an AUTO mission that is handed over to this component."""
        ours = (message.target_system, message.target_component) == (self.system_id, self.component_id)
        point = point_of(message.lat_int, message.lon_int) if ours and requests.is_place(message) else None
        return None if point is None else LegSeen(time_s, point)

    def _is_for_us(self, message: Any) -> bool:
        """Whether a message is for the companion, not for a ground station; 0 is everybody (also in MAVLink 1)."""
        return message.target_system in (0, self.system_id) and message.target_component in (0, self.component_id)


def _item_reached(message: Any, time_s: float) -> Event:
    return ItemReachedSeen(time_s, message.seq)


def _item_current(message: Any, time_s: float) -> Event:
    return ItemCurrentSeen(time_s, message.seq, None if message.total == NOT_TOLD else message.total)


def _home(message: Any, time_s: float) -> Event | None:
    point = point_of(message.latitude, message.longitude)
    return None if point is None else HomeSeen(time_s, point)


def _target(message: Any, time_s: float) -> Event | None:
    point = point_of(message.lat_int, message.lon_int)
    return None if point is None else TargetSeen(time_s, point, message.type_mask)


def _ekf(message: Any, time_s: float) -> Event:
    return EkfStatusSeen(time_s, message.flags)


def _gps(message: Any, time_s: float) -> Event:
    satellites = None if message.satellites_visible == NO_SATELLITES else message.satellites_visible
    return GpsSeen(time_s, gps_fix_of(message.fix_type), satellites, message.time_usec)


def _sticks(message: Any, time_s: float) -> Event:
    return SticksSeen(time_s, message.chan1_raw, message.chan3_raw)


def _time_answered(message: Any, time_s: float) -> Event | None:
    """TIMESYNC: an answer has the autopilot's time; without it, it is a question."""
    return TimeAnswered(time_s, message.ts1) if message.tc1 > 0 else None


def _parameter(message: Any, time_s: float) -> Event:
    return ParameterSeen(time_s, message.param_id, message.param_value)


def _prearm(message: Any, time_s: float) -> Event:
    return PrearmSeen(time_s, bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK))


def _throttle(message: Any, time_s: float) -> Event:
    return ThrottleSeen(time_s, min(message.throttle, 100) / 100.0)


def _fence_status(message: Any, time_s: float) -> Event:
    return FenceStatusSeen(time_s, message.breach_status != 0)


def _battery_status(message: Any, time_s: float) -> BatterySeen:
    """BATTERY_STATUS. Without cell voltages ArduPilot sends the whole voltage as the first cell, split above 65 V."""
    cells_mv = [cell for cell in message.voltages if cell != NO_CELL_MV] + list(message.voltages_ext)
    volts = sum(cells_mv) / 1000.0
    current_ca = message.current_battery
    return _battery(time_s, message.id, volts, message.battery_remaining, message.charge_state, current_ca)


def _sys_status(message: Any, time_s: float) -> BatterySeen:
    """SYS_STATUS: a summary of the first battery."""
    volts = 0.0 if message.voltage_battery == NO_CELL_MV else message.voltage_battery / 1000.0
    return _battery(time_s, OF_SYS_STATUS, volts, message.battery_remaining, 0, message.current_battery)


def _battery(time_s: float, number: int, volts: float, percent: int, charge_state: int, current_ca: int) -> BatterySeen:
    """0 V is no reading. Without a voltage 0 % is none either: a vehicle without a battery monitor may send it.

    ``current_ca``: hundredths of an ampere; -1 is no reading.
    """
    known_v = volts if volts > 0.0 else None
    unknown = not 0 <= percent <= 100 or (percent == 0 and known_v is None)
    amperes = None if current_ca < 0 else current_ca / 100.0
    return BatterySeen(time_s, number, known_v, None if unknown else percent, charge_state, amperes)
