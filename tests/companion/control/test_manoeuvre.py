"""Manoeuvres: every one can be driven, over ground that is known."""

import math

import numpy as np
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from companion.control.manoeuvre import ArcSegment, Manoeuvre, Try, find_manoeuvre, tries
from companion.core.frames import Pose
from tests.companion.control.test_arc_controller import MIDDLE, RADIUS_M, ROVER, SETTINGS, ground, path, view
from tests.support.quick import examples


def curvature_per_m(segment: ArcSegment) -> float:
    """The greatest, from the directions of the pieces."""
    steps = np.diff(segment.points, axis=0)
    lengths, turned = np.hypot(*steps.T), np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.abs(np.diff(turned) / (0.5 * (lengths[1:] + lengths[:-1]))).max(initial=0.0))


def is_joined(manoeuvre: Manoeuvre, start: Pose) -> bool:
    """Each segment begins where the last one ended, with the same heading, and the first one at the rover."""
    place, heading_rad = np.array([start.north_m, start.east_m]), start.heading_rad
    for segment in manoeuvre.segments:
        first = segment.points[1] - segment.points[0]
        aside = math.atan2(first[1], first[0]) + (math.pi if segment.backwards else 0.0) - heading_rad
        if np.hypot(*(segment.points[0] - place)) > 1e-6 or abs(math.remainder(aside, 2.0 * math.pi)) > 0.1:
            return False
        last = segment.points[-1] - segment.points[-2]
        place, heading_rad = segment.points[-1], math.atan2(last[1], last[0]) + (math.pi if segment.backwards else 0.0)
    return True


places = st.floats(-7.0, 7.0)


@settings(deadline=None, max_examples=examples(60))
@given(
    st.floats(-3.2, 3.2),
    st.lists(st.tuples(places, places), max_size=12),
    st.floats(-3.2, 3.2),
    st.lists(st.tuples(places, places), max_size=4),
    st.sampled_from([-1, 0, 1]),
)
@example(heading_rad=-2.46875, posts=[], bearing_rad=1.0, dark=[(1.375, 0.0)], first=-1)  # across a cell's corner
def test_every_manoeuvre_can_be_driven(
    heading_rad: float,
    posts: list[tuple[float, float]],
    bearing_rad: float,
    dark: list[tuple[float, float]],
    first: int,
) -> None:
    posts = [(n, e) for n, e in posts if math.hypot(n, e) > 1.2]
    boxes = [(MIDDLE + n, MIDDLE + e, MIDDLE + n + 0.25, MIDDLE + e + 0.25) for n, e in posts]
    unseen = [(MIDDLE + n, MIDDLE + e, MIDDLE + n + 2.0, MIDDLE + e + 2.0) for n, e in dark]
    evidence = ground(boxes, unseen)
    start = Pose(MIDDLE, MIDDLE, heading_rad, 0.0)
    way = path((0, 0), (12 * math.cos(bearing_rad), 12 * math.sin(bearing_rad)))
    found = None
    for wanted in tries(way, ROVER, SETTINGS.steering):
        found = find_manoeuvre(way, view(evidence, start), wanted, first)
        if found is not None:
            break
    assume(found is not None)
    assert found is not None and is_joined(found, start)
    assert first == 0 or found.segments[0].backwards == (first < 0)
    taken = np.argwhere(evidence.log_odds >= SETTINGS.mapping.occupied_at) / 8 + 0.0625
    for segment in found.segments:
        assert curvature_per_m(segment) <= 1.01 / RADIUS_M
        for point in segment.points:
            assert len(taken) == 0 or np.hypot(*(taken - point).T).min() > ROVER.radius_m
        if segment.backwards:
            cells = np.floor(segment.points[1:] * 8).astype(int)
            assert (evidence.log_odds[cells[:, 0], cells[:, 1]] != 0.0).all()
    ahead = min(np.hypot(*(way.points - (found.end.north_m, found.end.east_m)).T))
    assert ahead <= SETTINGS.steering.join_within_m + 1e-6


def test_more_is_tried_only_where_the_route_goes_on() -> None:
    far, near = (
        tries(path((0, 0), (20, 0)), ROVER, SETTINGS.steering),
        tries(path((0, 0), (2, 0)), ROVER, SETTINGS.steering),
    )
    assert {t.ahead_m for t in far} == {5.0, 3.0, 8.0}
    assert {t.ahead_m for t in near} == {5.0}
    assert Try(5.0, 0.4) == far[0] == near[0]
