"""What the doctor makes of what was found: every finding, and nothing of a rover that is well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.core.frames import GeoPoint
from companion.core.scan import RangeScan
from companion.diagnosis.checks import PARAMETERS, diagnose, kernels
from companion.diagnosis.finding import Level
from companion.vehicle.events import (
    EkfStatusSeen,
    GpsSeen,
    GuardSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    PrearmSeen,
    RangeSeen,
    RoverMode,
)
from companion.vehicle.gps_fix import GpsFix
from companion.vehicle.state import VehicleState
from companion.vehicle.survey import Autopilot, RangeSource, SlowMessage, Survey
from companion.vehicle.wanted_parameters import wanted_parameters

HERE = GeoPoint(53.0, 23.0)
SCAN = RangeSeen(0.0, RangeScan(0.0, np.array([0.0]), np.array([3.0]), 0.1, 8.0, 0.1, "x"))
LIDAR = RangeSource("OBSTACLE_DISTANCE", 196, 0, None, 0.1, 8.0, 10.0)
BEAM = RangeSource("DISTANCE_SENSOR", 1, 0, 0, 0.2, 20.0, 10.0)
CAMERA = RangeSource("OBSTACLE_DISTANCE_3D", 196, 4, None, 0.3, 6.0, 10.0, frame=12)
WELL_SET = {
    "OA_TYPE": 0.0, "AVOID_ENABLE": 0.0, "GUID_OPTIONS": 0.0, "GUID_TIMEOUT": 3.0, "WP_RADIUS": 1.0, "WP_SPEED": 2.0,
    "WP_JERK": 3.0, "PRX1_TYPE": 0.0, "RNGFND1_TYPE": 0.0, "FS_GCS_ENABLE": 1.0, "FENCE_ENABLE": 0.0,
    "ATC_ACCEL_MAX": 1.0, "ATC_DECEL_MAX": 0.0, "ATC_STR_ACC_MAX": 120.0, "ATC_STR_RAT_MAX": 120.0, "CRUISE_SPEED": 2.0,
    "CRUISE_THROTTLE": 50.0, "FS_ACTION": 2.0, "FS_EKF_ACTION": 1.0,
    "MAV_GCS_SYSID": 255.0, "RCMAP_ROLL": 1.0, "RCMAP_THROTTLE": 3.0, "SCR_ENABLE": 1.0,
    "SCR_USER1": 300.0,
}  # fmt: skip
WELL = Survey(
    place="memory",
    vehicle=VehicleState(
        heartbeat=HeartbeatSeen(0.0, RoverMode.HOLD, False, 1),
        position=LocalPositionSeen(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ekf=EkfStatusSeen(0.0, 831),
        origin=OriginSeen(0.0, HERE),
        home=HomeSeen(0.0, HERE),
        prearm=PrearmSeen(0.0, True),
        scan=SCAN,
        scan_ahead=SCAN,
        guard=GuardSeen(0.0, 0.3, False),
    ),
    rover_heard=True,
    autopilots=(Autopilot(1, 10, 3),),
    systems=frozenset({1, 255}),
    version=(4, 7, 0),
    parameters=WELL_SET,
    asked=PARAMETERS,
    sources=(LIDAR,),
    packets=1000,
)


def with_set(**values: float) -> Survey:
    return replace(WELL, parameters={**WELL_SET, **values})


def without(*names: str) -> Survey:
    return replace(WELL, parameters={name: value for name, value in WELL_SET.items() if name not in names})


def with_state(**parts: Any) -> Survey:
    return replace(WELL, vehicle=replace(WELL.vehicle, **parts))


def beat(mode: int, *, armed: bool) -> Survey:
    return with_state(heartbeat=HeartbeatSeen(0.0, mode, armed, 1))


S, W, N = Level.STOP, Level.WARN, Level.NOTE
CASES: list[tuple[str, Level, Survey]] = [
    ("oa-type", S, with_set(OA_TYPE=1.0)),
    ("avoid-enable", S, with_set(AVOID_ENABLE=7.0)),
    ("guid-options", S, with_set(GUID_OPTIONS=72.0)),
    ("guid-timeout", W, with_set(GUID_TIMEOUT=20.0)),
    ("wp-radius", W, with_set(WP_RADIUS=3.0)),
    ("wp-jerk", N, with_set(WP_JERK=0.0)),
    ("wp-jerk", N, with_set(WP_JERK=20.0)),
    ("cruise-throttle", W, with_set(CRUISE_SPEED=3.0, CRUISE_THROTTLE=25.0)),
    ("cruise-throttle", W, with_set(CRUISE_SPEED=1.0, CRUISE_THROTTLE=75.0)),
    ("cruise-throttle", W, with_set(CRUISE_SPEED=3.0, CRUISE_THROTTLE=0.0)),
    ("guard", N, replace(without("SCR_ENABLE", "SCR_USER1"), vehicle=replace(WELL.vehicle, guard=None))),
    ("guard", N, replace(with_set(SCR_ENABLE=0.0, SCR_USER1=0.0), vehicle=replace(WELL.vehicle, guard=None))),
    ("guard", W, replace(with_set(SCR_ENABLE=0.0), vehicle=replace(WELL.vehicle, guard=None))),
    ("guard", W, with_state(guard=None)),
    ("late-guard", N, with_state(guard=GuardSeen(0.0, 1.0, False))),
    ("guard-wait", N, with_set(SCR_USER1=100.0)),
    ("port-shared", S, replace(WELL, rivals=("cat (process 7)",), bad_bytes=900, read_bytes=1000)),
    ("port-damaged", W, replace(WELL, bad_bytes=60, read_bytes=1000)),
    ("points-frame", W, replace(WELL, sources=(replace(CAMERA, frame=1, blind=True),))),
    ("range-unknown", W, replace(WELL, sources=(replace(CAMERA, blind=True),))),
    ("range-slow", W, replace(WELL, sources=(replace(CAMERA, rate_hz=1.0),))),
    ("wp-speed", W, with_set(WP_SPEED=0.0)),
    ("echo", N, with_set(PRX1_TYPE=2.0)),
    ("gcs-failsafe", N, with_set(FS_GCS_ENABLE=0.0)),
    ("gcs-failsafe", W, replace(WELL, systems=frozenset({1}))),
    ("system-ids", S, with_set(MAV_GCS_SYSID=1.0)),
    ("fence", N, with_set(FENCE_ENABLE=1.0)),
    ("fence-breached", S, replace(with_set(FENCE_ENABLE=1.0), fence_breached=True)),
    ("no-parameters", W, replace(WELL, parameters={})),
    ("parameters-unheard", W, without("OA_TYPE")),
    ("parameters-unheard", W, without("MAV_GCS_SYSID")),
    ("sticks", W, with_set(RCMAP_THROTTLE=2.0)),
    ("packets-lost", W, replace(WELL, lost=200)),
    ("firmware", W, replace(WELL, version=(4, 5, 6))),
    ("firmware", N, replace(WELL, version=None)),
    ("armed", N, beat(RoverMode.HOLD, armed=True)),
    ("mode", S, beat(RoverMode.MANUAL, armed=True)),
    ("mode", S, beat(1, armed=True)),
    ("ekf", S, with_state(ekf=None)),
    ("ekf", S, with_state(ekf=EkfStatusSeen(0.0, 1 | 128))),
    ("ekf", S, with_state(ekf=EkfStatusSeen(0.0, 1024))),
    ("ekf", S, with_state(ekf=EkfStatusSeen(0.0, 831 & ~1))),
    ("origin", S, with_state(origin=None)),
    ("origin", S, with_state(home=None)),
    ("no-position", S, with_state(position=None)),
    ("pre-arm", S, with_state(prearm=PrearmSeen(0.0, False))),
    ("pre-arm", S, replace(with_state(prearm=None), texts=("PreArm: Radio not calibrated",))),
    ("text", N, replace(WELL, texts=("Battery 1 low",))),
    ("rate", S, replace(WELL, slow=(SlowMessage("ATTITUDE", 20.0, 1.0),))),
    ("rate", W, replace(WELL, slow=(SlowMessage("ATTITUDE", 20.0, 8.0),))),
    ("no-range-sensor", S, replace(with_state(scan=None, scan_ahead=None), sources=())),
    ("not-ahead", S, with_state(scan_ahead=None)),
    ("coarse-range", W, replace(WELL, sources=(replace(BEAM, sensor=10, sector=True),))),
    ("range-limits", S, replace(WELL, sources=(LIDAR, replace(BEAM, max_m=0.2)))),
    ("range-limits", W, replace(WELL, sources=(replace(BEAM, max_m=1.0),))),
    ("range-limits", W, replace(WELL, sources=(replace(BEAM, max_m=700.0),))),
    ("range-limits", W, replace(WELL, sources=(replace(BEAM, min_m=1.0),))),
    ("range-unknown", W, replace(WELL, sources=(LIDAR, replace(BEAM, blind=True)))),
    ("range-slow", W, replace(WELL, sources=(replace(LIDAR, rate_hz=1.0),))),
    ("several-autopilots", W, replace(WELL, autopilots=(Autopilot(1, 10, 3), Autopilot(2, 10, 3)))),
    ("two-companions", S, replace(WELL, companion_heard=True)),
    ("signing", W, replace(WELL, signing="The autopilot signs")),
    ("signing", S, replace(WELL, rover_heard=False, signing="Heard only unsigned packets", signing_remedy="so")),
    ("not-a-rover", S, replace(WELL, rover_heard=False, autopilots=(Autopilot(1, 2, 3),))),
    ("no-autopilot", S, replace(WELL, rover_heard=False, autopilots=())),
    ("no-autopilot", S, Survey(place="memory")),
]  # fmt: skip


@pytest.mark.parametrize(
    "seen", [replace(WELL, lost=50, packets=100), replace(WELL, slow=(SlowMessage("ATTITUDE", 10.0, 2.0),)), Survey("")]
)
def test_baud_rates_are_spoken_of_on_serial_lines_only(seen: Survey) -> None:
    (wire,) = diagnose(replace(seen, place="serial:/dev/ttyAMA0:57600"))
    (network,) = diagnose(replace(seen, place="udp:14550"))
    assert "baud" in wire.remedy and "baud" not in network.remedy


def test_a_rover_that_is_well_has_no_findings() -> None:
    assert diagnose(WELL) == []


@pytest.mark.parametrize(("name", "level", "seen"), CASES, ids=[f"{case[0]}-{n}" for n, case in enumerate(CASES)])
def test_one_fault_is_one_finding(name: str, level: Level, seen: Survey) -> None:
    findings = diagnose(seen)
    assert [(one.name, one.level) for one in findings] == [(name, level)]
    (finding,) = findings
    assert finding.says and "\n" not in finding.says
    assert finding.remedy or name == "text"
    if finding.wanted is not None:
        assert finding.remedy == f"set {finding.parameter} to {finding.wanted:g}"
        assert finding.value == seen.parameters[finding.parameter] != finding.wanted


def test_a_rover_that_is_told_to_drive_slowly_may_well_be_faster() -> None:
    assert diagnose(with_set(WP_SPEED=0.5, CRUISE_SPEED=3.0, CRUISE_THROTTLE=75.0)) == []


def test_few_bytes_or_few_of_them_bad_are_no_finding() -> None:
    assert diagnose(replace(WELL, bad_bytes=49, read_bytes=1000)) == []
    assert diagnose(replace(WELL, bad_bytes=100, read_bytes=400)) == []


def test_a_port_that_is_shared_is_told_though_no_rover_is_heard() -> None:
    names = [one.name for one in diagnose(Survey("serial:/dev/ttyACM0:115200", rivals=("cat (process 7)",)))]
    assert names == ["port-shared", "no-autopilot"]


@pytest.mark.parametrize("name", ["OA_TYPE", "AVOID_ENABLE", "GUID_TIMEOUT", "WP_RADIUS", "WP_JERK", "RCMAP_ROLL"])
def test_the_doctor_and_the_table_of_wanted_parameters_agree(name: str) -> None:
    (wanted,) = (one for one in wanted_parameters(2.0) if one.name == name)
    for value in (0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 7.0):
        assert wanted.accepts(value) == (diagnose(with_set(**{name: value})) == []), f"{name} {value}"


def test_what_is_to_be_set_keeps_the_other_bits() -> None:
    assert diagnose(with_set(GUID_OPTIONS=72.0))[0].wanted == 8.0


def test_what_was_not_heard_is_named() -> None:
    (finding,) = diagnose(without("OA_TYPE", "GUID_OPTIONS"))
    assert finding.says == "Not told, and so not looked at: OA_TYPE, GUID_OPTIONS."


def test_the_gravest_comes_first() -> None:
    levels = [one.level for one in diagnose(replace(with_set(OA_TYPE=2.0, WP_RADIUS=5.0, FENCE_ENABLE=1.0), lost=900))]
    assert levels == [S, W, W, N]


def test_why_it_would_not_arm_is_told_and_what_is_over_is_not() -> None:
    texts = ("PreArm: AHRS: waiting for home", "PreArm: Radio not calibrated")
    (finding,) = diagnose(replace(with_state(prearm=PrearmSeen(0.0, False)), texts=texts))
    assert finding.says == "The autopilot would not arm: AHRS: waiting for home; Radio not calibrated."
    assert diagnose(replace(WELL, texts=texts)) == []


def test_a_position_that_there_is_not_is_no_matter_of_the_line() -> None:
    slow = (SlowMessage("LOCAL_POSITION_NED", 10.0, 0.0), SlowMessage("ATTITUDE", 20.0, 8.0))
    waiting = replace(with_state(ekf=EkfStatusSeen(0.0, 167), position=None), slow=slow)
    assert [(one.name, one.says[:8]) for one in diagnose(waiting)] == [("ekf", "The EKF "), ("rate", "ATTITUDE")]
    assert [one.says[:8] for one in diagnose(replace(WELL, slow=slow))] == ["LOCAL_PO", "ATTITUDE"]
    silent = replace(with_state(ekf=None), slow=slow)
    assert [one.name for one in diagnose(silent)] == ["ekf", "rate", "rate"]


def test_cold_kernels() -> None:
    assert [one.level for one in kernels(cold=True)] == [W]
    assert kernels(cold=False) == []


def test_the_page_explains_every_finding() -> None:
    page = (Path(__file__).parents[3] / "docs" / "doctor.md").read_text(encoding="utf-8")
    for name in {case[0] for case in CASES} | {"kernels-cold"}:
        assert f"| `{name}` |" in page
    for name in PARAMETERS:
        assert f"`{name}`" in page


@pytest.mark.parametrize(
    ("gps_fix", "told", "stops"),
    [
        ("any", None, False),
        ("any", GpsFix.NO_GPS, False),
        ("3d", None, True),
        ("rtk-fixed", GpsFix.RTK_FLOAT, True),
        ("rtk-fixed", GpsFix.RTK_FIXED, False),
        ("3d", GpsFix.FIX_2D, True),
        ("rtk-float", GpsFix.RTK_FIXED, False),
    ],
)
def test_a_fix_that_is_worse_than_asked_for_or_not_told_would_stop_a_mission(
    gps_fix: str, told: GpsFix | None, stops: bool
) -> None:
    seen = None if told is None else GpsSeen(0.0, told, 10)
    found = diagnose(replace(WELL, vehicle=replace(WELL.vehicle, gps=seen)), gps_fix)
    assert [(one.name, one.level) for one in found] == ([("gps-fix", Level.STOP)] if stops else [])
    assert all(one.remedy and gps_fix in one.says for one in found)


@pytest.mark.parametrize(
    ("scripts", "remedy"), [(0.0, "set SCR_ENABLE to 1"), (1.0, "upload it with `rover-companion guard --install`")]
)
def test_where_a_guard_is_meant_it_is_said_why_there_may_be_none(scripts: float, remedy: str) -> None:
    seen = replace(with_set(SCR_ENABLE=scripts), vehicle=replace(WELL.vehicle, guard=None))
    (found,) = diagnose(seen)
    assert found.says.startswith("SCR_USER1 is set for a guard, but") and found.remedy.startswith(remedy)


@pytest.mark.parametrize(("waits_s", "late"), [(0.95, False), (0.951, True)])
def test_a_guard_is_late_from_the_limit_on_with_which_motions_keep_more_room(waits_s: float, late: bool) -> None:
    found = diagnose(with_state(guard=GuardSeen(0.0, waits_s, False)))
    assert [one.name for one in found] == ["late-guard"] * late
    assert all(f"{waits_s:g} s" in one.says and "SCR_USER1 to 300" in one.remedy for one in found)
