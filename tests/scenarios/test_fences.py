"""The autopilot's fence, in lock-step: planned around, obeyed as soon as it changes, never crossed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.navigation.field_step import Action
from companion.safety.reasons import Doubt, LatchReason, WaitReason
from companion.settings import Settings, parse_settings
from tests.support.asker import Asker
from tests.support.quick import first_of
from tests.support.rig import ARM, GUIDED, HOLD, SET_MODE, Rig, yard
from tests.support.stored import CIRCLE_IN, CIRCLE_OUT, KEEP_IN, KEEP_OUT, POLYGONS, Person, box, stored

ALL = box(KEEP_IN, -6.0, -2.4, 7.0, 20.0)
"""Around the whole yard: the start is at 0, 0, a wall across the way at 6 m east, the target at 13 m east."""
NORTH = box(KEEP_OUT, 1.5, 3.0, 7.0, 10.0)
"""Closes the way around the wall on this side."""
FENCE_ENABLE = 207


class Watched(Rig):
    """Keeps where the rover really was, in metres north and east of its start, and the breaches the autopilot saw."""

    track: list[tuple[float, float]]

    def sleep_until_s(self, time_s: float) -> None:
        super().sleep_until_s(time_s)
        truth, start = self.simulator.truth, self.simulator._start
        self.__dict__.setdefault("track", []).append((truth.north_m - start.north_m, truth.east_m - start.east_m))

    @property
    def breaches(self) -> int:
        return self.simulator._vehicle.fence.count

    def nearest_m(self, south_m: float, west_m: float, north_m: float, east_m: float) -> float:
        """How near the rover's middle came to a rectangle."""
        way = shapely.MultiPoint([(east, north) for north, east in self.track])
        return float(shapely.distance(shapely.box(west_m, south_m, east_m, north_m), way))


def driven(tmp_path: Path, prepare: object, settings: Settings | None = None, **more: object) -> Watched:
    return Watched(yard(tmp_path), settings, prepare=prepare, **more)  # type: ignore[arg-type]


STRIP = """
name = "Strip"
[grid]
size = [30, 20]
home = [2, 10]
[rover]
cruise_speed_m_s = 2.0
turning_radius_m = 1.5
[sitl]
world = "strip.png"
heading_deg = 90.0
sensors = "lidar-360"
[[keep_in]]
polygon_m = [[-3.0, -1.5], [-3.0, 16.0], [3.0, 16.0], [3.0, -1.5]]
[[keep_out]]
north_m = 0.3
east_m = 8.0
radius_m = 1.2
"""
CORNERS = ((2.2, 15.3), (-2.3, 15.2), (-2.3, 0.5), (2.3, 14.0))


@pytest.mark.thorough
def test_who_cannot_turn_on_the_spot_keeps_inside_a_narrow_strip_by_itself(tmp_path: Path) -> None:
    """Targets in the corners: it must back out again and again, and may jam in one of them. Whatever it does, it stays
    inside, and the check of setpoints has nothing to refuse. Three seeds."""
    Image.new("L", (30, 20), 255).save(tmp_path / "strip.png")
    targets = "".join(f"[[target]]\nnorth_m = {north_m}\neast_m = {east_m}\n" for north_m, east_m in CORNERS)
    (tmp_path / "strip.toml").write_text(STRIP + targets)
    reached = stuck = 0
    for seed in (0, 2, 3):
        rig = Watched(load_mission(tmp_path / "strip.toml"), seed=seed)
        inside_m = []
        while not rig.companion.done:
            rig.companion.tick()
            pose = rig.companion.vehicle.pose_at(rig.now_s())
            if pose is not None and abs(rig.simulator.truth.speed_m_s) > 0.1:  # where it stands the position wanders
                inside_m.append(min(3.0 - abs(pose.north_m), pose.east_m + 1.5, 16.0 - pose.east_m))
            assert rig.now_s() < 400.0
        assert rig.companion.mission_run.setpoint_check.refused == {}
        assert min(inside_m) >= 0.35, "by the position that it is told: the whole body"
        assert min(min(3.0 - abs(north_m), 16.0 - east_m) for north_m, east_m in rig.track) > 0.0
        assert rig.companion.driver is not None
        reached += sum(status is TargetStatus.REACHED for _, status in rig.companion.statuses())
        stuck += rig.companion.driver.tally.stuck
    assert reached >= 10 and stuck > 0, (reached, stuck)


