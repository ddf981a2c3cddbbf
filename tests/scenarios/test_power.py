"""A battery that runs low: back the way the rover came, or to a rally point; empty: stop and HOLD on the spot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from companion.executive.mission_progress import TargetStatus
from companion.mission.mission import Mission
from companion.safety.reasons import EndReason, PowerReason, WaitReason
from companion.settings import Settings, parse_settings
from tests.support.quick import first_of
from tests.support.rig import ARM, HOLD, SET_MODE, Change, Rig, yard
from tests.support.stored import POLYGONS, box, stored

AFTER_S = 1.0
"""Below a threshold for so long: the yard is small."""
FAR = '[[target]]\nname = "gate"\nfield = [15, 7]\n[[target]]\nname = "pier"\nfield = [20, 12]\n'


def settings(**power: Any) -> Settings:
    return parse_settings({"power": {"after_s": AFTER_S, **power}}, "test")


def battery(percent: int = -1, volts: float = 0.0, state: int = 0, *, since: list[float] | None = None) -> Change:
    """What the vehicle says of its battery; with ``since`` (a list) only after something was put into that."""

    def change(message: Any) -> Any:
        if since is not None and not since:
            return message
        if message.get_type() == "BATTERY_STATUS":
            message.battery_remaining, message.charge_state = percent, state
            message.voltages = [round(volts * 1000.0) or 65535, *[65535] * 9]
        elif message.get_type() == "SYS_STATUS":
            message.battery_remaining, message.voltage_battery = percent, round(volts * 1000.0)
        return message

    return change


class Draining(Rig):
    """A yard whose rover has driven some metres before its battery says what it does; keeps where the rover was."""

    def __init__(
        self, mission: Mission, metres: float, change: dict[str, Any], options: Settings | None = None, **more: Any
    ):
        super().__init__(mission, options or settings(), **more)
        since: list[float] = []
        self.track: list[tuple[float, float]] = []
        self.change = battery(**change, since=since)
        self.until_driven(metres)
        since.append(self.now_s())
        self.began_s = self.now_s()

    def sleep_until_s(self, time_s: float) -> None:
        super().sleep_until_s(time_s)
        if hasattr(self, "track"):
            self.track.append(self.place)

    @property
    def place(self) -> tuple[float, float]:
        """Metres north and east of where it began."""
        truth, start = self.simulator.truth, self.simulator._start
        return truth.north_m - start.north_m, truth.east_m - start.east_m

    @property
    def reason(self) -> PowerReason | None:
        """Why the mission was broken off."""
        reason = self.companion.outcome.broken_off
        return None if reason is None else reason.kind

    def statuses(self) -> list[TargetStatus]:
        return [status for _, status in self.companion.statuses()]


LOW = [{"percent": 19}, {"percent": 19, "volts": 11.0}, {"percent": -1, "volts": 11.0, "state": 2}]


@first_of(1, "change", LOW, ids=["charge", "charge and voltage", "the autopilot's own failsafe"])
def test_a_low_battery_takes_the_rover_back_the_way_it_came(tmp_path: Path, change: dict[str, Any]) -> None:
    rig = Draining(yard(tmp_path, FAR), 9.0, change)
    rig.until(lambda: rig.reason is not None, AFTER_S + 1.5)
    assert rig.now_s() - rig.began_s >= AFTER_S
    there = len(rig.track)
    rig.finish()
    assert math.hypot(*rig.place) < 1.0
    assert rig.mode == HOLD
    assert rig.simulator.collisions == ()
    returning = next(text for text in rig.texts() if text.startswith("Returning: battery "))
    assert returning.endswith(". Missed: gate, pier")
    assert rig.statuses() == [TargetStatus.SKIPPED] * 2
    # Once it had come to stand and turned round, it went where it had been before.
    before = rig.track[: there + 60]
    assert all(min(math.dist(place, past) for past in before[::5]) < 1.0 for place in rig.track[there + 100 :: 20])


@pytest.mark.thorough
def test_what_was_reached_stays_reached(tmp_path: Path) -> None:
    rig = Draining(yard(tmp_path, FAR), 0.5, {"percent": 100})
    rig.until(lambda: rig.has_reached("gate"))
    rig.change = battery(percent=15)
    rig.finish()
    assert rig.statuses() == [TargetStatus.REACHED, TargetStatus.SKIPPED]


def test_a_rally_point_that_is_nearer_is_where_it_goes(tmp_path: Path) -> None:
    rig = Draining(
        yard(tmp_path), 9.0, {"percent": 19}, prepare=stored(rally=[(4.0, 13.0), (5.0, 8.0)], FENCE_ENABLE=0.0)
    )
    rig.finish()
    point = {"rally point 1": (4.0, 13.0), "rally point 2": (5.0, 8.0)}[rig.goals[-1]]
    assert math.dist(rig.place, point) < 1.0
    assert rig.statuses() == [TargetStatus.SKIPPED] and rig.mode == HOLD


@pytest.mark.thorough
@pytest.mark.parametrize(
    "why",
    [
        "behind the fence",
        *(
            pytest.param(why, marks=pytest.mark.thorough)
            for why in ("farther than home", "switched off", "off the ground of the mission")
        ),
    ],
)
def test_a_rally_point_that_will_not_do_is_passed_over(tmp_path: Path, why: str) -> None:
    place = {"farther than home": (0.0, 18.0), "off the ground of the mission": (0.0, 60.0)}.get(why, (5.0, 9.5))
    fence = box(5002, 3.5, 8.0, 7.4, 12.0) if why == "behind the fence" else None
    options = settings(to_rally=why != "switched off")
    metres = 5.0 if why == "farther than home" else 8.0
    prepare = stored(fence, rally=[place], **(POLYGONS if fence else {"FENCE_ENABLE": 0.0}), FENCE_MARGIN=0.0)
    rig = Draining(yard(tmp_path), metres, {"percent": 19}, options, prepare=prepare)
    rig.finish()
    assert rig.goals == ["gate", "start"]
    assert math.hypot(*rig.place) < 1.0


@first_of(1, "change", [{"percent": 9}, {"percent": 50, "volts": 10.0, "state": 3}])
def test_an_empty_battery_stops_it_where_it_is(tmp_path: Path, change: dict[str, Any]) -> None:
    rig = Draining(yard(tmp_path), 6.0, change)
    rig.until(lambda: rig.mode == HOLD, AFTER_S + 3.0)
    assert rig.now_s() - rig.began_s >= AFTER_S
    rig.finish(3.0)
    assert rig.gave(EndReason.BATTERY) and rig.statuses() == [TargetStatus.PENDING]
    assert rig.reason is not None
    rig.sleep_until_s(rig.now_s() + 3.0)
    assert rig.speed_m_s < 0.05


@pytest.mark.thorough
def test_it_empties_on_the_way_back(tmp_path: Path) -> None:
    rig = Draining(yard(tmp_path), 9.0, {"percent": 15})
    rig.until(lambda: rig.reason is PowerReason.CHARGE, 5.0)
    rig.change = battery(percent=5)
    rig.finish()
    assert rig.gave(EndReason.BATTERY) and math.hypot(*rig.place) > 2.0


def test_thresholds_in_volts(tmp_path: Path) -> None:
    rig = Draining(yard(tmp_path), 5.0, {"volts": 11.4}, settings(return_volts=11.5))
    rig.until(lambda: rig.reason is PowerReason.VOLTAGE, AFTER_S + 1.5)
    assert rig.now_s() - rig.began_s >= AFTER_S


@first_of(1, "change", [{"percent": -1, "volts": 0.0}, {"percent": 0, "volts": 0.0}, {"percent": 20}])
def test_what_is_not_known_or_not_low_is_no_reason(tmp_path: Path, change: dict[str, Any]) -> None:
    rig = Draining(yard(tmp_path), 1.0, change)
    rig.finish()
    assert rig.companion.outcome.complete
    assert rig.reason is None


def test_a_voltage_that_sags_for_a_moment_is_no_reason(tmp_path: Path) -> None:
    options = parse_settings({"power": {"return_volts": 11.5, "hold_volts": 11.0}}, "test")
    rig = Draining(yard(tmp_path), 1.0, {"volts": 10.0}, options)
    rig.run_for(options.power.after_s - 1.5)
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete


@pytest.mark.thorough
def test_with_a_low_battery_it_does_not_even_begin(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path))
    rig.change = battery(percent=12)
    rig.run_for(50.0)
    assert rig.awaits(WaitReason.CHARGED_BATTERY)
    assert not any(one.command in (SET_MODE, ARM) for one in rig.sent)
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete, "with another battery it does"


def resumed(rig: Draining, mission: Mission) -> None:
    """Another companion takes the run up; for a moment it cannot begin, so that it hears of the battery first."""
    drained = rig.change
    assert drained is not None
    rig.change = lambda message: None if message.get_type() == "ATTITUDE" else drained(message)
    rig.restart_companion(mission, resume=True)
    rig.run_for(3.0)
    rig.change = drained


@pytest.mark.thorough
@pytest.mark.parametrize("returning", [True, False])
def test_a_run_that_is_taken_up_out_there_with_a_low_battery_goes_back(tmp_path: Path, returning: bool) -> None:
    mission = yard(tmp_path)
    rig = Draining(mission, 9.0, {"percent": 19}, state=tmp_path / "state", late_s=45.0)
    if returning:
        rig.until(lambda: rig.reason is not None, AFTER_S + 1.5)
    resumed(rig, mission)
    rig.until(lambda: rig.reason is PowerReason.CHARGE, AFTER_S + 1.5)
    rig.finish(60.0)
    assert rig.mode == HOLD and math.hypot(*rig.place) < 1.0
    assert rig.simulator.collisions == ()


def test_a_run_that_is_taken_up_out_there_with_an_empty_battery_ends_in_hold(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    rig = Draining(mission, 9.0, {"percent": 9}, state=tmp_path / "state", late_s=45.0)
    resumed(rig, mission)
    assert rig.companion.driver is None, "it could not begin"
    rig.until(lambda: rig.companion.done, 3.0)
    assert rig.gave(EndReason.BATTERY) and rig.mode == HOLD
