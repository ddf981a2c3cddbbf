"""Where the simulator is knowingly not ArduRover: what differs, and the words with which docs/sitl.md says so."""

HARDWARE = "texts and parameters about its own hardware"
HEIGHTS = "heights"

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
}
"""Differences from the recordings."""

ROWS = {
    "The rover's own avoidance: BendyRuler: goes round a post": "BendyRuler and Dijkstra",
}
"""Rows of the table of measured facts."""
