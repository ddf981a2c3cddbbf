"""Real mission files of ground stations and test suites: how many targets, or why not."""

import pytest

from companion.mission.ground_station_reader import load_ground_station_file
from companion.mission.load import load_mission
from tests.companion.mission.test_waypoints_reader import refusal
from tests.support.shared_data import SHARED, needs_shared

FENCE = "fences but no place to go to"
REAL: dict[str, int | str] = {
    "ardupilot/ArduRover_Tests__AC_Avoidance__rover-fence-ac-avoid.txt": "expected the header",
    "ardupilot/ArduRover_Tests__ArmFeatures__test_arming.txt": 2,
    "ardupilot/ArduRover_Tests__DriveMission__rover1.txt": 32,
    "ardupilot/ArduRover_Tests__DriveRTL__rtl.txt": 3,
    "ardupilot/ArduRover_Tests__GCSFailsafe__test_arming.txt": 2,
    "ardupilot/ArduRover_Tests__GripperMission__rover-gripper-mission.txt": 3,
    "ardupilot/ArduRover_Tests__MAVProxy_SetModeUsingSwitch__test_arming.txt": 2,
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRulerEasierAuto__rover-path-bendyruler-fence.txt": FENCE,
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRulerEasierGuided__rover-path-bendyruler-fence.txt": FENCE,
    "ardupilot/ArduRover_Tests__PolyFenceObjectAvoidanceBendyRuler__rover-path-bendyruler-fence.txt": FENCE,
    "ardupilot/ArduRover_Tests__Rally__rover-test-rally.txt": "expected the header",
    "mavsdk/mission_planner_sample.txt": "item 0: NAV_TAKEOFF (22): no rover can do it; --skip-unknown drives the rest",
    "mavsdk/qgroundcontrol_sample.plan": "item 1: NAV_TAKEOFF (22)",
    "mavsdk/qgroundcontrol_sample_wrong_overall_version.plan": "only version 1 is understood, got 42",
    "pymavlink/fence-110.txt": FENCE,
    "pymavlink/rally-110.txt": "target: there is none",
    "qgroundcontrol/MissionPlanner.waypoints": 5,
    "qgroundcontrol_rover_plans/ArduPilotSITL-ArduRover.plan": 7,
    "ros_gz_rover/playpen.txt": 7,
}


@needs_shared
def test_every_real_file_is_in_the_table() -> None:
    folder = SHARED / "data" / "missions"
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*") if path.name != "SOURCE.txt"}
    assert files == set(REAL)


@needs_shared
@pytest.mark.parametrize(("name", "expected"), REAL.items())
def test_real_files(name: str, expected: int | str) -> None:
    path = SHARED / "data" / "missions" / name
    if isinstance(expected, str):
        assert expected in refusal(path)
    else:
        assert len(load_mission(path).targets) == expected


@needs_shared
def test_a_real_fence_file_has_its_areas() -> None:
    mission = load_ground_station_file(SHARED / "data" / "missions" / "pymavlink" / "fence-110.txt")
    assert [len(area.places) for area in mission.keep_in] == [8]
    assert [area.radius_m for area in mission.keep_out] == [20.0, 20.0]
