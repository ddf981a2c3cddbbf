"""A shipped mission under each kind of fault: nothing is touched, and a rover that stops says why."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.cli.commands import app
from sitl.faults.fault_file import load_faults
from sitl.faults.plan import (
    BatteryLow,
    Fault,
    FaultPlan,
    GpsGlitch,
    GpsLoss,
    GpsNoise,
    LinkEffect,
    LinkFault,
    PilotTakesOver,
    Reboot,
    SensorFault,
)
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission, with_faults
from sitl.sensors.range_sensors import Defect
from sitl.sim_link import SimLink
from tests.support.quick import first_of

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
HOLD, ARMED = 4, 128


def parsed(data: bytes) -> list[Any]:
    """All messages; damaged bytes are passed over."""
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    return parser.parse_buffer(data) or []


class Run:
    """One drive of a mission with its forward lidar and a plan; a ground station listens on a link of its own."""

    def __init__(
        self, plan: FaultPlan, *, limit_s: float = 200.0, seed: int = 0, name: str = "one-obstacle.toml"
    ) -> None:
        mission = load_mission(MISSIONS / name)
        assert mission.sitl is not None
        mission = replace(mission, sitl=replace(mission.sitl, sensors="lidar-90"))
        scenario = with_faults(scenario_from_mission(mission), plan)
        self.drive = Drive(mission, scenario, Settings(), seed, NullRecorder(), limit_s)
        self._links: list[SimLink] = [self.drive.simulator.connect()]
        self.raw = b""
        self.report = self.drive.run(lambda status: self._listen())
        self._listen()
        self.heard: list[Any] = parsed(self.raw)

    def _listen(self) -> None:
        self.raw += self._links[-1].take()
        if self._links[-1].dropped:
            self._links.append(self.drive.simulator.connect())

    @property
    def reached(self) -> bool:
        return self.report.outcome == "reached"

    def texts(self) -> list[str]:
        """Of the autopilot, and what the companion told the people."""
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"] + self.report.said

    def last_beat(self) -> Any:
        return [m for m in self.heard if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1][-1]


def on_companion(what: Any, probability: float = 1.0, start_s: float = 45.0, **more: Any) -> LinkFault:
    """A fault of the companion's link alone."""
    return LinkFault(start_s, effect=LinkEffect(what), probability=probability, links=(1,), **more)


# GPS lost for long, sensors, wheels and battery come with the shipped plans below.
OVERCOME: dict[str, tuple[Fault, ...]] = {
    "lost and damaged": (on_companion("loss", 0.1), on_companion("corrupt", 0.05)),
    "late": (on_companion("delay", delay_s=0.15, jitter_s=0.1),),
    "out of order and twice": (on_companion("reorder", 0.3, delay_s=0.2), on_companion("duplicate", 0.5)),
    "outages": (
        on_companion("outage", start_s=55.0, end_s=57.0),
        on_companion("outage", start_s=70.0, end_s=73.0, direction="to_vehicle"),
    ),
    "pilot": (PilotTakesOver(55.0, 60.0, mode="HOLD"), PilotTakesOver(70.0, 72.0, mode="MANUAL", throttle=0.3)),
    "gps for a moment": (GpsLoss(55.0, 60.0), GpsGlitch(70.0, 73.0, metres=10.0), GpsNoise(45.0, metres=0.3)),
}