def changes(rig: Rig) -> list[int]:
    return [one.command for one in rig.sent if one.command in (SET_MODE, ARM)]


@first_of(1, "margin_m", [0.0, 1.0])
def test_it_goes_round_what_the_autopilot_keeps_out(tmp_path: Path, margin_m: float) -> None:
    rig = driven(tmp_path, stored([*ALL, *NORTH], **POLYGONS, FENCE_MARGIN=margin_m))
    rig.finish()
    assert rig.companion.outcome.complete
    assert rig.breaches == 0 and rig.simulator.collisions == ()
    assert min(north for north, _ in rig.track) < -2.5, "round the other end of the wall"
    assert rig.nearest_m(1.5, 3.0, 7.0, 10.0) >= max(margin_m, 0.35) - 0.15


@pytest.mark.thorough
def test_without_the_fence_it_would_have_gone_there(tmp_path: Path) -> None:
    """The same ground, the fence not enabled: so the tests above can fail."""
    rig = driven(tmp_path, stored([*ALL, *box(KEEP_OUT, -7.0, 3.0, -1.5, 10.0)], FENCE_ENABLE=0.0))
    rig.finish()
    south = rig.nearest_m(-7.0, 3.0, -1.5, 10.0)
    other = driven(tmp_path, stored([*ALL, *NORTH], FENCE_ENABLE=0.0))
    other.finish()
    assert min(south, other.nearest_m(1.5, 3.0, 7.0, 10.0)) < 0.35


@pytest.mark.thorough
def test_the_stored_fence_counts_without_being_enabled_if_so_set(tmp_path: Path) -> None:
    settings = parse_settings({"fence": {"heed": "stored"}}, "test")
    rig = driven(tmp_path, stored([*ALL, *NORTH], FENCE_ENABLE=0.0, FENCE_TYPE=4.0, FENCE_MARGIN=0.0), settings)
    rig.finish()
    assert rig.companion.outcome.complete
    assert rig.nearest_m(1.5, 3.0, 7.0, 10.0) >= 0.2


def test_never_means_that_nothing_is_asked_for(tmp_path: Path) -> None:
    settings = parse_settings({"fence": {"heed": "never"}}, "test")
    rig = driven(tmp_path, stored([], FENCE_ENABLE=0.0), settings)
    rig.until_driven(1.0)
    assert not any(one.kind.startswith("MISSION_REQUEST") for one in rig.sent)


def test_a_target_outside_is_refused_before_anything_moves(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored(box(KEEP_IN, -6.0, -2.4, 7.0, 10.0), **POLYGONS))
    with pytest.raises(MissionError, match=r"yard\.toml: target 1 'gate': lies outside .* \(inclusion area 1\), 2 m"):
        rig.finish()
    assert changes(rig) == []


def test_outside_the_circle_round_home_is_refused_too(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored(FENCE_ENABLE=1.0, FENCE_TYPE=2.0, FENCE_RADIUS=14.0))
    with pytest.raises(MissionError, match="circle of 14 m round home"):
        rig.finish()


@pytest.mark.thorough
def test_a_rover_that_starts_outside_is_told_so_and_not_even_armed(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored(box(KEEP_IN, -6.0, 4.0, 7.0, 20.0), **POLYGONS, FENCE_MARGIN=1.0))
    rig.run_for(50.0)
    assert rig.awaits(WaitReason.ROOM_TO_BORDER)
    assert changes(rig) == []
    person = Person(rig)
    person.upload([*ALL, *NORTH])
    rig.finish()
    assert rig.companion.outcome.complete, "once the fence is another one"


@first_of(1, "seed", range(3))
def test_a_fence_that_changes_on_the_way_is_heeded_at_once(tmp_path: Path, seed: int) -> None:
    rig = driven(tmp_path, stored(ALL, **POLYGONS, FENCE_MARGIN=0.0), seed=seed)
    rig.until_driven(0.5)
    # Across the end of the wall that the rover is making for, as the run without a fence shows.
    across = (1.0, 6.0, 7.0, 9.0)
    before = rig.executor.layout.fence
    Person(rig).upload([*ALL, *box(KEEP_OUT, *across)])
    changed_s = rig.now_s()
    rig.until(lambda: rig.executor.layout.fence != before, 1.0)
    assert rig.now_s() - changed_s < 1.0, "the longer list is told by FENCE_TOTAL"
    rig.finish()
    assert rig.companion.outcome.complete
    assert rig.breaches == 0 and rig.simulator.collisions == ()
    assert rig.nearest_m(*across) > 0.2


