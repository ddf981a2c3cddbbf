import numpy as np
import pytest

from companion.core.grid import Cell, Grid
from companion.navigation.field_step import Part
from companion.settings import Settings, parse_settings
from sitl.experiments.field_level import FieldRobot, Outcome, drive_fields, seen_from, view_towards
from tests.support.planning_maps import drawn

EIGHT = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]


@pytest.mark.parametrize("direction", EIGHT)
def test_layer_k_holds_2k_plus_1_fields(direction):
    offsets = view_towards(*direction).offsets
    layers = np.abs(offsets).max(axis=1)
    assert np.bincount(layers).tolist() == [0, 3, 5, 7, 9]
    assert len({tuple(offset) for offset in offsets.tolist()}) == len(offsets)
    along = offsets @ np.array(direction)
    assert (along >= layers).all(), "all of it lies ahead"


def test_the_triangle_ahead_is_isosceles_and_the_diagonal_one_is_a_quadrant():
    east = {tuple(o) for o in view_towards(1, 0, layers=2).offsets.tolist()}
    assert east == {(1, -1), (1, 0), (1, 1), (2, -2), (2, -1), (2, 0), (2, 1), (2, 2)}
    south_west = {tuple(o) for o in view_towards(-1, -1, layers=2).offsets.tolist()}
    assert south_west == {(-1, 0), (-1, -1), (0, -1), (-2, 0), (-2, -1), (-2, -2), (-1, -2), (0, -2)}


def test_obstacles_are_seen_and_hide_what_lies_behind_them():
    truth = drawn(
        ".......",
        ".......",
        "...#.#.",
        ".......",
        ".......",
    )
    seen = {tuple(cell) for cell in seen_from(truth, Cell(1, 2), view_towards(1, 0)).tolist()}
    assert {(2, 2), (3, 2), (2, 1), (2, 3), (5, 0), (5, 4)} <= seen
    assert not {(4, 2), (5, 2)} & seen


def test_the_view_ends_at_the_edge_of_the_map():
    truth = np.full((5, 6), 0.5)
    seen = seen_from(truth, Cell(4, 4), view_towards(1, 1))
    assert sorted(map(tuple, seen.tolist())) == [(5, 4)]
    assert seen_from(truth, Cell(5, 0), view_towards(1, 0)).shape == (0, 2)


def test_the_map_begins_empty_and_learns_what_is_seen():
    truth = Grid(np.full((50, 100), 0.5))
    truth.weights[20:30, 40] = 1.0
    truth.weights[40:45, 70] = 1.0
    robot = FieldRobot(truth, Cell(0, 24), Cell(98, 24), Settings(), 0)
    assert (robot.known.weights == 0.5).all()
    run = robot.drive()
    assert run.outcome is Outcome.REACHED
    assert (robot.known.weights[truth.weights < 1.0] == 0.5).all(), "nothing is seen that is not there"
    assert (robot.known.weights[20:30, 40] == 1.0).sum() >= 4
    assert run.searches >= 98 // 5 and run.planning_s > 0.0 and len(run.step_seconds) > run.steps


def test_a_sealed_target_sends_it_back_to_the_start():
    rows = ["." * 30] * 4 + ["." * 18 + "#" * 8 + "...."] + ["." * 18 + "#......#...."] * 3
    rows += ["." * 18 + "#" * 8 + "...."] + ["." * 30] * 4
    run = drive_fields(Grid(drawn(*rows)), Cell(0, 6), Cell(22, 6), Settings(), 1)
    assert run.outcome is Outcome.UNREACHABLE and run.track[-1] == Cell(0, 6)
    assert run.return_steps > 10 and run.parts.count(Part.RETURN) == run.return_steps


def test_a_field_just_seen_to_be_blocked_is_not_entered():
    """Target behind the robot's back: it turns first, and sees the wall beside it."""
    truth = Grid(drawn("....", ".##.", "...."))
    robot = FieldRobot(truth, Cell(0, 1), Cell(3, 1), Settings(), 0)
    run = robot.drive()
    assert run.outcome is Outcome.REACHED and not any(truth.is_obstacle(cell) for cell in run.track)


def test_the_limit_of_steps_ends_a_run():
    run = drive_fields(Grid(np.full((9, 40), 0.5)), Cell(0, 4), Cell(39, 4), Settings(), 0, step_limit=7)
    assert run.outcome is Outcome.STEP_LIMIT and run.steps == 7


def test_starting_on_the_target_is_reaching_it():
    run = drive_fields(Grid(np.full((5, 5), 0.5)), Cell(2, 2), Cell(2, 2), Settings(), 0)
    assert run.outcome is Outcome.REACHED and run.steps == 0


def test_the_papers_profile_drives_with_the_genetic_algorithm_alone():
    truth = Grid(np.full((30, 60), 0.5))
    truth.weights[8:22, 30] = 1.0
    run = drive_fields(truth, Cell(0, 14), Cell(58, 14), parse_settings({"profile": "paper"}, "test"), 3)
    assert run.outcome is Outcome.REACHED and run.steps < 120
