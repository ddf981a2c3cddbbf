"""Names of the MAVLink commands that mission files are likely to hold, and of their frames (common.xml numbers).

Missions are read without a MAVLink library: only a few commands are understood, the rest is named and refused.
"""

from __future__ import annotations

NAV_WAYPOINT, NAV_LOITER_UNLIM, NAV_LOITER_TIME, NAV_RETURN_TO_LAUNCH = 16, 17, 19, 20
NAV_GUIDED_ENABLE, NAV_DELAY, NAV_LAST = 92, 93, 95
DO_JUMP, DO_CHANGE_SPEED = 177, 178
FENCE_RETURN_POINT, FENCE_POLYGON_IN, FENCE_POLYGON_OUT, FENCE_CIRCLE_IN, FENCE_CIRCLE_OUT = (
    5000,
    5001,
    5002,
    5003,
    5004,
)
RALLY_POINT = 5100

NAMES = {
    16: "NAV_WAYPOINT",
    17: "NAV_LOITER_UNLIM",
    18: "NAV_LOITER_TURNS",
    19: "NAV_LOITER_TIME",
    20: "NAV_RETURN_TO_LAUNCH",
    21: "NAV_LAND",
    22: "NAV_TAKEOFF",
    30: "NAV_CONTINUE_AND_CHANGE_ALT",
    31: "NAV_LOITER_TO_ALT",
    80: "NAV_ROI",
    82: "NAV_SPLINE_WAYPOINT",
    84: "NAV_VTOL_TAKEOFF",
    85: "NAV_VTOL_LAND",
    92: "NAV_GUIDED_ENABLE",
    93: "NAV_DELAY",
    94: "NAV_PAYLOAD_PLACE",
    112: "CONDITION_DELAY",
    113: "CONDITION_CHANGE_ALT",
    114: "CONDITION_DISTANCE",
    115: "CONDITION_YAW",
    176: "DO_SET_MODE",
    177: "DO_JUMP",
    178: "DO_CHANGE_SPEED",
    179: "DO_SET_HOME",
    180: "DO_SET_PARAMETER",
    181: "DO_SET_RELAY",
    182: "DO_REPEAT_RELAY",
    183: "DO_SET_SERVO",
    184: "DO_REPEAT_SERVO",
    189: "DO_LAND_START",
    192: "DO_REPOSITION",
    193: "DO_PAUSE_CONTINUE",
    194: "DO_SET_REVERSE",
    195: "DO_SET_ROI_LOCATION",
    197: "DO_SET_ROI_NONE",
    200: "DO_CONTROL_VIDEO",
    201: "DO_SET_ROI",
    202: "DO_DIGICAM_CONFIGURE",
    203: "DO_DIGICAM_CONTROL",
    204: "DO_MOUNT_CONFIGURE",
    205: "DO_MOUNT_CONTROL",
    206: "DO_SET_CAM_TRIGG_DIST",
    207: "DO_FENCE_ENABLE",
    208: "DO_PARACHUTE",
    211: "DO_GRIPPER",
    212: "DO_AUTOTUNE_ENABLE",
    213: "NAV_SET_YAW_SPEED",
    214: "DO_SET_CAM_TRIGG_INTERVAL",
    216: "DO_SPRAYER",
    218: "DO_AUX_FUNCTION",
    222: "DO_GUIDED_LIMITS",
    223: "DO_ENGINE_CONTROL",
    420: "INJECT_FAILURE",
    530: "SET_CAMERA_MODE",
    600: "JUMP_TAG",
    601: "DO_JUMP_TAG",
    1000: "DO_GIMBAL_MANAGER_PITCHYAW",
    2000: "IMAGE_START_CAPTURE",
    2001: "IMAGE_STOP_CAPTURE",
    2003: "DO_TRIGGER_CONTROL",
    2500: "VIDEO_START_CAPTURE",
    2501: "VIDEO_STOP_CAPTURE",
    3000: "DO_VTOL_TRANSITION",
    5000: "NAV_FENCE_RETURN_POINT",
    5001: "NAV_FENCE_POLYGON_VERTEX_INCLUSION",
    5002: "NAV_FENCE_POLYGON_VERTEX_EXCLUSION",
    5003: "NAV_FENCE_CIRCLE_INCLUSION",
    5004: "NAV_FENCE_CIRCLE_EXCLUSION",
    5100: "NAV_RALLY_POINT",
    42702: "NAV_SCRIPT_TIME",
}

GLOBAL_FRAMES = (0, 3, 5, 6, 10, 11)
"""Latitude and longitude, with altitudes of several kinds; a rover stays on the ground, so altitudes do not matter."""

FRAME_NAMES = {1: "LOCAL_NED", 2: "MISSION", 4: "LOCAL_ENU", 7: "LOCAL_OFFSET_NED", 8: "BODY_NED", 9: "BODY_OFFSET_NED"}


def command_name(command: int) -> str:
    """``NAV_LAND (21)``, or only the number of an unknown command."""
    return f"{NAMES[command]} ({command})" if command in NAMES else f"command {command}"