@pytest.mark.thorough
def test_a_fence_of_the_same_length_is_noticed_when_it_is_read_again(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored(ALL, **POLYGONS), parse_settings({"fence": {"again_s": 3.0}}, "test"))
    rig.until_driven(1.0)
    before = rig.executor.layout.fence
    Person(rig).upload(box(KEEP_IN, -6.5, -2.4, 7.0, 20.0))
    rig.until(lambda: rig.executor.layout.fence != before, 4.0)
    rig.run_for(4.0)
    assert sum("fence has changed" in text for text in rig.texts()) == 1


def test_a_target_that_comes_to_lie_outside_is_given_up_and_the_next_one_driven(tmp_path: Path) -> None:
    two = '[[target]]\nname = "far"\nfield = [19, 7]\n[[target]]\nname = "near"\nfield = [4, 7]\n'
    rig = Watched(
        yard(tmp_path, two), prepare=stored(box(KEEP_IN, -6.0, -2.4, 7.0, 21.4), **POLYGONS, FENCE_MARGIN=0.0)
    )
    rig.until_driven(2.0)
    Person(rig).upload([*box(KEEP_IN, -6.0, -2.4, 7.0, 12.0), (CIRCLE_IN, 0.0, 0.0, 90.0)])
    rig.finish()
    assert [status for _, status in rig.companion.statuses()] == [TargetStatus.UNREACHABLE, TargetStatus.REACHED]
    assert rig.times_decided(Action.UNREACHABLE, "far") == 0, "it is not even tried"
    assert max(east for _, east in rig.track) < 12.0 and rig.breaches == 0


def test_a_target_that_comes_to_lie_outside_while_nobody_listens_is_given_up_too(tmp_path: Path) -> None:
    two = '[[target]]\nname = "far"\nfield = [19, 7]\n[[target]]\nname = "near"\nfield = [4, 7]\n'
    mission, prepare = yard(tmp_path, two), stored(box(KEEP_IN, -6.0, -2.4, 7.0, 21.4), **POLYGONS, FENCE_MARGIN=0.0)
    rig = Watched(mission, prepare=prepare, state=tmp_path / "state")
    rig.until_driven(2.0)
    rig.run_for(0.5)
    # The companion is gone, and somebody changes the fence before another one has heard anything.
    stored([*box(KEEP_IN, -6.0, -2.4, 7.0, 12.0), (CIRCLE_IN, 0.0, 0.0, 90.0)], **POLYGONS, FENCE_MARGIN=0.0)(
        rig.simulator
    )
    rig._now_s = rig.simulator.time_s
    rig.restart_companion(mission, resume=True)
    rig.finish()
    assert [status for _, status in rig.companion.statuses()] == [TargetStatus.UNREACHABLE, TargetStatus.REACHED]
    assert rig.times_decided(Action.UNREACHABLE, "far") == 0, "it is not even tried"
    assert max(east for _, east in rig.track) < 12.0 and rig.breaches == 0


@pytest.mark.thorough
@pytest.mark.parametrize(
    "when",
    [pytest.param("before the requested goal", marks=pytest.mark.thorough), "during the requested goal"],
)
def test_a_requested_goal_is_driven_though_the_target_after_it_is_refused(tmp_path: Path, when: str) -> None:
    target = '[[target]]\nname = "far"\nfield = [19, 7]\non_blocked = "wait"\n'
    prepare = stored(box(KEEP_IN, -6.0, -2.4, 7.0, 21.4), **POLYGONS, FENCE_MARGIN=0.0)
    options = parse_settings({"navigator": {"wait_retry_s": 10.0, "wait_limit_s": 20.0}}, "test")
    rig = Asker(yard(tmp_path, target), options, prepare=prepare, late_s=0.0)
    rig.until_driven(2.0)
    smaller = [*box(KEEP_IN, -6.0, -2.4, 7.0, 12.0), (CIRCLE_IN, 0.0, 0.0, 90.0)]
    if when == "before the requested goal":
        Person(rig).upload(smaller)
        rig.until(lambda: rig.executor.statuses()[0][1] is TargetStatus.UNREACHABLE, 3.0)
        rig.reposition(rig.field(4, 3))
    else:
        rig.reposition(rig.field(4, 3))
        rig.run_for(0.5)
        Person(rig).upload(smaller)
    rig.until(lambda: rig.has_reached("requested goal 1"), 30.0)
    assert rig.passed_m(4, 3) < 0.7
    rig.finish()
    assert [status for _, status in rig.companion.statuses()] == [TargetStatus.UNREACHABLE]


