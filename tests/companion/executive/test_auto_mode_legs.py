"""When a leg that AUTO hands over is ours: handed over, fallen silent, over."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.control.controller import STANDSTILL, STOP, Purpose
from companion.control.point_controller import ControlCommand
from companion.core.frames import GeoPoint, LocalFrame
from companion.core.severity import Severity
from companion.executive.auto_mode_legs import AutoModeLegs
from companion.executive.mission_progress import MissionPhase, TargetStatus, on_reached
from companion.vehicle.auto_leg import LEG_KEPT_S, GuidedLeg, LegState, leg_after, leg_at_heartbeat
from companion.vehicle.commands import GuidedPosition
from companion.vehicle.events import (
    Event,
    HeartbeatSeen,
    ItemCurrentSeen,
    ItemReachedSeen,
    LegSeen,
    RoverMode,
)
from companion.vehicle.state import VehicleState, fold
from tests.companion.safety.test_mode_latch import PLACE
from tests.support.desk import Desk

HERE, THERE = GeoPoint(53.0, 23.0), GeoPoint(53.1, 23.0)
LIVE = GuidedLeg(HERE, 10.0, 3)


def test_what_is_handed_over_is_live_and_stays_the_same_leg() -> None:
    assert leg_after(None, LegSeen(1.0, HERE)) == GuidedLeg(HERE, 1.0)
    assert leg_after(LIVE, LegSeen(11.0, HERE)) == replace(LIVE, told_s=11.0)
    assert leg_after(replace(LIVE, state=LegState.SILENT), LegSeen(19.0, HERE)) == replace(LIVE, told_s=19.0)


def test_another_place_or_one_after_the_end_is_a_new_leg() -> None:
    assert leg_after(LIVE, LegSeen(11.0, THERE)) == GuidedLeg(THERE, 11.0)
    assert leg_after(replace(LIVE, state=LegState.OVER), LegSeen(11.0, HERE)) == GuidedLeg(HERE, 11.0)


@pytest.mark.parametrize("index", [None, 3])
def test_the_item_that_is_reached_ends_its_leg(index: int | None) -> None:
    leg = leg_after(replace(LIVE, index=index), ItemReachedSeen(11.0, 3))
    assert leg is not None and leg.state is LegState.OVER


@pytest.mark.parametrize(("index", "reached"), [(3, 4), (3, 0), (None, 0)])
def test_another_item_or_a_guided_target_that_is_reached_does_not(index: int | None, reached: int) -> None:
    leg = replace(LIVE, index=index)
    assert leg_after(leg, ItemReachedSeen(11.0, reached)) == leg


def test_the_item_under_way_is_learned_and_another_one_ends_the_leg() -> None:
    leg = leg_after(replace(LIVE, index=None), ItemCurrentSeen(11.0, 5))
    assert leg is not None and leg.index == 5
    assert leg_after(leg, ItemCurrentSeen(12.0, 5)) == leg
    assert leg_after(leg, ItemCurrentSeen(13.0, 6)) == replace(leg, state=LegState.OVER)
    assert leg_after(replace(LIVE, state=LegState.SILENT, index=None), ItemCurrentSeen(13.0, 6)) == replace(
        LIVE, state=LegState.SILENT, index=None
    )


def test_out_of_auto_or_not_repeated_it_is_silent() -> None:
    silent = replace(LIVE, state=LegState.SILENT)
    assert leg_at_heartbeat(LIVE, 10.0 + LEG_KEPT_S, in_auto=True) == LIVE
    assert leg_at_heartbeat(LIVE, 10.1 + LEG_KEPT_S, in_auto=True) == silent
    assert leg_at_heartbeat(LIVE, 10.0, in_auto=False) == silent
    assert leg_at_heartbeat(None, 10.0, in_auto=True) is None


news = st.one_of(
    st.builds(lambda p: lambda t: LegSeen(t, p), st.sampled_from([HERE, THERE])),
    st.builds(lambda i: lambda t: ItemReachedSeen(t, i), st.integers(0, 3)),
    st.builds(lambda i: lambda t: ItemCurrentSeen(t, i), st.integers(0, 3)),
    st.builds(
        lambda m, a: lambda t: HeartbeatSeen(t, m, a, 1),
        st.sampled_from([RoverMode.AUTO, RoverMode.GUIDED, RoverMode.HOLD, RoverMode.MANUAL]),
        st.booleans(),
    ),
)


@given(st.lists(st.tuples(news, st.floats(0.05, 3.0)), max_size=40), st.booleans())
def test_whatever_is_heard_the_rover_is_ours_only_in_our_mode_and_in_auto_only_while_handed_over(
    heard: list[tuple[object, float]], in_auto: bool
) -> None:
    state, time_s, told_s, mode = VehicleState(in_auto=in_auto), 0.0, -1e9, None
    for make, after_s in heard:
        time_s += after_s
        event: Event = make(time_s)  # type: ignore[operator]
        state = fold(state, event)
        told_s = time_s if isinstance(event, LegSeen) else told_s
        mode = event.mode if isinstance(event, HeartbeatSeen) else mode
        if not state.is_ours:
            continue
        assert mode == (RoverMode.AUTO if in_auto else RoverMode.GUIDED)
        if in_auto and isinstance(event, HeartbeatSeen):
            assert time_s - told_s <= LEG_KEPT_S and event.armed
        # The item of a leg that is live has not been told of as done.
        assert not (in_auto and isinstance(event, ItemReachedSeen) and state.leg and event.index == state.leg.index)


# What the executor makes of them --------------------------------------------------------------------------------------


class Served(Desk):
    """AUTO is served: legs are handed over and ended."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.begin()
        self.legs = AutoModeLegs(self.notices)
        self.gate = LocalFrame(PLACE).to_geo(self.executor.progress.targets[0].point)

    def follow(self, leg: GuidedLeg | None) -> bool:
        self.run.vehicle = replace(self.stand(0.0, 0.0, mode=RoverMode.AUTO), in_auto=True, leg=leg)
        return self.legs.follow(self.run.vehicle, self.executor)


