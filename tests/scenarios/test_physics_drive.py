"""The whole chain over the JSON interface, with our simulated autopilot in the firmware's place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, cast

import pytest

from companion.app import Companion
from companion.executive.warm_up import warm_up
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.mission.load import load_mission
from companion.navigation.step_runner import InlineRunner
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.autopilot.parameters import steered_wheels
from sitl.firmware.physics import Physics
from sitl.lockstep import LockstepClock
from sitl.scenario import scenario_from_mission
from sitl.sensors.range_sensors import SUITES
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.quick import first_of
from tests.support.sitl_client import HOME, open_ground, ready
from tests.support.split_vehicle import SplitVehicle

ROOT = Path(__file__).resolve().parents[2]


@first_of(1, "turning_radius_m", [0.0, 2.0], ids=["skid", "ackermann"])
@first_of(1, "target_m", [(20.0, 0.0), (8.0, -12.0)])
def test_the_same_autopilot_drives_over_the_interface_as_in_the_simulator(
    turning_radius_m: float, target_m: tuple[float, float]
) -> None:
    parameters = steered_wheels(turning_radius_m) if turning_radius_m else {}
    whole = open_ground(turning_radius_m=turning_radius_m, parameters=parameters)
    start = SimStart(0.0, 0.0, 0.0, HOME)
    behind = Physics(World.open(), start, SUITES["none"], turning_radius_m=turning_radius_m)
    split = SplitVehicle(behind, parameters)
    clients = [ready(whole), ready(cast(Simulator, split))]
    for client in clients:
        client.drive_to(*target_m)
    farthest_m = 0.0
    for _ in range(120):
        for client in clients:
            client.run_for(0.1)
        truth, motion = whole.truth, behind.motion
        farthest_m = max(farthest_m, math.hypot(truth.north_m - motion.north_m, truth.east_m - motion.east_m))
    assert math.dist((truth.north_m, truth.east_m), target_m) < 3.5
    # The one difference: outputs are rounded to whole microseconds, a five-hundredth of the throttle.
    assert farthest_m < 0.005


@pytest.mark.thorough
def test_the_companion_drives_a_mission_over_the_interface_by_the_published_lidar() -> None:
    mission = load_mission(ROOT / "missions" / "one-obstacle.toml")
    scenario = scenario_from_mission(mission)
    behind = scenario.physics(0, linked=True)
    split = cast(Any, SplitVehicle(behind, scenario.parameters))
    settings = Settings()
    warm_up(settings, mission.rover.turning_radius_m)
    near, far = MemoryLink.pair()
    companion = Companion(
        AutopilotLink(near, Codec(settings.link), settings.link, NullRecorder()),
        LockstepClock(split, split.connect(), far), mission, settings, InlineRunner(), NullRecorder(), seed=0, arm=True,
    )  # fmt: skip
    while not companion.done and split.time_s < 400.0:
        companion.tick()
    assert companion.outcome.complete
    assert behind.collisions == ()
