"""Which gaps are open on a map as it is laid."""

from __future__ import annotations

import pytest

from companion.core.footprint import Footprint
from companion.core.frames import GeoPoint
from companion.core.grid import empty_grid
from companion.executive.open_gaps import map_at_start, open_gap_m
from companion.mapping.evidence_map import new_map
from companion.mission.field_size import finer_gap_m
from companion.mission.mission import GridSpec, HomePoint, Mission, RoverSpec, Target
from companion.settings import MappingSettings
from companion.settings.settings_file import parse_settings

HOME = GeoPoint(53.0, 23.0)
LONG = RoverSpec(0.6, rectangle=Footprint.rectangle(0.9, 0.7))


@pytest.mark.parametrize(("evidence_m", "gap_m"), [(0.05, 0.9), (0.1, 1.2), (0.25, 1.6)])
def test_the_cells_count_that_a_map_has_not_those_that_were_wanted(evidence_m: float, gap_m: float) -> None:
    """A field of 0.25 m has two cells of 0.125 m where 0.1 m was wanted."""
    settings = MappingSettings(keeps="outline", evidence_m=evidence_m)
    evidence = new_map(empty_grid(8, 8, 0.25), 0.4, settings)
    assert open_gap_m(LONG, evidence) == pytest.approx(gap_m)


def test_a_target_340_m_away_is_on_a_map_with_the_gaps_of_one_that_is_near_and_farther_ones_are_not() -> None:
    settings = parse_settings({"guidance": {"controller": "motion-ga"}}, "test")
    grid = GridSpec(by_footprint=True)
    gaps_m = []
    for north_m in (9.0, 340.0, 500.0):
        mission = Mission("m", (Target("t", HomePoint(north_m, 0.0)),), grid=grid, rover=LONG)
        gaps_m.append(open_gap_m(LONG, map_at_start(mission, settings, HOME, narrow_sight=False)))
    assert gaps_m[0] == gaps_m[1] == finer_gap_m(LONG, settings.mapping, 0.25) == 0.9
    assert gaps_m[2] > 1.0


def test_beams_and_arcs_are_led_by_points() -> None:
    planned, points = parse_settings({"guidance": {"controller": "motion-ga"}}, "test"), parse_settings({}, "test")
    target = (Target("t", HomePoint(9.0, 0.0)),)
    grid = GridSpec(by_footprint=True)
    turns = Mission("m", target, grid=grid, rover=RoverSpec(0.35, turning_radius_m=1.0))
    for mission, narrow in ((turns, False), (Mission("m", target, grid=grid), True)):
        ours, theirs = (map_at_start(mission, one, HOME, narrow_sight=narrow) for one in (planned, points))
        assert ours.settings == theirs.settings and ours.base.resolution_m == theirs.base.resolution_m
