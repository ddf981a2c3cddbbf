"""Where the simulator is knowingly not ArduRover: what differs, and the words with which docs/sitl.md says so."""

HARDWARE = "texts and parameters about its own hardware"
HEIGHTS = "heights"
MISSIONS = "missions and fences in the autopilot"

TOLERATED = {
    "text missing: 6 Field Elevation Set: 584m": HEIGHTS,
    "text of our own: 6 Field Elevation Set: 120m": HEIGHTS,
    "value of AHRS2.altitude": HEIGHTS,
    "value of GLOBAL_POSITION_INT.alt": HEIGHTS,
    "value of GLOBAL_POSITION_INT.relative_alt": HEIGHTS,
    "value of GPS_RAW_INT.alt": HEIGHTS,
    "value of GPS_RAW_INT.alt_ellipsoid": HEIGHTS,
    "value of POSITION_TARGET_GLOBAL_INT.alt": HEIGHTS,
    "value of VFR_HUD.alt": HEIGHTS,
    "text missing: 7 INS: alloc 6144 bytes for ISB (free=524288)": HARDWARE,
    "text missing: 7 RCInput: decoding UDP (Pulses)": HARDWARE,
    "largest range: 2100 / 2000": "readings beyond a rangefinder's maximum",
    "parameter untold: BARO": HARDWARE,
    "parameter untold: CAM": HARDWARE,
    "parameter untold: EK": HARDWARE,
    "parameter untold: INS": HARDWARE,
    "parameter untold: RELAY": HARDWARE,
    "parameter untold: SIM": HARDWARE,
    "parameter untold: STAT": HARDWARE,
    "parameter untold: MIS": MISSIONS,
    "answer missing: ('MISSION_ACK', 0, 255, 190)": MISSIONS,
    "answer missing: ('MISSION_COUNT', 4, 255, 190)": MISSIONS,
    "answer missing: ('MISSION_ITEM_INT', 0, 0, 16, 0, 1, 0.0, 0.0, -353632613, 1491652299)": MISSIONS,
    "answer missing: ('MISSION_ITEM_INT', 1, 3, 16, 0, 1, 0.0, 0.0, -353631715, 1491652300)": MISSIONS,
    "answer missing: ('MISSION_ITEM_INT', 2, 3, 16, 0, 1, 0.0, 0.0, -353631715, 1491653401)": MISSIONS,
    "answer missing: ('MISSION_ITEM_INT', 3, 0, 20, 0, 1, 0.0, 0.0, 0, 0)": MISSIONS,
    "answer missing: ('MISSION_REQUEST', 0, 255, 190)": MISSIONS,
    "answer missing: ('MISSION_REQUEST', 1, 255, 190)": MISSIONS,
    "answer missing: ('MISSION_REQUEST', 2, 255, 190)": MISSIONS,
    "answer missing: ('MISSION_REQUEST', 3, 255, 190)": MISSIONS,
    "answer of our own: ('MISSION_ACK', 1, 255, 190)": MISSIONS,
    "answer of our own: ('MISSION_ACK', 3, 255, 190)": MISSIONS,
    "answer of our own: ('MISSION_COUNT', 0, 255, 190)": MISSIONS,
    "kind missing: MISSION_ITEM_INT": MISSIONS,
    "kind missing: MISSION_REQUEST": MISSIONS,
    "state of MISSION_CURRENT: (0, 3, 2, 0) / None": MISSIONS,
    "text missing: 6 Flight plan received": MISSIONS,
}
"""Differences from the recordings."""

ROWS = {
    "Missions: upload and download": MISSIONS,
    "Missions: AUTO with a mission": MISSIONS,
    "Missions: rally points, too": MISSIONS,
    "Missions: out of a circle fence: HOLD": MISSIONS,
    "Missions: guided within AUTO: told at 1 Hz": MISSIONS,
    "Missions: and guided targets are obeyed": MISSIONS,
    "The rover's own avoidance: BendyRuler: goes round a post": "BendyRuler and Dijkstra",
}
"""Rows of the table of measured facts."""
