"""How near a circle or a rectangle is to fields and discs, against shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Point, Polygon, affinity, box

from companion.core.frames import GeoPoint
from sitl.plant.outline import Outline, OutlinePose, mover_room_m, room_m
from sitl.plant.rover import drive, new_rover
from sitl.simulator import Simulator
from sitl.world.movers import Mover, fleet_of, timed_track
from sitl.world.truth import SimStart
from sitl.world.world import World

LONG = Outline(0.0, 0.8, 0.3, 0.25)
FIELD_M = 0.1


def drawn(outline: Outline, pose: OutlinePose) -> Polygon:
    if outline.radius_m > 0.0:
        return Point(pose.east_m, pose.north_m).buffer(outline.radius_m, quad_segs=64)
    ahead = box(-outline.half_width_m, -outline.rear_m, outline.half_width_m, outline.front_m)
    turned = affinity.rotate(ahead, -math.degrees(pose.heading_rad), origin=(0.0, 0.0))
    return affinity.translate(turned, pose.east_m, pose.north_m)


def field(row: int, column: int) -> World:
    fields = np.zeros((40, 40), dtype=np.bool_)
    fields[row, column] = True
    return World(fields, FIELD_M)


@given(st.integers(0, 39), st.integers(0, 39), st.floats(-3.14, 3.14), st.sampled_from([LONG, Outline(0.35)]))
def test_it_touches_a_field_where_their_drawings_overlap(
    row: int, column: int, heading_rad: float, outline: Outline
) -> None:
    pose = OutlinePose(2.03, 1.97, heading_rad)
    gap_m = room_m(field(row, column).layers().solid, outline, pose, 1.0)
    square = box(column * FIELD_M, row * FIELD_M, (column + 1) * FIELD_M, (row + 1) * FIELD_M)
    shape = drawn(outline, pose)
    distance_m = shape.distance(square)
    assert gap_m <= min(distance_m, 1.0) + 2e-3
    if shape.intersection(square).area > 1e-4:
        assert gap_m < 0.0
    elif distance_m > 1e-3:
        assert gap_m > 0.0


@given(st.floats(0.0, 4.0), st.floats(0.0, 4.0), st.floats(-3.14, 3.14))
def test_its_distance_from_a_mover_is_that_of_the_drawing(north_m: float, east_m: float, heading_rad: float) -> None:
    pose, place = OutlinePose(2.0, 2.0, heading_rad), (north_m, east_m)
    track = timed_track([place, (north_m + 50.0, east_m)], 1.0, 1e3, repeats=False)
    gap_m, which = mover_room_m(fleet_of((Mover("cart", 0.3, track),)), LONG, pose, 0.0)
    far_m = drawn(LONG, pose).distance(Point(east_m, north_m))
    assert which == 0
    assert gap_m == pytest.approx(far_m - 0.3, abs=1e-6) if far_m > 1e-9 else gap_m <= -0.3


def test_a_long_rover_touches_what_it_turns_into_and_a_round_one_does_not() -> None:
    """A post beside it, 0.5 m from its middle: turning by a right angle its front comes there."""
    touched = []
    for outline in (LONG, Outline(0.35)):
        simulator = Simulator(
            World(field(20, 25).obstacles, FIELD_M), SimStart(2.05, 2.05, 0.0, GeoPoint(0.0, 0.0)), "none", noise=False,
            outline=outline,
        )  # fmt: skip
        assert simulator.world_room_m(OutlinePose(2.05, 2.05, 0.0)) > 0.0
        touched.append(simulator.world_room_m(OutlinePose(2.05, 2.05, 0.5 * math.pi)) < 0.0)
    assert touched == [True, False]


def test_a_rover_that_touches_turns_no_farther() -> None:
    rover = new_rover(2.05, 2.05, 0.0, LONG).view(np.recarray)[0]
    surroundings = field(20, 25).surroundings(0.0)
    for _ in range(400):
        drive(rover, surroundings, 0.3, -0.3, 0.005)
    assert rover.contacts == 1 and rover.touching == 1
    assert 0.3 < rover.heading_rad < 1.5
    for _ in range(400):
        drive(rover, surroundings, -0.3, 0.3, 0.005)
    assert rover.touching == 0, "it turns back"
