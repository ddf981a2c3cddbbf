"""Mission, fence and rally items: what the firmware stores of each, and the codes with which it refuses one.

ArduPilot packs an item into 15 bytes: fields that a command does not use are lost, and numbers are truncated to the
size of their field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

WAYPOINT, LOITER_UNLIMITED, LOITER_TURNS, LOITER_TIME, RETURN = 16, 17, 18, 19, 20

GUIDED_ENABLE, DELAY, CONDITION_DELAY, CONDITION_DISTANCE = 92, 93, 112, 114

JUMP_TAG, JUMP_TO_TAG = 600, 601

JUMP, CHANGE_SPEED, SET_HOME, SET_REVERSE, FENCE_ENABLE = 177, 178, 179, 194, 207

SET_YAW_SPEED, GUIDED_LIMITS = 213, 222

FENCE_RETURN_POINT, FENCE_POLYGON_IN, FENCE_POLYGON_OUT, FENCE_CIRCLE_IN, FENCE_CIRCLE_OUT = (
    5000,
    5001,
    5002,
    5003,
    5004,
)

RALLY_POINT = 5100

LAST_NAV_COMMAND = 95

ABSOLUTE, RELATIVE, TERRAIN = 0, 3, 10

MISSION_FRAME = 2

FRAMES = {0: ABSOLUTE, MISSION_FRAME: ABSOLUTE, 5: ABSOLUTE, 3: RELATIVE, 6: RELATIVE, 10: TERRAIN, 11: TERRAIN}
"""Accepted frames, and the frame in which an item is returned."""

HIGHEST_M = 83_000.0


class Result(IntEnum):
    """MAV_MISSION_RESULT."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    CANCELLED = 15


class RefusedError(Exception):
    """An item that cannot be stored; ``result`` says why."""

    def __init__(self, result: Result) -> None:
        """The code for MISSION_ACK."""
        super().__init__(result.name)
        self.result = result


@dataclass(frozen=True, slots=True)
class Item:
    """One item: ``x`` and ``y`` are latitude and longitude in 1e-7 degree, ``z`` metres."""

    command: int
    frame: int = ABSOLUTE
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    y: int = 0
    z: float = 0.0

    @property
    def place(self) -> tuple[int, int]:
        """Latitude and longitude, 1e-7 degree."""
        return self.x, self.y

    @property
    def navigates(self) -> bool:
        """Whether it is a navigation command; these run one at a time, the others alongside."""
        return self.command <= LAST_NAV_COMMAND or self.command == SET_YAW_SPEED


NO, U8, I8, U16, I16, F32, SIGN, FLAG, RADIUS = "-", "B", "b", "H", "h", "f", "s", "?", "r"

KEPT: dict[int, str] = {
    16: "H---", 17: "--r-", 19: "H-s?", 20: "----", 21: "H--s", 22: "H---", 30: "H---", 31: "-r-?", 82: "H---",
    83: "fff-", 84: "----", 85: "----", 92: "H---", 93: "fbbb", 94: "f---", 112: "f---", 114: "f---", 115: "ffbB",
    176: "H---", 177: "Hh--", 178: "Bff-", 179: "H---", 181: "BB--", 182: "Bhf-", 183: "BH--", 184: "BHhf",
    188: "----", 189: "----", 191: "----", 194: "H---", 195: "H---", 197: "H---", 201: "H---", 202: "BBBB",
    203: "BBbB", 205: "fff-", 206: "f-B-", 207: "H---", 208: "H---", 210: "H---", 211: "BB--", 212: "H---",
    213: "ffB-", 215: "H---", 216: "H---", 218: "HH--", 222: "Hfff", 223: "??f-", 600: "H---", 601: "Hh--",
    3000: "B---", 42600: "BBff",
}  # fmt: skip
"""How each of a command's four parameters is stored; commands that are not listed are unsupported.

``LOITER_TURNS`` has rules of its own.
"""

AT_A_PLACE = {16, 17, 18, 19, 21, 22, 30, 31, 82, 84, 85, 92, 94, 179, 188, 189, 191, 195, 201}
"""Commands stored with latitude, longitude and height; other commands lose them."""

RAW_PLACES = {202, 203}
"""Camera commands, whose x and y are not coordinates."""

NAN_HEADING = {16, 21, 22, 84, 85}
"""Commands whose fourth parameter may be NaN."""

