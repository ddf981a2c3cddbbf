"""Parts of frames and scenes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import shapely

from companion.control.controller import ControlCommand, Purpose
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint
from companion.core.scan import RangeScan
from companion.mission.bounds import Bound
from companion.navigation.field_step import Part
from companion.safety.reasons import Activity, LatchReason, PowerReason, Reason, RunPhase, WaitReason
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity
from companion.viewer.frame import (
    MOST_PATH,
    MOST_RAYS,
    _border,
    _outline,
    _places,
    _setpoint,
    _thinned,
    doing_of,
    mode_name,
    told,
)


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
HELD = Activity(
    RunPhase.STOPPED_AND_WAITING,
    Reason(LatchReason.OTHER_MODE, ("GUIDED",)),
    Reason(WaitReason.PERSON_SETS_MODE, ("X",)),
)
LOW = Reason(PowerReason.LOW, ("battery",))


@pytest.mark.parametrize(
    ("activity", "part", "broken_off", "line", "why"),
    [
        (DRIVING, Part.EXPLORE, None, "driving to gate", ""),
        (DRIVING, Part.RETURN, None, "driving to gate", "going back to find another way"),
        (DRIVING, Part.RETURN, LOW, "driving to gate", "battery low for the autopilot"),
        (HELD, Part.EXPLORE, None, "stopped: mode is not GUIDED", "waiting for "),
    ],
)
def test_the_line_says_why_the_rover_stands_or_drives_back(
    activity: Activity, part: Part, broken_off: object, line: str, why: str
) -> None:
    companion = SimpleNamespace(outcome=SimpleNamespace(broken_off=broken_off))
    status = SimpleNamespace(activity=activity, target="gate", doing=str(activity), decision=SimpleNamespace(part=part))
    doing = doing_of(cast(Any, companion), cast(Any, status))
    assert doing["line"] == line and doing["why"].startswith(why) and bool(doing["why"]) == bool(why)


@pytest.mark.parametrize(("mode", "name"), [(15, "GUIDED"), (16, "INITIALISING"), (99, "mode 99"), (None, None)])
def test_a_mode_is_told_by_its_name(mode: int | None, name: str | None) -> None:
    vehicle = SimpleNamespace(heartbeat=None if mode is None else SimpleNamespace(mode=mode))
    assert mode_name(cast(Any, vehicle)) == name


def test_the_name_of_the_autopilot_is_said_once() -> None:
    assert told(1.0, "info", "autopilot: Throttle armed", own=False)["text"] == "Throttle armed"
    assert told(1.0, "info", "autopilot: as we say", own=True)["text"] == "autopilot: as we say"
