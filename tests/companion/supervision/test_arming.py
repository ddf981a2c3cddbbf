"""The way to the first metre: what is awaited, and the command that would help."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from companion.checkpoint.resume import PreviousRun
from companion.control.controller import STANDSTILL
from companion.core.severity import Severity
from companion.mission.autopilot_fence import NO_FENCE, AutopilotFence
from companion.mission.mission import MissionError
from companion.safety.mode_latch import Control
from companion.safety.reasons import PowerReason, Reason, WaitReason
from companion.settings import SafetySettings
from companion.supervision.arming import (
    AGAIN_RESUMED_S,
    ASK_AGAIN_S,
    LEFT_S,
    LOOK_AGAIN_S,
    Arming,
    Cleared,
    arming_step,
    overruled,
)
from companion.vehicle.commands import Arm, Command, SetMode
from companion.vehicle.events import AckSeen, EkfStatusSeen, GuardSeen, HeartbeatSeen, RoverMode
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import EKF_GOOD, GUIDED, HOLD, MANUAL, PLACE, vehicle
from tests.support.desk import Desk
from tests.support.states import a_state

AT = (PLACE.lat_deg, PLACE.lon_deg)
SETTINGS = SafetySettings()
AUTO = replace(vehicle(mode=RoverMode.AUTO), in_auto=True)


@pytest.mark.parametrize(
    ("seen", "arm", "awaited", "command"),
    [
        (VehicleState(), True, WaitReason.HEARTBEAT, None),
        (replace(vehicle(), origin=None), True, WaitReason.ORIGIN_AND_HOME, None),
        (replace(vehicle(), home=None), True, WaitReason.ORIGIN_AND_HOME, None),
        (vehicle(ekf=0), True, WaitReason.GOOD_DATA, None),
        (replace(vehicle(), scan_ahead=None), True, WaitReason.GOOD_DATA, None),
        (vehicle(mode=MANUAL, armed=False), False, WaitReason.GUIDED, SetMode(GUIDED)),
        (vehicle(mode=HOLD, armed=False), False, WaitReason.GUIDED, SetMode(GUIDED)),
        (vehicle(mode=HOLD), False, WaitReason.GUIDED, SetMode(GUIDED)),
        (vehicle(mode=MANUAL), True, WaitReason.PERSON_SETS_GUIDED, None),
        (vehicle(mode=RoverMode.AUTO), True, WaitReason.PERSON_SETS_GUIDED, None),
        (vehicle(armed=False), True, WaitReason.ARMING, Arm()),
        (vehicle(armed=False), False, WaitReason.PERSON_ARMS, None),
        (vehicle(), False, None, None),
        (vehicle(), True, None, None),
        (AUTO, False, None, None),
        (replace(AUTO, heartbeat=vehicle(mode=HOLD).heartbeat), False, WaitReason.PERSON_STARTS_AUTO, None),
    ],
)
def test_the_way_to_the_first_metre(
    seen: VehicleState, arm: bool, awaited: WaitReason | None, command: Command | None
) -> None:
    step = arming_step(seen, 10.0, SETTINGS, arm=arm)
    assert (None if step.awaited is None else step.awaited.kind) is awaited
    assert step.command == command


@pytest.mark.parametrize("mode", [MANUAL, HOLD])
@pytest.mark.parametrize("armed", [True, False])
def test_a_rover_that_a_person_took_out_of_guided_is_not_put_back(mode: int, armed: bool) -> None:
    step = arming_step(vehicle(mode=mode, armed=armed), 10.0, SETTINGS, arm=True, control=Control.PERSON)
    driven = armed and mode == MANUAL
    kind = WaitReason.PERSON_SETS_GUIDED if driven else WaitReason.PERSON_SETS_GUIDED_AGAIN
    assert step.command is None and step.awaited == Reason(kind)


def test_a_hindrance_keeps_it_from_guided() -> None:
    battery = Reason(WaitReason.CHARGED_BATTERY, ("battery at 12 %",))
    step = arming_step(vehicle(mode=HOLD), 10.0, SETTINGS, arm=True, hindrance=battery)
    assert (step.awaited, step.command) == (battery, None)


@pytest.mark.parametrize(
    ("ack", "heartbeat", "taken"),
    [
        (None, HeartbeatSeen(20.0, HOLD, False, 1), False),
        (AckSeen(10.0, 176, 4), HeartbeatSeen(20.0, HOLD, False, 1), False),
        (AckSeen(10.0, 176, 0), None, False),
        (AckSeen(10.0, 176, 0), HeartbeatSeen(10.5, HOLD, False, 1), False),
        (AckSeen(10.0, 176, 0), HeartbeatSeen(10.6, HOLD, False, 1), True),
        (AckSeen(10.0, 176, 0), HeartbeatSeen(10.6, GUIDED, False, 1), False),
    ],
)
def test_another_mode_after_ours_was_taken_is_a_persons(
    ack: AckSeen | None, heartbeat: HeartbeatSeen | None, taken: bool
) -> None:
    assert overruled(ack, heartbeat) is taken


# The class ------------------------------------------------------------------------------------------------------------


@dataclass
class Limits:
    """Stands in for the limits of a mission."""

    fence: AutopilotFence = NO_FENCE
    hindrance: Reason[WaitReason] | None = None
    empty: Reason[PowerReason] | None = None
    left_driving: bool | None = None

    def awaited(self, now_s: float, *, left_driving: bool) -> Reason[WaitReason] | None:
        self.left_driving = left_driving
        return self.hindrance

    def must_stop(self, now_s: float) -> Reason[PowerReason] | None:
        return self.empty


class Armed(Desk):
    """An arming, and the vehicle that it brings to the first metre."""

    def __init__(self, folder: Path, *, arm: bool = True, previous: PreviousRun | None = None) -> None:
        super().__init__(folder)
        self.limits = Limits()
        link: Any = self.autopilot
        limits: Any = self.limits
        notifier: Any = self.notices
        self.arming = Arming(self.run, link, limits, self.settings, notifier, arm=arm, previous=previous)
        self.cleared: Cleared | None = None
        self.place = (0.0, 0.0)

    def step(self, mode: int = GUIDED, *, armed: bool = True, after_s: float = 1.0) -> WaitReason | None:
        """What is awaited, with a vehicle that is heard so, some seconds later."""
        self.clock.time_s += after_s
        self.stand(*self.place, mode=mode, armed=armed)
        self.run.vehicle = replace(self.run.vehicle, ekf=EkfStatusSeen(self.now_s, EKF_GOOD))
        self.cleared = self.arming.step(self.now_s)
        awaited = self.run.activity.awaited
        return None if awaited is None or self.cleared is not None else awaited.kind


def left(control: Control = Control.COMPANION, **changes: Any) -> PreviousRun:
    """An interrupted run that had the rover under way."""
    same = {"boot_s": 5.0, "ahead_s": 0.0, "origin": AT, "home": AT}
    return PreviousRun(a_state(control=control, **{**same, **changes}), {})


def test_commands_are_given_until_the_rover_may_be_driven_and_not_in_a_hurry(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    assert start.step(MANUAL, armed=False) is WaitReason.GUIDED
    assert start.step(MANUAL, armed=False, after_s=ASK_AGAIN_S) is WaitReason.GUIDED
    assert start.autopilot.taken() == [SetMode(GUIDED)]
    assert start.step(MANUAL, armed=False, after_s=0.1) is WaitReason.GUIDED
    assert start.autopilot.taken() == [SetMode(GUIDED)]
    assert start.step(armed=False) is WaitReason.ARMING and start.autopilot.taken() == []
    assert start.step(armed=False, after_s=ASK_AGAIN_S) is WaitReason.ARMING and start.autopilot.taken() == [Arm()]
    assert start.step() is None and start.autopilot.taken() == []
    assert start.cleared is not None and start.cleared.found == ""
    assert start.cleared.progress.goal.name == "gate" and start.cleared.layout.home == PLACE


def test_nothing_is_done_beside_another_companion_with_our_id(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.autopilot.twin = True
    assert start.step(MANUAL, armed=False) is WaitReason.OTHER_COMPANION_SILENT and start.autopilot.taken() == []


def test_what_else_is_awaited_keeps_it_from_guided(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.limits.hindrance = Reason(WaitReason.OTHER_COMPANION_SIGNS)
    assert start.step(HOLD, armed=False) is WaitReason.OTHER_COMPANION_SIGNS and start.autopilot.taken() == []
    assert start.limits.left_driving is False
    start.limits.hindrance, start.run.start_paused = None, True
    assert start.step(HOLD, armed=False) is WaitReason.REQUEST_TO_BEGIN and start.autopilot.taken() == []
    start.run.start_paused = False
    assert start.step(HOLD, armed=False) is WaitReason.GUIDED


def test_where_the_autopilot_is_listened_for_is_said(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.run.vehicle = VehicleState()
    assert start.arming.step(10.0) is None
    assert start.run.activity.awaited == Reason(WaitReason.HEARTBEAT, (start.autopilot.trouble,))


def test_an_autopilot_that_refuses_to_arm_is_told_once(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.autopilot.ack = AckSeen(10.0, 400, 4)
    assert start.step(HOLD, armed=False) is WaitReason.GUIDED and start.notices.told == []
    for _ in range(2):
        assert start.step(armed=False) is WaitReason.ARMING
    assert start.notices.told == [("The autopilot refuses to arm (failed): its own texts say why", Severity.WARNING)]


@pytest.mark.parametrize(("mode", "armed"), [(HOLD, False), (HOLD, True), (MANUAL, False)])
def test_a_person_who_takes_the_rover_out_of_guided_keeps_it_until_guided_is_set(
    tmp_path: Path, mode: int, armed: bool
) -> None:
    start = Armed(tmp_path)
    assert start.step(armed=False) is WaitReason.ARMING and start.autopilot.taken() == [Arm()]
    for _ in range(5):
        assert start.step(mode, armed=armed) is WaitReason.PERSON_SETS_GUIDED_AGAIN
    assert start.autopilot.taken() == []
    assert start.step(armed=False) in (WaitReason.ARMING, WaitReason.PERSON_ARMS)


def test_a_person_who_has_driven_it_keeps_it_after_disarming(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    assert start.step(MANUAL) is WaitReason.PERSON_SETS_GUIDED
    assert start.step(HOLD, armed=False) is WaitReason.PERSON_SETS_GUIDED_AGAIN and start.autopilot.taken() == []


def test_a_mode_that_was_taken_and_is_another_now_is_a_persons(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    assert start.step(MANUAL, armed=False) is WaitReason.GUIDED
    start.autopilot.ack = AckSeen(start.now_s, 176, 0)
    assert start.step(HOLD, armed=False) is WaitReason.PERSON_SETS_GUIDED_AGAIN


def test_a_rover_that_a_person_disarms_is_not_armed_again(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.limits.hindrance = Reason(WaitReason.OTHER_COMPANION_SIGNS)
    start.step(HOLD, armed=True)
    start.limits.hindrance = None
    assert start.step(armed=False, after_s=10.0) is WaitReason.PERSON_ARMS and start.autopilot.taken() == []


def test_a_target_behind_the_fence_is_refused_before_anybody_arms(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.limits.fence = AutopilotFence(circle_m=8.0, home=PLACE)
    with pytest.raises(MissionError, match=r"yard\.toml: .*gate"):
        start.step(HOLD, armed=False)
    assert start.autopilot.taken() == []


def test_a_fence_that_changes_while_it_waits_is_looked_at_again(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.limits.fence = AutopilotFence(circle_m=30.0, home=PLACE)
    assert start.step(HOLD, armed=False) is WaitReason.GUIDED
    start.limits.fence = AutopilotFence(circle_m=8.0, home=PLACE)
    with pytest.raises(MissionError, match="gate"):
        start.step(HOLD, armed=False)


def test_a_rover_too_near_a_border_or_beside_the_grid_is_not_driven(tmp_path: Path) -> None:
    start = Armed(tmp_path)
    start.limits.fence = AutopilotFence(circle_m=20.0, home=PLACE)
    start.place = (-19.9, 0.0)
    assert start.step(HOLD, armed=False) is WaitReason.ROOM_TO_BORDER and start.autopilot.taken() == []
    start.limits.fence = NO_FENCE
    start.place = (-100.0, 0.0)
    assert start.step() is WaitReason.ON_THE_GRID
    start.place = (0.0, 0.0)
    assert start.step(after_s=LOOK_AGAIN_S - 0.1) is WaitReason.ON_THE_GRID, "not looked at yet"
    assert start.step(after_s=0.1) is None and start.cleared is not None


# A run that is taken up -----------------------------------------------------------------------------------------------


def test_a_rover_that_was_left_driving_is_stopped_and_driven_on_where_it_is(tmp_path: Path) -> None:
    start = Armed(tmp_path, previous=left())
    start.limits.hindrance = Reason(WaitReason.FENCE, ("",))
    assert start.step() is WaitReason.FENCE and start.limits.left_driving is True
    assert start.autopilot.taken() == [STANDSTILL.setpoint]
    start.limits.hindrance = None
    assert start.step() is None and start.cleared is not None
    assert start.cleared.found == "without its map (the settings of the map have changed)"


def test_a_rover_that_was_left_driving_and_cannot_be_taken_up_ends_in_hold(tmp_path: Path) -> None:
    start = Armed(tmp_path, previous=left())
    start.limits.hindrance = Reason(WaitReason.FENCE, ("",))
    start.step()
    start.step(after_s=LEFT_S - 0.1)
    assert start.autopilot.taken() == 2 * [STANDSTILL.setpoint] and start.notices.told == []
    start.step(after_s=0.1)
    assert start.autopilot.taken() == [SetMode(HOLD)]
    why = "HOLD: waited too long for the autopilot's fence and rally points"
    assert start.notices.told == [(why, Severity.WARNING)]
    start.limits.hindrance = None
    assert start.step(HOLD) is WaitReason.PERSON_SETS_GUIDED_AGAIN and start.autopilot.taken() == []


def test_the_sticks_of_a_rover_that_was_left_driving_are_a_hold_at_once(tmp_path: Path) -> None:
    start = Armed(tmp_path, previous=left())
    start.limits.hindrance = Reason(WaitReason.FENCE, ("",))
    start.run.vehicle = replace(start.run.vehicle, sticks=Sticks((1500, 1500), 9))
    start.step()
    assert start.autopilot.taken() == [SetMode(HOLD)] and start.notices.texts == ["HOLD: the sticks were moved"]


@pytest.mark.parametrize("place", [(0.0, 0.0), (-100.0, 0.0)])
def test_one_that_stands_beside_the_grid_is_told_to_stand(tmp_path: Path, place: tuple[float, float]) -> None:
    start = Armed(tmp_path, previous=left())
    start.place = place
    beside = place != (0.0, 0.0)
    assert start.step() is (WaitReason.ON_THE_GRID if beside else None)
    assert start.autopilot.taken() == ([STANDSTILL.setpoint] if beside else [])


def test_an_empty_battery_ends_only_a_rover_that_was_left_driving(tmp_path: Path) -> None:
    empty = Reason(PowerReason.CRITICAL, ("battery",))
    for previous, mode, twin, ends in (
        (None, GUIDED, False, False),
        (left(), GUIDED, False, True),
        (left(), HOLD, False, False),
        (left(), GUIDED, True, False),
        (left(Control.PERSON), GUIDED, False, False),
    ):
        start = Armed(tmp_path, previous=previous)
        start.limits.empty, start.autopilot.twin = empty, twin
        start.step(mode)
        assert start.arming.must_end(start.now_s) == (empty if ends else None)


def test_a_run_that_a_person_had_waits_for_guided(tmp_path: Path) -> None:
    start = Armed(tmp_path, previous=left(Control.PERSON))
    assert start.step(HOLD, armed=False) is WaitReason.PERSON_SETS_GUIDED_AGAIN and start.autopilot.taken() == []
    assert start.step(armed=False) is WaitReason.PERSON_ARMS, "it was disarmed by somebody"


def test_a_run_that_is_taken_up_gives_another_command_at_once_and_the_same_again_soon(tmp_path: Path) -> None:
    """After a restart of the autopilot: GUIDED, and arming without waiting."""
    start = Armed(tmp_path, previous=left(boot_s=1000.0))
    assert start.step(HOLD, armed=False) is WaitReason.GUIDED and start.autopilot.taken() == [SetMode(GUIDED)]
    assert start.step(armed=False, after_s=0.05) is WaitReason.ARMING and start.autopilot.taken() == [Arm()]
    start.step(armed=False, after_s=AGAIN_RESUMED_S - 0.05)
    assert start.autopilot.taken() == []
    start.step(armed=False, after_s=0.1)
    assert start.autopilot.taken() == [Arm()]


@pytest.mark.parametrize(("mode", "armed"), [(HOLD, True), (HOLD, False), (MANUAL, True)])
def test_a_run_that_had_stopped_the_rover_goes_on_only_if_all_is_as_it_was(
    tmp_path: Path, mode: int, armed: bool
) -> None:
    start = Armed(tmp_path, previous=left(released=True, armed=True))
    same, driven = (mode, armed) == (HOLD, True), mode == MANUAL
    persons = WaitReason.PERSON_SETS_GUIDED if driven else WaitReason.PERSON_SETS_GUIDED_AGAIN
    assert start.step(mode, armed=armed) is (WaitReason.GUIDED if same else persons)
    assert start.autopilot.taken() == ([SetMode(GUIDED)] if same else [])


@pytest.mark.parametrize(("acted", "then"), [(True, WaitReason.GUIDED), (False, WaitReason.PERSON_SETS_GUIDED_AGAIN)])
def test_in_hold_the_guard_is_heard_before_a_person_is_waited_for(
    tmp_path: Path, acted: bool, then: WaitReason
) -> None:
    start = Armed(tmp_path, previous=left(guarded=True))
    assert start.step(HOLD) is WaitReason.GUARD_TELLS and start.autopilot.taken() == []
    start.run.vehicle = replace(start.run.vehicle, guard=GuardSeen(start.now_s, 0.3, acted))
    assert start.step(HOLD) is then


def test_whoever_sets_another_mode_meanwhile_has_the_rover(tmp_path: Path) -> None:
    start = Armed(tmp_path, previous=left(guarded=True))
    assert start.step(HOLD) is WaitReason.GUARD_TELLS
    assert start.step(MANUAL) is WaitReason.PERSON_SETS_GUIDED
    assert start.step(HOLD) is WaitReason.PERSON_SETS_GUIDED_AGAIN and start.autopilot.taken() == []


def test_a_fence_that_has_closed_meanwhile_does_not_keep_a_run_from_being_taken_up(tmp_path: Path) -> None:
    start = Armed(tmp_path, previous=left())
    start.limits.fence = AutopilotFence(circle_m=8.0, home=PLACE)
    assert start.step() is None and start.cleared is not None and start.cleared.layout.refused