NAMES: dict[int, str] = {
    16: "WP", 17: "LoitUnlim", 18: "LoitTurns", 19: "LoitTime", 20: "RTL", 21: "Land", 22: "Takeoff",
    30: "ContinueAndChangeAlt", 31: "LoitAltitude", 82: "SplineWP", 83: "AltitudeWait", 84: "VTOLTakeoff",
    85: "VTOLLand", 92: "GuidedEnable", 93: "Delay", 94: "PayloadPlace", 112: "CondDelay", 114: "CondDist",
    115: "CondYaw", 177: "Jump", 178: "ChangeSpeed", 179: "SetHome", 181: "SetRelay", 182: "RepeatRelay",
    183: "SetServo", 184: "RepeatServo", 188: "ReturnPathStart", 189: "LandStart", 191: "GoAround", 194: "SetReverse",
    195: "SetROI", 197: "SetROI", 201: "SetROI", 202: "DigiCamCfg", 203: "DigiCamCtrl", 205: "MountControl",
    206: "SetCamTrigDst", 207: "FenceEnable", 208: "Parachute", 210: "InvertedFlight", 211: "Gripper",
    212: "AutoTuneEnable", 213: "SetYawSpd", 215: "SetRepeatDist", 216: "Sprayer", 218: "AuxFunction",
    222: "GuidedLimits", 223: "EngineControl", 600: "Tag", 601: "JumpToTag", 3000: "VTOLTransition", 42600: "Winch",
}  # fmt: skip
"""The commands' names in the firmware's texts."""


def _wrapped(value: float, kind: str) -> float:
    """A number truncated to an integer of one or two bytes."""
    bits = 8 if kind in (U8, I8) else 16
    number = int(value) & ((1 << bits) - 1)
    if kind in (I8, I16) and number >= 1 << (bits - 1):
        number -= 1 << bits
    return float(number)


def _kept(value: float, kind: str) -> float:
    if kind == NO:
        return 0.0
    if kind == F32:
        return float(np.float32(value))
    if kind == SIGN:
        return -1.0 if value < 0.0 else 1.0
    if kind == FLAG:
        return 1.0 if value > 0.0 else 0.0
    if kind == RADIUS:
        return math.copysign(_wrapped(abs(value), U16), value)
    return _wrapped(value, kind)


def _kept_turns(turns: float, radius_m: float, tangent: float) -> tuple[float, float, float, float]:
    """LOITER_TURNS: turns and radius share two bytes, so few turns are in 256ths and large radii in tens of metres."""
    few = 0.0 < turns < 1.0
    kept = math.floor(turns * 256.0) / 256.0 if few else _wrapped(turns, U8)
    metres = abs(radius_m)
    metres = min(math.floor(metres / 10.0), 255.0) * 10.0 if metres >= 256.0 else float(int(metres))
    return kept, 0.0, math.copysign(metres, radius_m), 1.0 if tangent > 0.0 else 0.0


def _check_numbers(message: Any) -> tuple[float, float, float, float]:
    params = (float(message.param1), float(message.param2), float(message.param3), float(message.param4))
    for number, value in enumerate(params):
        missing = math.isnan(value) and not (number == 3 and message.command in NAN_HEADING)
        if missing or math.isinf(value):
            raise RefusedError(Result(Result.INVALID_PARAM1 + number))
    return params


def _check_place(x: int, y: int) -> None:
    if abs(x) > 900_000_000:
        raise RefusedError(Result.INVALID_PARAM5_X)
    if abs(y) > 1_800_000_000:
        raise RefusedError(Result.INVALID_PARAM6_Y)


def units(message: Any) -> tuple[int, int]:
    """x and y of MISSION_ITEM_INT, or those of MISSION_ITEM times 1e7 in single precision, as in the firmware."""
    if message.get_type() == "MISSION_ITEM_INT":
        return int(message.x), int(message.y)
    if message.command in RAW_PLACES:
        if not (math.isfinite(message.x) and math.isfinite(message.y)):
            raise RefusedError(Result.INVALID_PARAM5_X)
        return int(message.x), int(message.y)
    if not abs(message.x) <= 90.0:
        raise RefusedError(Result.INVALID_PARAM5_X)
    if not abs(message.y) <= 180.0:
        raise RefusedError(Result.INVALID_PARAM6_Y)
    scale = np.float32(1e7)
    return int(np.float32(message.x) * scale), int(np.float32(message.y) * scale)


