"""Parts of frames and scenes."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import shapely

from companion.control.controller import ControlCommand, Purpose
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint
from companion.core.scan import RangeScan
from companion.executive.mission_progress import (
    MissionProgress,
    TargetStatus,
    on_reached,
    on_time,
    on_unreachable,
    parked,
    plan_progress,
)
from companion.mission.bounds import Bound
from companion.mission.mission import OnBlocked
from companion.navigation.field_step import Action
from companion.safety.mode_latch import Control
from companion.safety.reasons import (
    Activity,
    Doubt,
    EndReason,
    LatchReason,
    Parting,
    PowerReason,
    Reason,
    RunPhase,
    WaitReason,
)
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity
from companion.vehicle.events import RoverMode
from companion.vehicle.mode_names import mode_name
from companion.viewer.frame import (
    MAKES_WAY,
    MOST_PATH,
    MOST_RAYS,
    PAUSED,
    SOMEBODY,
    _border,
    _outline,
    _places,
    _setpoint,
    _thinned,
    doing_of,
    mode_of,
    statuses_of,
    told,
)
from tests.companion.executive.test_mission_progress import target


def test_an_outline_is_a_polygon_ahead_and_to_the_right() -> None:
    assert _outline(Footprint.rectangle(1.0, 0.6, 0.1)) == [[0.6, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.6, -0.3]]
    round_one = np.array(_outline(Footprint.circle(0.35)))
    assert np.hypot(*round_one.T) == pytest.approx(0.35, abs=0.001) and len(round_one) == 24


def test_a_border_has_each_of_its_rings_as_north_and_east() -> None:
    ring = shapely.box(0.0, 0.0, 10.0, 4.0).difference(shapely.box(1.0, 1.0, 2.0, 2.0))
    outer, inner = _border(Bound("fence", ring, True, 0.0, 0.0))
    assert outer["name"] == "fence" and outer["keeps_in"] is True
    assert {tuple(corner) for corner in outer["corners"]} == {(0.0, 0.0), (0.0, 10.0), (4.0, 10.0), (4.0, 0.0)}
    assert {tuple(corner) for corner in inner["corners"]} == {(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (2.0, 1.0)}


def test_a_long_path_is_thinned_and_keeps_its_ends() -> None:
    points = np.column_stack((np.arange(1000.0), np.zeros(1000)))
    thinned = _places(points, MOST_PATH)
    assert len(thinned) == MOST_PATH and thinned[0] == [0.0, 0.0] and thinned[-1] == [999.0, 0.0]


def test_rays_say_what_was_seen_nothing_and_not_known() -> None:
    bearings = np.radians(np.arange(-45.0, 46.0, 45.0))
    told = _thinned(RangeScan(0.0, bearings, np.array([2.0, np.inf, np.nan]), 0.1, 8.0, 0.1, "lidar"))
    assert told["m"] == [2.0, 8.0, None] and told["max_m"] == 8.0
    assert (told["from"], told["step"]) == (pytest.approx(-math.pi / 4, abs=1e-3), pytest.approx(math.pi / 4, abs=1e-3))
    many = RangeScan(0.0, np.linspace(-1.0, 1.0, 720), np.full(720, 3.0), 0.1, 8.0, 0.1, "lidar")
    assert len(_thinned(many)["m"]) <= MOST_RAYS


@pytest.mark.parametrize(
    ("setpoint", "told"),
    [
        (GuidedPosition(NedPoint(1.0, 2.0)), {"kind": "position", "place": [1.0, 2.0]}),
        (GuidedVelocity(0.5, -0.2), {"kind": "velocity", "speed": 0.5, "turn": -0.2}),
        (GuidedVelocity(0.0, 0.0), {"kind": "stop"}),
        (GuidedHeading(1.2), {"kind": "heading", "heading": 1.2}),
    ],
)
def test_each_kind_of_setpoint_is_told(setpoint: object, told: dict) -> None:
    assert _setpoint(ControlCommand(Purpose.DRIVE, setpoint, 1.0)) == told and _setpoint(None) is None


DRIVING = Activity(RunPhase.DRIVING)
NOT_OURS = Reason(LatchReason.OTHER_MODE, ("GUIDED",))
HELD = Activity(RunPhase.STOPPED_AND_WAITING, NOT_OURS, Reason(WaitReason.PERSON_SETS_MODE, ("X",)))
BLIND = Reason(WaitReason.GOOD_DATA_AND, (Reason(Doubt.DATA_OLD, ("range data", 1.0)), HELD.awaited))
BLINDED = Activity(RunPhase.STOPPED_AND_WAITING, NOT_OURS, BLIND)
WAITING = Activity(RunPhase.WAITING, awaited=Reason(WaitReason.ARMING))
DOUBTED = Activity(RunPhase.STOPPED, Reason(Doubt.POSITION_WANDERS))
DONE, BY_USER, BY_SIGNAL, NOBODY = (
    Activity(RunPhase.ENDED, Reason(kind))
    for kind in (EndReason.DONE, EndReason.STOPPED_BY_USER, EndReason.TERMINATED, EndReason.NOBODY_HERE)
)
LOW = Reason(PowerReason.LOW, ("battery",))
STILL_ARMED = Reason(Parting.ARMED, ("HOLD",))
ROLLS, PILOT = {"forward_m_s": 1.0}, {"mode": RoverMode.MANUAL}
RESTARTED = replace(BLINDED, reason=Reason(LatchReason.RESTARTED))
TAKEN = {"taken_over": True}
SHED = {"shed": TargetStatus.UNREACHABLE}
SILENT = {"held_for": Reason(Doubt.DATA_OLD, ("autopilot", 24))}
HELD_FOR = "it had stopped: autopilot silent for over 24 s (the companion asked for HOLD)"


@pytest.mark.parametrize(
    ("activity", "given", "line", "why"),
    [
        (DRIVING, {}, "driving to gate", ""),
        (DRIVING, {"action": Action.BACKTRACK}, "going back to find another way to gate", ""),
        (DRIVING, {"makes_way": True}, "driving to gate", "making way for something that moves"),
        (DRIVING, {"tries_again": True}, "driving to gate", "trying again: the way was blocked"),
        (DRIVING, {"broken_off": LOW}, "driving to gate", "battery low for the autopilot"),
        (DRIVING, {"broken_off": LOW, "makes_way": True}, "driving to gate", f"{LOW}; {MAKES_WAY}"),
        (DRIVING, {"rerouted": "a better path"}, "driving to gate", "a better path"),
        (DRIVING, {"broken_off": LOW, "held_up": "stuck"}, "stuck", "battery low for the autopilot"),
        (WAITING, {}, "waiting for arming", "asked for; the autopilot says if it refuses"),
        (
            WAITING,
            {"start_paused": True},
            "waiting for arming",
            f"asked for; the autopilot says if it refuses; {PAUSED}",
        ),
        (HELD, {}, "stopped: mode is not GUIDED", "waiting for a person to set X"),
        (BLINDED, {}, "stopped: range data silent for over 1 s", "waiting for good data and a person to set X"),
        (RESTARTED, {}, "stopped: autopilot restarted, rover disarmed", f"waiting for {BLIND}"),
        (HELD, TAKEN, f"stopped: HOLD was set by {SOMEBODY}", "waiting for a person to set X"),
        (HELD, SILENT, "stopped: mode is not GUIDED", f"{HELD_FOR}; waiting for a person to set X"),
        (HELD, {**PILOT, **TAKEN}, "the pilot drives (MANUAL)", "waiting for a person to set X"),
        (HELD, PILOT, "the pilot drives (MANUAL)", "waiting for a person to set X"),
        (DOUBTED, {}, "stopped: position wanders", ""),
        (DOUBTED, ROLLS, "stopping: position wanders", ""),
        (DONE, {}, "done", ""),
        (DONE, {"parting": STILL_ARMED}, "done", "the rover was left armed, in HOLD"),
        (
            BY_USER,
            {"shed": TargetStatus.PENDING, "parting": STILL_ARMED},
            "stopped by the user: 1 of 2 targets reached",
            "shed: not reached; the rover was left armed, in HOLD",
        ),
        (DONE, SHED, "ended: 1 of 2 targets reached", "shed: unreachable"),
        (
            DONE,
            {**SHED, "broken_off": LOW},
            "ended early, battery low for the autopilot: 1 of 2 targets reached",
            "shed: unreachable",
        ),
        (
            NOBODY,
            {**SILENT, "before": HELD, "shed": TargetStatus.PENDING, "parting": STILL_ARMED},
            "ended, nobody is here: 1 of 2 targets reached",
            f"it waited for a person to set X; {HELD_FOR}; shed: not reached; the rover was left armed, in HOLD",
        ),
        (
            NOBODY,
            {**TAKEN, "before": HELD},
            "ended, nobody is here",
            f"it waited for a person to set X; it had stopped: HOLD was set by {SOMEBODY}",
        ),
        (
            NOBODY,
            {**SILENT, "before": RESTARTED},
            "ended, nobody is here",
            f"it waited for {BLIND}; it had stopped: autopilot restarted, rover disarmed",
        ),
        (NOBODY, {"before": WAITING}, "ended, nobody is here", f"it waited for {WAITING.awaited}"),
        (BY_USER, {"shed": TargetStatus.PENDING}, "stopped by the user: 1 of 2 targets reached", "shed: not reached"),
        (
            BY_SIGNAL,
            {"shed": TargetStatus.PENDING},
            "told to end by a signal: 1 of 2 targets reached",
            "shed: not reached",
        ),
    ],
)
def test_the_line_says_what_the_rover_does_and_why_it_stands(
    activity: Activity, given: dict[str, Any], line: str, why: str
) -> None:
    heartbeat = SimpleNamespace(mode=given.get("mode", RoverMode.HOLD), armed=given.get("armed", True))
    vehicle = SimpleNamespace(
        heartbeat=heartbeat, is_ours=False, forward_m_s=given.get("forward_m_s", 0.0),
    )  # fmt: skip
    run = SimpleNamespace(
        stop=SimpleNamespace(reason=activity.reason), latch=SimpleNamespace(control=Control.PERSON),
        taken_over=given.get("taken_over", False), held_for=given.get("held_for"),
        under_way=given.get("before"), start_paused=given.get("start_paused", False),
    )  # fmt: skip
    statuses = [("gate", TargetStatus.REACHED), *((name, given[name]) for name in ("shed",) if name in given)]
    companion = SimpleNamespace(
        outcome=SimpleNamespace(broken_off=given.get("broken_off")), mission_run=run, vehicle=vehicle,
        statuses=lambda: statuses, parting=given.get("parting"),
        executor=SimpleNamespace(
            driver=SimpleNamespace(makes_way=given.get("makes_way")),
            progress=SimpleNamespace(tries_again=given.get("tries_again", False)),
        ),
    )  # fmt: skip
    decision = SimpleNamespace(action=given.get("action", Action.FOLLOW))
    status = SimpleNamespace(activity=activity, target="gate", doing=str(activity), decision=decision)
    held_up = given.get("held_up", "")
    headway = SimpleNamespace(doing=lambda _: held_up, rerouted=given.get("rerouted", ""), stands_for_others=False)
    doing = doing_of(cast(Any, companion), cast(Any, status), cast(Any, headway))
    assert (doing["line"], doing["why"]) == (line, why)


def test_one_that_stands_to_make_way_is_shown_as_waiting() -> None:
    companion = SimpleNamespace(
        outcome=SimpleNamespace(broken_off=None), mission_run=SimpleNamespace(stop=None), executor=None
    )
    status = SimpleNamespace(activity=DRIVING, target="gate", doing="driving", decision=None)
    for stands, state in ((True, "waiting"), (False, "driving")):
        headway = SimpleNamespace(doing=lambda _: MAKES_WAY, rerouted="", stands_for_others=stands)
        doing = doing_of(cast(Any, companion), cast(Any, status), cast(Any, headway))
        assert (doing["line"], doing["state"]) == (MAKES_WAY, state)


TO_B = plan_progress((target("a", OnBlocked.WAIT, 30.0), target("b")), target("start"))
AT_A = on_reached(TO_B, 100.0)
BLOCKED = on_unreachable(TO_B, 100.0, 5.0, 600.0)
SHORTLY = replace(AT_A, index=1, statuses=(TargetStatus.REACHED,) * 2, until_s=math.inf)
LATER = replace(BLOCKED, until_s=165.0)


@pytest.mark.parametrize(
    ("phase", "progress", "line", "why"),
    [
        (RunPhase.STAYING, AT_A, "staying at a", "for 20 s more; next: b"),
        (RunPhase.STAYING, replace(AT_A, until_s=90.0), "staying at a", "next: b"),
        (RunPhase.STAYING, SHORTLY, "staying at b", "it is the last target"),
        (RunPhase.STAYING, TO_B, "staying here for the mission's commands", "next: a"),
        (RunPhase.STAYING, parked(TO_B), "staying where it is", ""),
        (
            RunPhase.WAY_BLOCKED,
            BLOCKED,
            "waiting for the way to a to clear",
            "blocked for 10 s, tries again in 0 s, gives up in 10 min",
        ),
        (
            RunPhase.WAY_BLOCKED,
            replace(LATER, give_up_s=None),
            "waiting for the way to a to clear",
            "tries again in 55 s",
        ),
    ],
)
def test_one_that_waits_says_where_for_how_long_and_what_comes_then(
    phase: RunPhase, progress: MissionProgress, line: str, why: str
) -> None:
    since_s = None if progress.give_up_s is None else progress.give_up_s - 600.0
    executor = SimpleNamespace(progress=progress, phase=phase, blocked_since_s=since_s)
    companion = SimpleNamespace(executor=executor, mission_run=SimpleNamespace(stop=None))
    status = SimpleNamespace(activity=Activity(phase), target="a", doing="", time_s=110.0)
    doing = doing_of(cast(Any, companion), cast(Any, status))
    assert (doing["line"], doing["why"], doing["state"]) == (line, why, "waiting")


def test_a_target_that_is_tried_again_is_no_failure_until_the_run_has_ended() -> None:
    tried, given_up = on_time(BLOCKED, 105.0), on_unreachable(on_time(BLOCKED, 105.0), 700.0, 5.0, 600.0)
    shown = [
        statuses_of(cast(Any, SimpleNamespace(
            statuses=lambda progress=progress: [("", status) for status in progress.statuses],
            executor=SimpleNamespace(progress=progress), end=end,
        )))[0]
        for progress, end in ((BLOCKED, None), (tried, None), (given_up, None), (BLOCKED, DONE.reason))
    ]  # fmt: skip
    assert shown == ["waiting", "pending", "unreachable", "unreachable"]


def test_a_rover_that_was_given_up_in_doubt_is_driven_by_nobody() -> None:
    """It is still in GUIDED: HOLD was asked for, and no heartbeat has shown it."""
    vehicle = SimpleNamespace(heartbeat=SimpleNamespace(mode=RoverMode.GUIDED, armed=True), is_ours=True)
    for control, driver in ((Control.PERSON, "nobody"), (Control.COMPANION, "companion")):
        run = SimpleNamespace(latch=SimpleNamespace(control=control))
        assert mode_of(cast(Any, vehicle), cast(Any, run))["drives"] == driver


@pytest.mark.parametrize(("mode", "name"), [(15, "GUIDED"), (16, "INITIALISING"), (99, "mode 99"), (None, None)])
def test_a_mode_is_told_by_its_name(mode: int | None, name: str | None) -> None:
    vehicle = SimpleNamespace(heartbeat=None if mode is None else SimpleNamespace(mode=mode))
    assert mode_name(cast(Any, vehicle)) == name


def test_the_name_of_the_autopilot_is_said_once() -> None:
    assert told(1.0, "info", "autopilot: Throttle armed", own=False)["text"] == "Throttle armed"
    assert told(1.0, "info", "autopilot: as we say", own=True)["text"] == "autopilot: as we say"
