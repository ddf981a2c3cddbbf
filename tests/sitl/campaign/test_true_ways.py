"""Which targets have a way on the true ground: each for itself, with doors, fences, and things that stand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.executive.mission_layout import MissionLayout, lay
from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.settings import MappingSettings
from sitl.campaign.true_ways import Verdicts, leads_to
from sitl.scenario import Scenario, scenario_from_mission

AT = (45.0, 100.0, 300.0)
"""The rover began to drive, called the target unreachable; the time limit."""
WALLS = """size_m = [30.0, 12.0]
[[obstacle]]
line_m = [[0.0, 0.0], [12.0, 0.0], [12.0, 30.0], [0.0, 30.0], [0.0, 0.0]]
width_m = 0.4
[[obstacle]]
line_m = [[0.0, 15.0], [{gap_south_m}, 15.0]]
width_m = 0.4
[[obstacle]]
line_m = [[8.0, 15.0], [12.0, 15.0]]
width_m = 0.4
"""
GATE = '[[door]]\nname = "gate"\nline_m = [[4.0, 15.0], [8.0, 15.0]]\nwidth_m = 0.3\nopen_s = [[{begin_s}, {end_s}]]\n'
CELL = "[[obstacle]]\nline_m = [[6.0, 20.0], [10.0, 20.0], [10.0, 24.0], [6.0, 24.0], [6.0, 20.0]]\nwidth_m = 0.4\n"
"""A closed one round the second target."""
MISSION = """[[target]]
north_m = 0.0
east_m = 13.0
[[target]]
north_m = 2.0
east_m = 17.0
[sitl]
world = "world.toml"
resolution_m = 1.0
start = [5, 6]
heading_deg = 90.0
"""
STRIP = "[[keep_out]]\npolygon_m = [[-30.0, {west_m}], [30.0, {west_m}], [30.0, {east_m}], [-30.0, {east_m}]]\n"


def course(folder: Path, world: str = "", mission: str = "", gap_m: float = 4.0) -> tuple[Scenario, MissionLayout]:
    (folder / "world.toml").write_text(WALLS.format(gap_south_m=8.0 - gap_m) + world)
    (folder / "mission.toml").write_text(mission + MISSION)
    read = load_mission(folder / "mission.toml")
    scenario = scenario_from_mission(read)
    home = GeoPoint(scenario.start.home.lat_deg, scenario.start.home.lon_deg)
    return scenario, lay(read, MappingSettings(), home, home, Pose(0.0, 0.0, 1.57, 0.0))


def ways(folder: Path, world: str = "", mission: str = "", gap_m: float = 4.0) -> list[bool]:
    """To the first and the second target."""
    scenario, layout = course(folder, world, mission, gap_m)
    frame = LocalFrame(layout.origin)
    return [leads_to(frame.to_geo(one.point), scenario, layout, AT) for one in layout.targets]


@pytest.mark.parametrize(
    ("begin_s", "end_s", "is_way"),
    [(5000.0, 6000.0, False), (0.0, 44.0, False), (0.0, 60.0, False), (200.0, 250.0, False), (90.0, 150.0, True)],
    ids=["never", "before it drove", "shut for good", "opens after the call", "open at the call"],
)
def test_a_gate_counts_as_it_was_when_the_target_was_called_unreachable(
    tmp_path: Path, begin_s: float, end_s: float, is_way: bool
) -> None:
    assert ways(tmp_path, GATE.format(begin_s=begin_s, end_s=end_s)) == [is_way, is_way]


def test_a_gate_that_opens_again_and_again_is_a_way(tmp_path: Path) -> None:
    again = GATE.format(begin_s=0.0, end_s=10.0) + "period_s = 40.0\n"
    assert ways(tmp_path, again) == [True, True]


@pytest.mark.parametrize(("gap_m", "is_way"), [(0.9, True), (0.6, False)])
def test_a_gap_is_a_way_where_the_rover_fits(tmp_path: Path, gap_m: float, is_way: bool) -> None:
    """It is 0.7 m wide."""
    assert ways(tmp_path, gap_m=gap_m) == [is_way, is_way]


def test_a_fence_across_the_ground_closes_it_and_one_beside_it_does_not(tmp_path: Path) -> None:
    assert ways(tmp_path, mission=STRIP.format(west_m=8.0, east_m=10.0)) == [False, False]
    assert ways(tmp_path, mission=STRIP.format(west_m=22.0, east_m=24.0)) == [True, True]


def test_what_could_move_and_stands_in_the_gap_closes_it(tmp_path: Path) -> None:
    parked = "[[mover]]\nradius_m = 1.9\nroute_m = [[6.0, 8.0], [6.0, 15.0]]\nspeed_m_s = 1.0\n"
    assert ways(tmp_path, parked) == [False, False]
    assert ways(tmp_path, parked.replace("speed_m_s = 1.0", "speed_m_s = 0.06")) == [True, True], "it is under way"


def test_each_target_is_judged_for_itself(tmp_path: Path) -> None:
    """One sealed target made every other one count as sealed, too."""
    scenario, layout = course(tmp_path, CELL)
    executor = SimpleNamespace(layout=layout, progress=SimpleNamespace(targets=layout.targets))
    statuses = [("one", TargetStatus.PENDING), ("two", TargetStatus.PENDING)]
    simulator = SimpleNamespace(time_s=45.0, driven_m=1.0)
    companion = SimpleNamespace(executor=executor, statuses=lambda: statuses)
    run = SimpleNamespace(simulator=simulator, companion=companion, scenario=scenario, time_limit_s=300.0)
    for called in ([], [1], [0, 1], [0]):
        verdicts = Verdicts()
        statuses[:] = [(name, TargetStatus.UNREACHABLE if number in called else TargetStatus.REACHED)
                       for number, name in enumerate(("one", "two"))]  # fmt: skip
        assert verdicts.wrong(run) == (0 in called), called  # type: ignore[arg-type]


def test_a_target_that_was_tried_again_and_reached_is_not_called_unreachable() -> None:
    status = [("one", TargetStatus.UNREACHABLE)]
    companion = SimpleNamespace(executor=SimpleNamespace(), statuses=lambda: status)
    run = SimpleNamespace(simulator=SimpleNamespace(time_s=45.0, driven_m=1.0), companion=companion)
    verdicts = Verdicts()
    verdicts.look(run)  # type: ignore[arg-type]
    status[0] = ("one", TargetStatus.REACHED)
    assert verdicts.called_s == {0: 45.0} and verdicts.wrong(run) == 0  # type: ignore[arg-type]


def test_the_frame_of_the_autopilot_may_lie_elsewhere(tmp_path: Path) -> None:
    scenario, layout = course(tmp_path, mission=STRIP.format(west_m=8.0, east_m=10.0))
    home = layout.home
    moved = LocalFrame(home).to_geo(NedPoint(40.0, -25.0))
    read = load_mission(tmp_path / "mission.toml")
    again = lay(read, MappingSettings(), moved, home, Pose(-40.0, 25.0, 1.57, 0.0))
    frame = LocalFrame(moved)
    near = frame.to_geo(LocalFrame(moved).to_ned(LocalFrame(home).to_geo(NedPoint(0.0, 3.0))))
    assert leads_to(near, scenario, again, AT), "before the fence"
    assert not leads_to(frame.to_geo(again.targets[0].point), scenario, again, AT)
