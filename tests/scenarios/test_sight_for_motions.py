"""Motions are planned only for rovers that see enough and turn on the spot; the others are led as without them."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings.settings_file import parse_settings
from sitl.experiments.dead_companion import with_suite
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
WARNING = "guidance.controller: driving with points, not motion-ga: "


@pytest.mark.thorough
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
    assert executor is not None and executor.evidence.settings.keeps == "circle"
    assert not executor.learns, "nothing is planned, so nothing needs to be known"