def _raw_place(x: int, y: int, z: float) -> tuple[int, int, float]:
    """Numbers of a camera command, truncated to one byte each."""
    return int(_wrapped(x, U8)), int(_wrapped(y, U8)), _wrapped(z, U8) if math.isfinite(z) else 0.0


def mission_item(message: Any) -> Item:
    """A mission item, as stored from MISSION_ITEM(_INT). Raises RefusedError."""
    command = int(message.command)
    if command == 0:
        raise RefusedError(Result.INVALID)
    params = _check_numbers(message)
    if command == LOITER_TURNS:
        kept = _kept_turns(params[0], params[2], params[3])
    elif command in KEPT:
        values = [_kept(0.0 if math.isnan(v) else v, k) for v, k in zip(params, KEPT[command], strict=True)]
        kept = (values[0], values[1], values[2], values[3])
    else:
        raise RefusedError(Result.UNSUPPORTED)
    x, y = units(message)
    if command in RAW_PLACES:
        return Item(command, ABSOLUTE, kept, *_raw_place(x, y, message.z))
    if command not in AT_A_PLACE:
        return Item(command, ABSOLUTE, kept)
    _check_place(x, y)
    if not abs(message.z) < HIGHEST_M:
        raise RefusedError(Result.INVALID_PARAM7)
    if message.frame not in FRAMES:
        raise RefusedError(Result.UNSUPPORTED_FRAME)
    height_cm = int(np.float32(message.z) * np.float32(100.0))
    return Item(command, FRAMES[message.frame], kept, x, y, height_cm / 100.0)


def fence_item(message: Any) -> Item:
    """A fence item, as stored from MISSION_ITEM(_INT). Raises RefusedError."""
    if message.frame not in FRAMES or message.frame == MISSION_FRAME:
        raise RefusedError(Result.UNSUPPORTED_FRAME)
    if message.command in (FENCE_POLYGON_IN, FENCE_POLYGON_OUT):
        first = _wrapped(message.param1, U8) if math.isfinite(message.param1) else 0.0
    elif message.command in (FENCE_CIRCLE_IN, FENCE_CIRCLE_OUT):
        first = float(message.param1)
    elif message.command == FENCE_RETURN_POINT:
        first = 0.0
    else:
        raise RefusedError(Result.UNSUPPORTED)
    return Item(int(message.command), ABSOLUTE, (first, 0.0, 0.0, 0.0), *units(message))


def rally_item(message: Any) -> Item:
    """A rally point, as stored from MISSION_ITEM(_INT). Raises RefusedError."""
    if message.command != RALLY_POINT:
        raise RefusedError(Result.UNSUPPORTED)
    if message.frame not in FRAMES or message.frame == MISSION_FRAME:
        raise RefusedError(Result.UNSUPPORTED_FRAME)
    x, y = units(message)
    _check_place(x, y)
    if not -32768.0 <= message.z <= 32767.0:
        raise RefusedError(Result.INVALID_PARAM7)
    return Item(RALLY_POINT, FRAMES[message.frame], (0.0, 0.0, 0.0, 0.0), x, y, float(int(message.z)))


def fence_fault(items: list[Item]) -> str | None:
    """What is wrong with these fence items together, in the firmware's words; None if nothing."""
    missing, count, kind, seen_return = 0, 0, 0, False
    types = {
        FENCE_POLYGON_IN: 98,
        FENCE_POLYGON_OUT: 97,
        FENCE_CIRCLE_IN: 92,
        FENCE_CIRCLE_OUT: 93,
        FENCE_RETURN_POINT: 95,
    }
    for item in items:
        corners = int(item.params[0])
        if item.command in (FENCE_POLYGON_IN, FENCE_POLYGON_OUT):
            if corners < 3:
                return f"Invalid vertex count ({corners})"
            if missing == 0:
                missing, count, kind = corners, corners, item.command
            elif item.command != kind:
                return f"Received incorrect vertex type (want={types[kind]} got={types[item.command]})"
            elif corners != count:
                return f"Unexpected vertex count want={count} got={corners}\n"
            missing -= 1
        elif missing:
            return f"Received incorrect type (want={types[kind]} got={types[item.command]})"
        elif item.command == FENCE_RETURN_POINT:
            if seen_return:
                return "Multiple return points"
            seen_return = True
        elif not (item.params[0] > 0.0 and math.isfinite(item.params[0])):
            return "Non-positive circle radius"
        if abs(item.x) > 900_000_000 or abs(item.y) > 1_800_000_000:
            return "Bad lat or lon"
    return "Incorrect item count" if missing else None
