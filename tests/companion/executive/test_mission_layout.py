"""The mission where the autopilot's frame lies, and where it lies after the frame has moved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.core.footprint import Footprint
from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.executive.mission_layout import apart_m, fenced_again, from_home, lay, lay_again, seen_ground
from companion.executive.mission_progress import MissionPhase, on_reached, on_time, plan_progress
from companion.mapping.map_files import load_map, save_ros_map
from companion.mission.autopilot_fence import AutopilotFence
from companion.mission.mission import HomePoint, Mission, RoverSpec, Target
from companion.settings import MappingSettings
from tests.support.rig import yard

ORIGIN = GeoPoint(-35.3632621, 149.1652374)
HOME = LocalFrame(ORIGIN).to_geo(NedPoint(3.0, -4.0))
POSE = Pose(3.2, -3.8, 0.0, 0.0)
TWO = '[[target]]\nname = "a"\nfield = [15, 7]\n[[target]]\nname = "b"\nnorth_m = 2.0\neast_m = 5.0\n'


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    return yard(tmp_path, TWO)


def test_fields_and_metres_count_from_home(mission: Mission) -> None:
    layout = lay(mission, MappingSettings(), ORIGIN, HOME, POSE)
    first, second = layout.targets
    assert first.point.distance_m(NedPoint(3.0, 9.0)) < 1e-3
    assert second.point.distance_m(NedPoint(5.0, 1.0)) < 1e-3
    assert layout.start.point == POSE.point
    assert layout.evidence.base.cell_at(POSE.point) == layout.start.cell
    assert from_home(layout).north_m == pytest.approx(-7.5, abs=1e-3)
    assert from_home(layout).east_m == pytest.approx(-2.5, abs=1e-3)


def test_a_map_that_is_saved_and_read_again_and_again_stays_as_it_is(tmp_path: Path) -> None:
    """Fields of 0.15 m, less than the rover's radius: obstacles keep their size, the ground is what was seen."""
    goal = Target("goal", HomePoint(0.0, 9.0))
    mission, drawn = Mission("m", (goal,), rover=RoverSpec(0.35)), []
    for number in range(3):
        layout = lay(mission, MappingSettings(), ORIGIN, HOME, POSE)
        if number == 0:
            log_odds = layout.evidence.log_odds
            log_odds[200:260, 200:260] = -2.0
            log_odds[230, 210:250] = 3.0
            layout.evidence.seen.add(200, 200, 260, 260)
        save_ros_map(seen_ground(layout)[0], tmp_path / f"m{number}", seen_ground(layout)[1])
        saved = tmp_path / f"m{number}.yaml"
        mission = replace(mission, prior_map=saved)
        drawn.append(load_map(saved).weights >= 1.0)
    assert drawn[0].sum() == drawn[1].sum() == drawn[2].sum() > 10
    assert drawn[0].size < 0.01 * layout.evidence.base.weights.size
    base = lay(mission, MappingSettings(), ORIGIN, HOME, POSE).evidence.base
    assert base.resolution_m < 0.16 and (base.weights >= 1.0).sum() > 3 * drawn[0].sum(), "there the radius is added"


def test_laid_again_everything_is_where_it_was_on_earth_and_progress_is_kept(mission: Mission) -> None:
    layout = lay(mission, MappingSettings(), ORIGIN, HOME, POSE)
    progress = on_time(on_reached(plan_progress(layout.targets, layout.start), 5.0), 5.0)
    moved = LocalFrame(ORIGIN).to_geo(NedPoint(-120.0, 75.0))
    again, after = lay_again(layout, progress, mission, MappingSettings(), moved)
    old_frame, new_frame = LocalFrame(ORIGIN), LocalFrame(moved)
    for old, new in zip((*progress.targets, progress.home), (*after.targets, after.home), strict=True):
        assert apart_m(old_frame.to_geo(old.point), new_frame.to_geo(new.point)) < 0.01
        assert (old.name, old.cell) == (new.name, new.cell)
    assert (after.statuses, after.index) == (progress.statuses, 1)
    assert after.phase is MissionPhase.TRAVEL
    assert again.home == HOME and again.origin == moved
    assert not again.evidence.log_odds.any()


def test_fields_and_evidence_follow_from_the_rover() -> None:
    rover = RoverSpec(0.6, rectangle=Footprint.rectangle(0.9, 0.7))
    wanted = Mission("m", (Target("goal", HomePoint(0.0, 9.0)),), rover=rover)
    for keeps, side_m, evidence_m in (("circle", 0.25, 0.083), ("outline", 0.25, 0.05)):
        evidence = lay(wanted, MappingSettings(keeps=keeps), ORIGIN, HOME, POSE).evidence
        assert evidence.base.resolution_m == pytest.approx(side_m)
        assert evidence.evidence_m == pytest.approx(evidence_m, abs=0.001)
    small = replace(wanted, rover=RoverSpec(), grid=replace(wanted.grid, by_footprint=False, resolution_m=0.15))
    given = lay(small, MappingSettings(), ORIGIN, HOME, POSE).evidence
    assert given.evidence_m == pytest.approx(0.05), "who gives small fields drives through the same gaps"
    with_beams = lay(wanted, MappingSettings(), ORIGIN, HOME, POSE, narrow_sight=True).evidence
    assert with_beams.base.resolution_m == 1.0 and with_beams.evidence_m == 0.125


def test_another_fence_leaves_small_fields_as_they_are() -> None:
    wanted = Mission("m", (Target("goal", HomePoint(0.0, 9.0)),))
    layout = lay(wanted, MappingSettings(), ORIGIN, HOME, POSE)
    again = fenced_again(layout, wanted, AutopilotFence(circle_m=40.0, home=HOME))
    assert again.evidence is layout.evidence and again.evidence.base.resolution_m == pytest.approx(0.15)


def test_distance_between_places() -> None:
    assert apart_m(ORIGIN, ORIGIN) == 0.0
    assert apart_m(ORIGIN, HOME) == pytest.approx(5.0, abs=1e-3)