def test_outside_auto_no_leg_is_followed(tmp_path: Path) -> None:
    served = Served(tmp_path)
    assert not served.legs.follow(served.run.vehicle, served.executor)
    assert served.executor.progress.phase is MissionPhase.TRAVEL


@pytest.mark.parametrize(
    ("left_m", "status"), [(0.0, TargetStatus.REACHED), (9.0, TargetStatus.SKIPPED)], ids=["near", "far"]
)
def test_a_leg_is_driven_until_auto_ends_it(tmp_path: Path, left_m: float, status: TargetStatus) -> None:
    served = Served(tmp_path)
    assert not served.follow(None) and served.executor.progress.phase is MissionPhase.STAY, "parked"
    live = GuidedLeg(served.gate, 10.0, 3)
    assert not served.follow(live) and served.executor.progress.phase is MissionPhase.TRAVEL
    place = served.executor.progress.goal.point
    served.run.vehicle = replace(
        served.stand(place.north_m - left_m, place.east_m), in_auto=True, leg=replace(live, state=LegState.OVER)
    )
    assert served.legs.follow(served.run.vehicle, served.executor), "the last leg"
    assert served.executor.progress.statuses == (status,)


def test_a_leg_that_was_reached_before_auto_ends_it_stays_reached(tmp_path: Path) -> None:
    served = Served(tmp_path)
    live = GuidedLeg(served.gate, 10.0, 3)
    served.follow(live)
    progress = served.executor.progress
    served.executor.progress = on_reached(progress, 10.0)
    at = served.executor.view(served.run.vehicle, 10.0)
    nearer = served.legs.guide(STANDSTILL, served.executor, at)
    assert nearer.setpoint == GuidedPosition(progress.goal.point) and nearer.speed_m_s == 0.5
    held = replace(at, held_m_s=0.5)
    assert served.legs.guide(STANDSTILL, served.executor, held) == STANDSTILL, "until its throttle is closed"
    braking = ControlCommand(Purpose.BRAKE, STOP, 0.0)
    assert served.legs.guide(braking, served.executor, at) == braking, "it makes way"
    assert served.follow(replace(live, state=LegState.OVER))
    assert served.executor.progress.statuses == (TargetStatus.REACHED,)


def test_a_place_that_is_not_in_the_mission_is_not_driven_to(tmp_path: Path) -> None:
    served = Served(tmp_path)
    elsewhere = GuidedLeg(THERE, 10.0)
    assert not served.follow(elsewhere) and served.executor.progress.phase is MissionPhase.STAY
    assert [severity for _, severity in served.notices.told] == [Severity.WARNING]
    assert not served.follow(replace(elsewhere, state=LegState.OVER))
    assert served.executor.progress.statuses == (TargetStatus.PENDING,)
