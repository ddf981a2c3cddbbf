"""A ground station changes settings while the rover drives; through the simulated autopilot's router, in lock-step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.safety.reasons import Doubt
from companion.settings.tunable_parameters import TABLE
from tests.support.rig import Rig, yard
from tests.support.served import mission_path

LIST_S = 1.5


def values(rig: Rig, since_s: float) -> dict[str, float]:
    return {s.message.param_id: s.message.param_value for s in rig.sent_since(since_s) if s.kind == "PARAM_VALUE"}


def ask_list(rig: Rig, component: int) -> dict[str, float]:
    since_s = rig.now_s()
    rig.station(mavlink.MAVLink_param_request_list_message(1, component))
    rig.run_for(LIST_S)
    return values(rig, since_s)


def put(rig: Rig, name: str, value: float, component: int = 191) -> dict[str, float]:
    since_s = rig.now_s()
    rig.station(mavlink.MAVLink_param_set_message(1, component, name.encode(), value, 9))
    rig.run_for(0.5)
    return values(rig, since_s)


def speeds(rig: Rig, since_s: float) -> list[float]:
    return [s.message.param2 for s in rig.sent_since(since_s) if s.command == 178]


def test_settings_are_listed_and_changed_on_the_way(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=45.0)
    rig.run_for(1.0)
    assert ask_list(rig, 1) == {}  # the autopilot's alone
    for component in (0, 191):
        assert list(ask_list(rig, component)) == [parameter.name for parameter in TABLE]

    rig.until_driven(1.0)
    assert max(speeds(rig, 0.0)) > 1.0
    assert put(rig, "CMP_SPD_MAX", 0.6) == {"CMP_SPD_MAX": 0.6000000238418579}
    assert put(rig, "CMP_SPD_MAX", 60.0) == {"CMP_SPD_MAX": 0.6000000238418579}
    assert "CMP_SPD_MAX stays 0.6: 60 not in 0.1..20" in rig.texts()
    goal, since_s = rig.companion.status().target, rig.now_s()
    rig.run_for(3.0)
    assert rig.speed_m_s < 0.75
    assert speeds(rig, since_s) and max(speeds(rig, since_s)) < 0.601
    assert rig.companion.status().target == goal and rig.texts().count(f"Heading for {goal}") == 1
    rig.finish()
    assert rig.companion.outcome.complete


def test_a_change_counts_wherever_settings_are_read(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=45.0)
    rig.until_driven(0.5)
    put(rig, "CMP_SPD_MAX", 1.5)
    executor = rig.companion.executor
    assert executor is not None
    view = executor.view(rig.companion.vehicle, rig.now_s())
    assert view.settings.guidance.max_speed_m_s == 1.5
    put(rig, "CMP_JUMP", 8.0)
    rig.change = Shifted(3.0)
    rig.run_for(1.0)
    assert not rig.gave(Doubt.POSITION_JUMPED), "3 m is no jump any more"


class Shifted:
    """The position lies somewhere else from now on."""

    def __init__(self, by_m: float) -> None:
        self._by_m = by_m

    def __call__(self, message: Any) -> Any:
        if message.get_type() == "LOCAL_POSITION_NED":
            message.y += self._by_m
        return message


def test_a_watchdog_that_was_shortened_acts_sooner(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=45.0)
    rig.until_driven(0.5)
    put(rig, "CMP_HOLD_AFTER", 0.5)
    rig.change = lambda message: None if message.get_type() == "LOCAL_POSITION_NED" else message
    lost_s = rig.now_s()
    rig.until(lambda: any(s.command == 176 and s.message.param2 == 4 for s in rig.sent_since(lost_s)), 5.0)
    assert rig.now_s() - lost_s < 2.0  # a second until stale, half a second until HOLD; by default 3 s


def test_a_damaged_file_of_tuned_settings_stops_the_run_before_it_begins(tmp_path: Path) -> None:
    mission = mission_path(yard(tmp_path))
    state = tmp_path / "state"
    state.mkdir()
    (state / "tuned.toml").write_text("[guidance]\nhorizon_m = -3\n")
    answer = CliRunner().invoke(app, ["run", str(mission), "--connect", "udpin:127.0.0.1:0", "--state", str(state)])
    assert answer.exit_code == 2
    assert "tuned.toml: guidance.horizon_m" in answer.output and "delete it" in answer.output


def test_the_figures_come_once_a_second(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=45.0)
    rig.until_driven(1.0)
    since_s = rig.now_s()
    rig.run_for(5.0)
    told = [s.message for s in rig.sent_since(since_s) if s.kind == "NAMED_VALUE_FLOAT"]
    names = [message.name for message in told]
    assert set(names) == {"NAV_PART", "PATH_COST", "SEARCH_MS", "PROGRESS"}
    assert all(4 <= names.count(name) <= 6 for name in names)
    newest = {message.name: message.value for message in told}
    assert newest["NAV_PART"] in (1.0, 2.0, 3.0)
    assert newest["PATH_COST"] > 0.0 and newest["PROGRESS"] == 0.0
    assert newest["SEARCH_MS"] == 0.0  # in lock-step a step takes no time