def test_a_fence_that_leaves_the_rover_outside_stops_it(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored(ALL, **POLYGONS, FENCE_ACTION=0.0))
    rig.until_driven(3.0)
    Person(rig).upload([*ALL, (CIRCLE_OUT, 0.0, 5.0, 6.0)])
    at_s = rig.now_s()
    rig.until(lambda: rig.mode == HOLD, 5.0)
    assert rig.gave(Doubt.BEYOND_BORDER) or rig.gave(Doubt.FENCE_BREACHED)
    setpoints = [one for one in rig.sent_since(at_s + 0.5) if one.is_setpoint]
    assert setpoints and all(one.is_standstill for one in setpoints)
    assert rig.speed_m_s == pytest.approx(0.0, abs=0.05)


@first_of(1, "action", [1, 2], ids=["RTL", "HOLD"])
def test_a_breach_that_the_autopilot_acts_on_silences_the_companion(tmp_path: Path, action: int) -> None:
    rig = driven(tmp_path, stored(ALL, **POLYGONS, FENCE_ACTION=float(action)))
    rig.until_driven(3.0)
    # No time to hear of it: the fence is put under the rover, and the autopilot acts first.
    vehicle = rig.simulator._vehicle
    keep, corners = list(vehicle.storage.fence), vehicle.storage.fence
    corners[:] = [corner.__class__(KEEP_OUT, *_tail(corner)) for corner in keep]
    rig.until(lambda: rig.mode != GUIDED, 3.0)
    since_s = rig.now_s()
    rig.run_for(3.0)
    assert [one for one in rig.sent_since(since_s) if one.moves_or_changes] == []
    assert "The autopilot's fence is breached" in rig.texts()
    assert rig.gave(LatchReason.OTHER_MODE)


def _tail(item: object) -> tuple[object, ...]:
    return (item.frame, item.params, item.x, item.y, item.z)  # type: ignore[attr-defined]


def test_a_fence_that_is_switched_on_by_command_is_heeded(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored([*ALL, *NORTH], FENCE_ENABLE=0.0, FENCE_TYPE=4.0, FENCE_MARGIN=0.0))
    rig.until(lambda: rig.mode == GUIDED)
    rig.pilot(FENCE_ENABLE, 1)
    rig.finish()
    assert rig.companion.outcome.complete and rig.breaches == 0
    assert rig.nearest_m(1.5, 3.0, 7.0, 10.0) > 0.2


@pytest.mark.thorough
@first_of(1, "seed", range(2))
def test_over_a_bad_line_it_does_not_begin_before_it_knows_the_fence(tmp_path: Path, seed: int) -> None:
    rig, rng = driven(tmp_path, stored([*ALL, *NORTH], **POLYGONS, FENCE_MARGIN=0.0)), np.random.default_rng(seed)
    rig.lose = lambda: bool(rng.random() < 0.3)
    rig.change = lambda message: None if rng.random() < 0.3 and "MISSION" in message.get_type() else message
    rig.finish()
    assert rig.companion.outcome.complete and rig.breaches == 0
    assert rig.nearest_m(1.5, 3.0, 7.0, 10.0) > 0.2


@pytest.mark.thorough
def test_an_autopilot_that_does_not_tell_its_fence_is_waited_for(tmp_path: Path) -> None:
    rig = driven(tmp_path, stored(ALL, **POLYGONS))
    rig.change = lambda message: None if message.get_type() in ("MISSION_COUNT", "MISSION_ACK") else message
    rig.run_for(50.0)
    assert rig.awaits(WaitReason.FENCE)
    assert changes(rig) == []
    assert math.isclose(rig.simulator.driven_m, 0.0)
