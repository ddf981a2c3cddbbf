"""Motions are planned only for rovers that see enough and turn on the spot; the others are led as without them."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.core.rover_limits import RoverLimits
from companion.executive.goal_driver import controller_in_force
from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import ControllerKind
from companion.settings.settings_file import parse_settings
from sitl.experiments.dead_companion import with_suite
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
WARNING = "guidance.controller: driving with points, not motion-ga: "


@pytest.mark.parametrize("kind", ["motion-ga", "dwa", "mppi", "points"])
def test_thin_beams_and_arcs_are_driven_with_points(kind: ControllerKind) -> None:
    assert controller_in_force(kind, RoverLimits(0.35, 2.0, 8.0)) == kind
    assert controller_in_force(kind, RoverLimits(0.35, 2.0, 8.0, narrow_sight=True)) == "points"
    assert controller_in_force(kind, RoverLimits(0.35, 2.0, 8.0, turning_radius_m=1.5)) == "points"


def test_a_run_says_that_points_lead_it_and_why() -> None:
    mission = with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "beams")
    settings = parse_settings({"guidance": {"controller": "motion-ga"}}, "here")
    drive = Drive(mission, scenario_from_mission(mission), settings, 3, NullRecorder(), 70.0)
    drive.run()
    outcome = drive.companion.outcome
    told = [text for text in outcome.said if WARNING in text]
    assert len(told) == 1 and "single beams see too little" in told[0]
    assert drive.simulator.collisions == ()
    executor = drive.companion.mission_run.executor
    assert executor is not None and not executor.learns, "nothing is planned, so nothing needs to be known"
