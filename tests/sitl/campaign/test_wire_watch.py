"""The watch on the line: quiet on drives as they should be, and it finds a companion that does what it must not."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.campaign.wire_watch import WireWatch
from sitl.campaign.worded import faults_of
from sitl.faults.plan import LinkEffect, LinkFault
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission, with_faults
from tests.support.quick import first_of
from tests.support.rig import yard

PILOT = "pilot start_s=3 since=driving mode=HOLD"
SILENT = "sensor_silent start_s=2 since=driving duration_s=6"


def watched(folder: Path, faults: str, limit_s: float = 62.0) -> tuple[Drive, WireWatch]:
    mission = yard(folder)
    scenario = with_faults(scenario_from_mission(mission), faults_of(faults, folder))
    run = Drive(mission, scenario, Settings(), 0, NullRecorder(), limit_s)
    return run, WireWatch(run)


@first_of(1, "faults", [PILOT, SILENT])
def test_a_companion_as_it_is_breaks_nothing(tmp_path: Path, faults: str) -> None:
    run, watch = watched(tmp_path, faults)
    run.run()
    assert run.simulator.driven_m > 1.0
    assert (watch.against_pilot, watch.blind_s) == (0, 0.0)


def test_setpoints_against_a_pilot_are_counted(tmp_path: Path) -> None:
    """One that says a setpoint in every tick."""
    run, watch = watched(tmp_path, PILOT)
    setpoint = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 1511, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
    ).pack(mavlink.MAVLink(None, 1, 191))
    said = run.clock.overhear
    assert said is not None

    def stubborn(time_s: float, data: bytes) -> None:
        said(time_s, data + setpoint)

    run.clock.overhear = stubborn
    run.run()
    assert watch.against_pilot > 50, "before it was armed, and after the pilot had taken it"


def heard_by(watch: WireWatch, time_s: float, *messages: mavlink.MAVLink_message) -> None:
    sender = mavlink.MAVLink(None, 1, 1)
    assert watch._run.clock.delivered is not None
    watch._run.clock.delivered(time_s, b"".join(message.pack(sender) for message in messages))


def said_by(watch: WireWatch, time_s: float, message: mavlink.MAVLink_message) -> None:
    assert watch._run.clock.overhear is not None
    watch._run.clock.overhear(time_s, message.pack(mavlink.MAVLink(None, 1, 191)))


def made_up(speed_m_s: float = 0.0, *, in_auto: bool = False) -> Any:
    """A run without a simulator, whose rover keeps a speed."""
    return SimpleNamespace(
        clock=SimpleNamespace(overhear=None, delivered=None),
        settings=Settings(),
        simulator=SimpleNamespace(truth=SimpleNamespace(speed_m_s=speed_m_s), link_faults=list),
        scenario=SimpleNamespace(parameters={}),
        mission=SimpleNamespace(in_auto=in_auto),
        late_s=0.0,
    )


def beat(mode: int, *, armed: bool = True) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_heartbeat_message(10, 3, 129 if armed else 1, mode, 4, 3)


AHEAD = mavlink.MAVLink_distance_sensor_message(0, 20, 600, 300, 0, 1, 0, 0)
DOWN = mavlink.MAVLink_distance_sensor_message(0, 20, 600, 40, 0, 2, 25, 0)
ASIDE = mavlink.MAVLink_distance_sensor_message(0, 20, 600, 300, 0, 3, 2, 0)
UNKNOWN = mavlink.MAVLink_obstacle_distance_message(0, 0, [65535] * 72, 5, 20, 800)
BEHIND = mavlink.MAVLink_obstacle_distance_message(0, 0, [300] * 36 + [65535] * 36, 5, 20, 800, 0.0, 90.0)
ROUND = mavlink.MAVLink_obstacle_distance_message(0, 0, [300] * 72, 5, 20, 800)
POINT = mavlink.MAVLink_obstacle_distance_3d_message(0, 0, 12, 1, 2.0, 0.1, 0.0, 0.2, 8.0)
TILTED = mavlink.MAVLink_distance_sensor_message(
    0, 20, 600, 300, 0, 1, 100, 0, 0.0, 0.0, [math.cos(0.3), 0.0, -math.sin(0.3), 0.0]
)


@pytest.mark.parametrize(
    ("speed_m_s", "mode", "beats", "after", "blind_s"),
    [
        (1.0, 15, True, (), 7.5),
        (0.0, 15, True, (), 0.0),
        (1.0, 0, True, (), 0.0),
        (1.0, 15, False, (), 0.0),
        (1.0, 15, True, (AHEAD,), 0.0),
        (1.0, 15, True, (ROUND,), 0.0),
        (1.0, 15, True, (POINT,), 0.0),
        (1.0, 15, True, (DOWN, ASIDE, UNKNOWN, BEHIND, TILTED), 7.5),
    ],
    ids=["it moves", "it stands", "a pilot drives", "the line is cut", "a beam ahead", "a lidar", "a point",
         "only beams that look elsewhere"],
)  # fmt: skip
def test_a_rover_that_moves_without_range_data_is_seen(
    speed_m_s: float, mode: int, beats: bool, after: tuple[mavlink.MAVLink_message, ...], blind_s: float
) -> None:
    """Range data ends after 1 s; it is stale 1 s later, and 0.5 s after that the rover brakes."""
    watch = WireWatch(made_up(speed_m_s))
    for tick in range(201):
        time_s = 0.05 * tick
        messages = [beat(mode)] if beats or time_s <= 2.0 else []
        heard_by(watch, time_s, *messages, *([ROUND] if 0.0 < time_s <= 1.0 else after))
    assert watch.blind_s == pytest.approx(blind_s, abs=0.06)


@pytest.mark.parametrize(("brakes_m_s2", "is_blind"), [(0.75, False), (0.5, True)])
def test_a_rover_has_the_time_that_braking_takes(brakes_m_s2: float, is_blind: bool) -> None:
    run = made_up(1.5)
    watch = WireWatch(run)
    for tick in range(201):
        time_s = 0.05 * tick
        run.simulator.truth.speed_m_s = max(0.0, 1.5 - brakes_m_s2 * max(0.0, time_s - 2.5))
        heard_by(watch, time_s, beat(15), *([AHEAD] if 0.0 < time_s <= 1.0 else []))
    assert (watch.blind_s > 0.0) == is_blind


DELAY = LinkFault(effect=LinkEffect.DELAY, delay_s=1.0)
OUTAGE = LinkFault(effect=LinkEffect.OUTAGE, direction="to_vehicle")


@pytest.mark.parametrize(
    ("fault", "from_s", "to_s", "blind_s"),
    [
        (DELAY, 0.0, 0.0, 7.5),
        (DELAY, 0.0, 1.5, 6.5),
        (DELAY, 2.2, 2.4, 5.5),
        (DELAY, 0.0, 10.0, 5.5),
        (LinkFault(effect=LinkEffect.LOSS, probability=0.3), 2.2, 2.4, 6.5),
        (OUTAGE, 0.0, 6.0, 2.5),
    ],
    ids=["none", "over, its packets come", "meanwhile", "all the time", "lost meanwhile", "no stop arrives"],
)
def test_a_late_or_lossy_link_leaves_more_time_while_it_is_so(
    fault: LinkFault, from_s: float, to_s: float, blind_s: float
) -> None:
    """Range data ends after 1 s, as above; each way takes a second more, at most, while and after the link is late."""
    run = made_up(1.0)
    watch, now_s = WireWatch(run), 0.0
    run.simulator.link_faults = lambda: [fault] if from_s <= now_s < to_s else []
    for tick in range(201):
        now_s = 0.05 * tick
        heard_by(watch, now_s, beat(15), *([ROUND] if 0.0 < now_s <= 1.0 else []))
    assert watch.blind_s == pytest.approx(blind_s, abs=0.11)


def test_a_rover_that_gets_its_line_back_has_the_time_to_stop() -> None:
    watch = WireWatch(made_up(1.0))
    for tick in range(201):
        time_s = 0.05 * tick
        silent = 1.0 < time_s < 5.0
        messages = [] if silent else [beat(15)] if time_s < 5.1 else [beat(15), AHEAD]
        heard_by(watch, time_s, *messages, *([AHEAD] if 0.0 < time_s <= 1.0 else []))
    assert watch.blind_s == 0.0


LOCAL = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 1511, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0)
GLOBAL = mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def long(command: int, first: float = 0.0, second: float = 0.0) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_command_long_message(1, 1, command, 0, first, second, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("message", "counts"),
    [
        (GLOBAL, 1),
        (mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, 2, 1, 0, 0, 0, 0, 0, 0, 0), 1),
        (mavlink.MAVLink_command_int_message(1, 1, 6, 192, 0, 0, 0, 0, 0, 0, 0, 0, 0), 1),
        (mavlink.MAVLink_command_int_message(1, 1, 6, 195, 0, 0, 0, 0, 0, 0, 0, 0, 0), 0),
        (mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0.5), 1),
        (mavlink.MAVLink_rc_channels_override_message(1, 1, 1500, 1500, 1900, 1500, 0, 0, 0, 0), 1),
        (mavlink.MAVLink_set_mode_message(1, 1, 4), 1),
        (long(176, 1.0, 15.0), 1),
        (long(400, 1.0), 1),
        (long(511, 24.0, 1e5), 0),
        (mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), 0),
    ],
    ids=["global", "mission item", "reposition", "another command", "attitude", "override", "mode", "mode command",
         "arming", "a message's rate", "heartbeat"],
)  # fmt: skip
def test_whatever_moves_the_rover_or_takes_it_back_counts(message: mavlink.MAVLink_message, counts: int) -> None:
    watch = WireWatch(made_up())
    heard_by(watch, 0.5, beat(15))
    said_by(watch, 0.55, message)
    assert watch.against_pilot == 0, "it is the companion's"
    heard_by(watch, 1.0, beat(0))
    said_by(watch, 1.05, message)
    assert watch.against_pilot == counts


def test_at_the_start_the_companion_sets_guided_and_arms_once() -> None:
    watch = WireWatch(made_up())
    heard_by(watch, 0.5, beat(4, armed=False))
    said_by(watch, 0.55, long(176, 1.0, 15.0))
    heard_by(watch, 1.0, beat(15, armed=False))
    said_by(watch, 1.05, long(400, 1.0))
    assert watch.against_pilot == 0
    heard_by(watch, 2.0, beat(15))
    heard_by(watch, 3.0, beat(15, armed=False))
    said_by(watch, 3.05, long(400, 1.0))
    assert watch.against_pilot == 1, "it never arms a second time"


def test_a_rover_that_is_armed_in_manual_at_the_start_is_a_persons() -> None:
    watch = WireWatch(made_up())
    heard_by(watch, 0.5, beat(0))
    said_by(watch, 0.55, long(176, 1.0, 4.0))
    heard_by(watch, 1.0, beat(4))
    said_by(watch, 1.05, long(176, 1.0, 15.0))
    assert watch.against_pilot == 2, "also when that person has set HOLD"


@pytest.mark.parametrize(
    ("in_auto", "leg_s", "counts"), [(False, 0.9, 1), (True, 0.9, 0), (True, -9.0, 1)], ids=["own", "leg", "no leg"]
)
def test_auto_is_a_persons_choice_but_for_a_leg_that_it_hands_over(in_auto: bool, leg_s: float, counts: int) -> None:
    watch = WireWatch(made_up(in_auto=in_auto))
    heard_by(watch, leg_s, GLOBAL)
    heard_by(watch, 1.0, beat(10))
    said_by(watch, 1.05, LOCAL)
    assert watch.against_pilot == counts