OFTEN_SHOWN = ("out of order and twice", "outages", "lost and damaged", "late", "pilot", "gps for a moment")
"""Like what the shipped plans below do, and tests of a pilot; make test-all drives them too."""
TOLD_ELSEWHERE = ("pilot stays", "blind", "gps false", "power")
"""By tests of safety; make test-all drives them here, too."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.thorough if name in OFTEN_SHOWN else ()) for name in OVERCOME]
)
def test_the_target_is_reached_in_spite_of_it(name: str) -> None:
    run = Run(FaultPlan(OVERCOME[name]))
    assert run.report.collisions == 0
    assert run.reached, run.texts()


STOPPED: dict[str, tuple[tuple[Fault, ...], int, str]] = {
    "line cut": ((on_companion("outage", start_s=60.0, end_s=70.0),), ARMED, "HOLD: "),
    "pilot stays": ((PilotTakesOver(60.0, mode="HOLD"),), ARMED, "mode is not GUIDED"),
    "gps gone": ((GpsLoss(60.0),), ARMED, "EKF failsafe"),
    "gps false": ((GpsGlitch(60.0, metres=10.0),), ARMED, "EKF failsafe"),
    "blind": ((SensorFault(60.0, defect=Defect.SILENT),), ARMED, "HOLD: range data ahead silent for over 1 s"),
    "power": ((Reboot(60.0, 63.0),), 0, "HOLD: "),
}


@first_of(
    1, "name", [pytest.param(name, marks=pytest.mark.thorough if name in TOLD_ELSEWHERE else ()) for name in STOPPED]
)
def test_a_rover_that_stops_says_why(name: str) -> None:
    faults, armed, words = STOPPED[name]
    run = Run(FaultPlan(faults), limit_s=85.0)
    assert run.report.collisions == 0
    assert not run.reached
    assert run.drive.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)
    assert run.last_beat().base_mode & ARMED == armed
    assert any(words in text for text in run.texts()), run.texts()


@pytest.mark.thorough
def test_a_low_battery_that_must_stop_the_rover_does() -> None:
    run = Run(FaultPlan((BatteryLow(50.0, volts=10.0),)), limit_s=50.0)
    vehicle = run.drive.simulator._vehicle
    assert vehicle.parameters.set("BATT_FS_LOW_ACT", 2)
    run.drive.time_limit_s = 80.0
    run.drive.run(lambda status: run._listen())
    heard = parsed(run.raw)
    assert [m.custom_mode for m in heard if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1][-1] == HOLD
    assert any(m.get_type() == "STATUSTEXT" and m.text.startswith("Battery 1 is low") for m in heard)
    assert run.report.collisions == 0


@pytest.mark.thorough
def test_same_seed_same_run() -> None:
    plan = load_faults(MISSIONS / "faults" / "gps.toml")
    plan = replace(plan, faults=plan.faults + load_faults(MISSIONS / "faults" / "radio.toml").faults)
    runs = [Run(replace(plan, seed=seed), limit_s=58.0) for seed in (1, 1, 2)]
    digests = [hashlib.sha256(run.raw).hexdigest() for run in runs]
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.thorough
def test_the_plan_of_a_poor_radio_is_driven_from_the_command_line() -> None:
    arguments = ["drive", str(MISSIONS / "one-obstacle.toml"), "--faults", str(MISSIONS / "faults" / "radio.toml")]
    result = CliRunner().invoke(app, [*arguments, "--sensors", "lidar-90"])
    assert result.exit_code == 0, result.output
    assert "outcome: reached" in result.output


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "reached"),
    [
        pytest.param("gps", True, marks=pytest.mark.thorough),
        pytest.param("vehicle", False, marks=pytest.mark.thorough),  # replays below it drive that one too
        ("interrupted", False),
    ],
)
def test_the_shipped_plans_do_no_harm(name: str, reached: bool) -> None:
    run = Run(load_faults(MISSIONS / "faults" / f"{name}.toml"), limit_s=100.0 if name == "interrupted" else 170.0)
    assert run.report.collisions == 0
    assert run.reached == reached
    # The battery that runs low takes the rover back to where it began.
    assert any(text.startswith("Returning: battery low") for text in run.texts()) == (name == "vehicle")
    if name == "vehicle":
        start = run.drive.simulator._start
        truth = run.drive.simulator.truth
        assert math.hypot(truth.north_m - start.north_m, truth.east_m - start.east_m) < 1.0
    assert name != "interrupted" or not run.last_beat().base_mode & ARMED
