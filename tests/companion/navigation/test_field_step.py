"""Every arrow of figures 10 to 14 of Kwasniewski & Gosiewski 2018, on small drawn maps with a scripted search."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from companion.core.grid import Cell, Grid
from companion.navigation.field_step import (
    Action,
    DecisionReason,
    NavState,
    Part,
    SearchKind,
    abandon_path,
    initial_state,
    is_clear,
    retrace,
    simplified,
    step,
)
from companion.planning.problem import Path, PlanResult, PlanStatus, path_cost
from tests.support.planning_maps import drawn

RETURN, BETTER, THOROUGH = SearchKind.RETURN, SearchKind.BETTER, SearchKind.THOROUGH
TARGET = Cell(9, 0)
ROW = tuple(Cell(x, 0) for x in range(10))


def ground(*rows: str) -> Grid:
    return Grid(drawn(*rows) if rows else np.full((5, 10), 0.5))


class Scripted:
    """A search that answers from a script and remembers what it was asked; the last answer is repeated."""

    def __init__(self, *answers: Path | PlanStatus) -> None:
        self.answers = list(answers)
        self.asked: list[tuple[SearchKind, Cell, Cell]] = []

    def __call__(self, kind: SearchKind, start: Cell, target: Cell) -> PlanResult:
        self.asked.append((kind, start, target))
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, Path):
            return PlanResult(PlanStatus.FOUND, answer, "scripted")
        return PlanResult(answer, None, "scripted")

    @property
    def kinds(self) -> list[SearchKind]:
        return [kind for kind, _, _ in self.asked]


NEVER = PlanStatus.BUDGET_SPENT
PROVED = PlanStatus.NO_PATH


def path(*cells: tuple[int, int], cost: float | None = None) -> Path:
    fields = tuple(Cell(*cell) for cell in cells)
    return Path(fields, 0.5 * (len(fields) - 1) if cost is None else cost)


def unused(kind: SearchKind, start: Cell, target: Cell) -> PlanResult:
    raise AssertionError("no search was due")


def exploring(at: int = 0, since_better: int = 0) -> NavState:
    """On the way along ROW, having entered field ``at``."""
    return NavState(
        target=TARGET, past=ROW[: at + 1], current=Path(ROW, 4.5), index=at, since_better=since_better, draws=1
    )


def returning(past: tuple[Cell, ...] = ROW[:6], until_search: int = 3) -> NavState:
    return NavState(target=TARGET, past=past, returning=True, until_search=until_search, draws=1)


# --- figure 10 and 11: the loop and the choice of the part -----------------------------------------------------------


def test_the_first_step_has_no_path_and_searches_thoroughly():
    search = Scripted(Path(ROW, 4.5))
    state, decision = step(initial_state(ROW[0], TARGET), ground(), ROW[0], search)
    assert search.asked == [(THOROUGH, ROW[0], TARGET)]
    assert (decision.action, decision.part, decision.path) == (Action.FOLLOW, Part.SEARCH, ROW)
    assert decision.new_path is state.current and not state.returning


@pytest.mark.parametrize("state", [initial_state(ROW[0], ROW[0]), replace(exploring(8), target=ROW[9])])
def test_the_loop_ends_at_the_target(state):
    _, decision = step(state, ground(), state.target, unused)
    assert decision.action is Action.REACHED and decision.path == ()


def test_the_target_counts_in_return_mode_too():
    state, decision = step(replace(returning(), target=ROW[4]), ground(), ROW[4], unused)
    assert decision.action is Action.REACHED and state.past == ROW[:5]


TRANSITIONS = [
    # mode,        current path, due,   search finds, action,            part,           searches,            mode after
    ("explore", "clear", False, None, Action.FOLLOW, Part.EXPLORE, [], "explore"),
    ("explore", "clear", True, "better", Action.FOLLOW, Part.EXPLORE, [BETTER], "explore"),
    ("explore", "clear", True, "worse", Action.FOLLOW, Part.EXPLORE, [BETTER], "explore"),
    ("explore", "clear", True, "nothing", Action.FOLLOW, Part.EXPLORE, [BETTER], "explore"),
    ("explore", "blocked", False, "better", Action.FOLLOW, Part.SEARCH, [THOROUGH], "explore"),
    ("explore", "blocked", True, "worse", Action.FOLLOW, Part.SEARCH, [THOROUGH], "explore"),
    ("explore", "blocked", False, "nothing", Action.BACKTRACK, Part.RETURN, [THOROUGH], "return"),
    ("explore", "none", False, "better", Action.FOLLOW, Part.SEARCH, [THOROUGH], "explore"),
    ("explore", "none", False, "nothing", Action.BACKTRACK, Part.RETURN, [THOROUGH], "return"),
    ("return", "none", False, None, Action.BACKTRACK, Part.RETURN, [], "return"),
    ("return", "none", True, "worse", Action.FOLLOW, Part.RETURN, [RETURN], "explore"),
    ("return", "none", True, "nothing", Action.BACKTRACK, Part.RETURN, [RETURN], "return"),
]


@pytest.mark.parametrize(("mode", "current", "due", "finds", "action", "part", "kinds", "after"), TRANSITIONS)
def test_transitions(mode, current, due, finds, action, part, kinds, after):
    """Figures 11 to 14 as a table: at field 5 of the row, entered just now."""
    grid = ground("..........", "..........", "........#." if current == "blocked" else "..........")
    if mode == "return":
        state, cell = returning(ROW[:7], until_search=1 if due else 3), ROW[5]
    else:
        state, cell = exploring(4, since_better=4 if due else 0), ROW[5]
        state = abandon_path(state) if current == "none" else state
    onward = ((5, 0), (6, 1), (7, 1), (8, 1), (9, 0))
    answers = {"better": path(*onward, cost=1.9), "worse": path(*onward, cost=2.1), "nothing": NEVER, None: NEVER}
    search = Scripted(answers[finds])
    state, decision = step(state, grid, cell, search)
    assert (decision.action, decision.part) == (action, part)
    assert search.kinds == kinds == list(decision.searches)
    assert state.returning == (after == "return")
    assert decision.path[0] == cell == state.past[-1]


# --- part A: return mode (4.3, figure 12) ----------------------------------------------------------------------------


def test_return_mode_goes_back_in_the_footsteps_and_drops_the_retraced_tail():
    state, decision = step(returning(ROW[:6]), ground(), ROW[4], unused)
    assert state.past == ROW[:5]
    assert decision.action is Action.BACKTRACK and decision.path == ROW[4::-1]


def gaps_between_searches(seed: int, fields: int = 200) -> list[int]:
    """Fields from search to search on a long way back."""
    row = tuple(Cell(x, 0) for x in range(fields))
    grid = Grid(np.full((1, fields + 1), 0.5))
    search = Scripted(NEVER)
    state, _ = step(NavState(Cell(fields, 0), row, draws=seed), grid, row[-1], search)
    for cell in reversed(row[1:-1]):
        state, decision = step(state, grid, cell, search)
        assert decision.action is Action.BACKTRACK
    searched_at = [start.x for _, start, _ in search.asked]
    assert set(search.kinds[1:]) == {RETURN}
    return (-np.diff(searched_at)).tolist()


def test_return_mode_searches_every_second_or_third_field_at_random():
    gaps = [gap for seed in range(20) for gap in gaps_between_searches(seed)]
    assert set(gaps) == {2, 3}
    # Equal chances: five standard deviations of so many throws of a coin.
    assert abs(gaps.count(2) / len(gaps) - 0.5) < 2.5 / np.sqrt(len(gaps))
    # Independent ones: a gap equals the one before it in half of the cases, too.
    same = sum(a == b for a, b in pairwise(gaps))
    assert abs(same / len(gaps) - 0.5) < 2.5 / np.sqrt(len(gaps))
    first = [gaps_between_searches(seed, 8)[0] for seed in range(100)]
    assert abs(first.count(2) - 50) < 25, "the very first choice depends on the seed, too"
    assert gaps_between_searches(3) == gaps_between_searches(3) != gaps_between_searches(4)


def test_in_return_mode_looking_again_from_the_same_field_does_not_bring_the_search_nearer():
    state = returning(ROW[:6], until_search=1)
    for _ in range(3):
        state, _ = step(state, ground(), ROW[5], unused)
    search = Scripted(NEVER)
    step(state, ground(), ROW[4], search)
    assert search.asked == [(RETURN, ROW[4], TARGET)]


def test_a_correct_result_ends_return_mode():
    found = path((4, 0), (5, 1), (6, 1), (7, 1), (8, 1), (9, 0))
    state, decision = step(returning(ROW[:6], until_search=1), ground(), ROW[4], Scripted(found))
    assert decision.action is Action.FOLLOW and decision.path == found.cells
    assert state.current is found and state.index == 0 and not state.returning
    _, decision = step(state, ground(), Cell(5, 1), unused)
    assert decision.part is Part.EXPLORE and decision.path == found.cells[1:]


@pytest.mark.parametrize("answer", [NEVER, PROVED])
def test_back_at_the_start_without_a_path_the_target_is_unreachable(answer):
    search = Scripted(answer)
    state, decision = step(returning(ROW[:2], until_search=3), ground(), ROW[0], search)
    assert search.asked == [(THOROUGH, ROW[0], TARGET)], "the start is worth a thorough search, due or not"
    assert decision.action is Action.UNREACHABLE and decision.path == ()
    assert decision.proved == (answer is PROVED)
    assert state.past == ROW[:1]


def test_back_at_the_start_a_path_found_there_is_followed():
    _, decision = step(returning(ROW[:2]), ground(), ROW[0], Scripted(Path(ROW, 4.5)))
    assert decision.action is Action.FOLLOW and decision.path == ROW


def test_returning_beside_the_past_path_joins_it_at_the_nearest_field():
    past = tuple(Cell(x, 2) for x in range(7))
    state, decision = step(returning(past), ground(), Cell(4, 3), unused)
    assert state.past == (*past[:6], Cell(4, 3)) or state.past == (*past[:5], Cell(4, 3))
    assert is_walk(state.past) and decision.path == state.past[::-1]


def test_returning_a_corner_cut_by_the_rover_drops_the_fields_between():
    past = (Cell(0, 0), Cell(1, 1), Cell(2, 2), Cell(3, 2), Cell(4, 1), Cell(5, 0))
    state, _ = step(returning(past), ground(), Cell(2, 2), unused)
    assert state.past == past[:3]


SPUR = (*(Cell(x, 0) for x in range(10)), *(Cell(x, 2) for x in range(9, 3, -1)))
"""To the east, and beside that back to the west."""
STRAIGHT = (Cell(0, 0), Cell(1, 1), Cell(2, 1), Cell(3, 2))


@pytest.mark.parametrize(("resolution_m", "left"), [(0.2, STRAIGHT), (1.0, (*SPUR, Cell(3, 2)))])
def test_returning_over_small_fields_a_spur_beside_the_past_path_is_left_out(resolution_m, left):
    grid = Grid(ground().weights, resolution_m)
    state, decision = step(returning(SPUR), grid, Cell(3, 2), unused)
    assert state.past == left and decision.path == left[::-1]


def test_returning_over_small_fields_no_spur_is_left_out_through_a_wall():
    grid = Grid(ground("..........", "##########", "..........").weights, 0.2)
    state, _ = step(returning(SPUR), grid, Cell(3, 2), Scripted(NEVER))
    assert state.past == (*SPUR, Cell(3, 2))


@pytest.mark.parametrize("resolution_m, mended", [(0.2, True), (1.0, False)])
def test_small_fields_of_the_past_path_are_looked_at_farther_ahead(resolution_m, mended):
    """What blocks it four fields ahead is 0.8 m away, or 4 m."""
    grid = Grid(ground("..........", "..........", "..#.......").weights, resolution_m)
    _, decision = step(returning(ROW[:7]), grid, ROW[6], Scripted(NEVER) if mended else unused)
    assert (decision.reason is not DecisionReason.GOING_BACK) == mended


# --- the way back is blocked (ours) ----------------------------------------------------------------------------------


def test_a_blocked_past_path_is_mended_through_the_nearest_past_field():
    grid = ground("..........", "..........", "....#.....")
    round_it = path((5, 0), (5, 1), (4, 1), (3, 1), (3, 0))
    search = Scripted(round_it)
    state, decision = step(returning(ROW[:6]), grid, ROW[5], search)
    assert search.asked == [(THOROUGH, ROW[5], ROW[3])]
    assert decision.action is Action.BACKTRACK and decision.searches == (THOROUGH,)
    assert state.past == ROW[:3] + round_it.cells[::-1] and decision.path == state.past[::-1]
    assert is_walk(state.past)


def test_mending_tries_farther_past_fields_and_at_last_the_start():
    past = tuple(Cell(x, 0) for x in range(60))
    weights = np.full((3, 70), 0.5)
    weights[0, 58] = 1.0
    search = Scripted(NEVER)
    state, decision = step(NavState(Cell(69, 0), past, returning=True, until_search=2), Grid(weights), past[-1], search)
    asked = [target.x for _, _, target in search.asked]
    assert decision.action is Action.UNREACHABLE
    assert asked[:2] == [57, 56] and asked[-1] == 0 and asked == sorted(set(asked), reverse=True)
    assert len(asked) <= 12 and state.past == past


def test_a_search_for_the_target_comes_before_mending_when_it_is_due():
    grid = ground("..........", "..........", "....#.....")
    search = Scripted(NEVER, path((5, 0), (5, 1), (4, 1), (3, 1), (3, 0)))
    _, decision = step(returning(ROW[:7], until_search=1), grid, ROW[5], search)
    assert [(kind, target) for kind, _, target in search.asked] == [(RETURN, TARGET), (THOROUGH, ROW[3])]
    assert decision.searches == (RETURN, THOROUGH)


# --- part B: exploration (4.4, figure 13) ----------------------------------------------------------------------------


def test_exploring_follows_the_current_path_and_looks_for_a_better_one_every_five_fields():
    state, search, looked = exploring(0), Scripted(NEVER), []
    target = Cell(19, 0)
    row = tuple(Cell(x, 0) for x in range(20))
    state = replace(state, target=target, current=Path(row, 9.5))
    for x in range(1, 19):
        before = len(search.asked)
        state, decision = step(state, Grid(np.full((3, 20), 0.5)), row[x], search)
        assert decision.action is Action.FOLLOW and decision.path == row[x:]
        if len(search.asked) > before:
            looked.append(x)
    assert looked == [5, 10, 15] and set(search.kinds) == {BETTER}
    assert state.past == row[:19]


def test_looking_again_from_the_same_field_does_not_bring_the_look_for_a_better_path_nearer():
    state = exploring(3, since_better=3)
    for _ in range(5):
        state, decision = step(state, ground(), ROW[3], unused)
        assert decision.part is Part.EXPLORE


def test_a_new_path_is_followed_for_five_fields_before_the_next_look():
    state = exploring(1, since_better=4)
    blocked = ground("..........", "..........", ".....#....")
    found = path((2, 0), (3, 1), (4, 1), (5, 1), (6, 1), (7, 1), (8, 1), (9, 0))
    state, decision = step(state, blocked, ROW[2], Scripted(found))
    assert decision.part is Part.SEARCH
    for x in (3, 4, 5, 6):
        state, decision = step(state, blocked, Cell(x, 1), unused)
    search = Scripted(NEVER)
    step(state, blocked, Cell(7, 1), search)
    assert search.kinds == [BETTER]


def test_a_way_driven_before_is_gone_back_through_fields_that_were_marked_then_and_no_others():
    beside = ground("..........", "..........", "....#.....")
    driven = frozenset(step for step in pairwise(ROW) if not is_clear(beside, step))
    assert len(driven) > 0
    state = retrace(initial_state(ROW[0], TARGET), ROW, driven)
    state, decision = step(state, beside, ROW[1], unused)
    assert decision.part is Part.EXPLORE and decision.path == ROW[1:]
    shut = ground("..........", "..........", "....#.#...")
    _, decision = step(state, shut, ROW[2], Scripted(NEVER))
    assert decision.part is not Part.EXPLORE


def test_the_number_of_fields_between_looks_is_a_setting():
    state = replace(initial_state(ROW[0], TARGET, better_every=2), current=Path(ROW, 4.5))
    search = Scripted(NEVER)
    for x in range(1, 7):
        state, _ = step(state, ground(), ROW[x], search)
    assert [start.x for _, start, _ in search.asked] == [2, 4, 6]


def test_a_corner_that_was_cut_though_it_was_marked_is_cut_again():
    way = (Cell(0, 0), Cell(1, 0), Cell(2, 1), Cell(3, 1))
    marked = ground("..#.......", "..........")
    state = retrace(initial_state(way[0], Cell(3, 1)), way, frozenset({(way[1], way[2])}))
    state, decision = step(state, marked, way[1], unused)
    assert decision.part is Part.EXPLORE and decision.path == way[1:]
    assert not is_clear(marked, way) and is_clear(marked, way, state.driven)
    assert not is_clear(marked, tuple(reversed(way)), state.driven), "another step"


@pytest.mark.parametrize(("cost", "taken"), [(1.99, True), (2.0, False), (3.0, False)])
def test_better_is_compared_with_what_remains_of_the_current_path(cost, taken):
    """Of the current path 4 fields of weight 0.5 remain: 2.0, though it began with a cost of 4.5."""
    result = path((5, 0), (6, 1), (7, 1), (8, 1), (9, 0), cost=cost)
    state, decision = step(exploring(4, since_better=4), ground(), ROW[5], Scripted(result))
    assert (state.current is result) == taken
    assert decision.path == (result.cells if taken else ROW[5:])
    assert (decision.new_path is result) == taken and state.since_better == 0


def test_what_remains_costs_what_the_map_says_now():
    """Costly ground seen on the way makes a path better that was not."""
    result = path((5, 0), (6, 1), (7, 1), (8, 1), (9, 0), cost=2.5)
    costly = ground("..........", "..........", ".......9..")
    assert path_cost(costly.weights, ROW[5:]) > 2.3
    _, kept = step(exploring(4, since_better=4), ground(), ROW[5], Scripted(result))
    costlier = ground("..........", "..........", ".......999")
    _, changed = step(exploring(4, since_better=4), costlier, ROW[5], Scripted(result))
    assert kept.new_path is None and changed.new_path is result


def test_stepping_off_the_path_to_a_field_beside_it_keeps_it():
    state, decision = step(exploring(3), ground(), Cell(4, 1), unused)
    assert decision.path in (ROW[3:], ROW[4:], ROW[5:]) and state.past == (*ROW[:4], Cell(4, 1))


def test_leaving_the_path_means_a_new_search():
    search = Scripted(path((4, 3), (5, 2), (6, 1), (7, 0), (8, 0), (9, 0)))
    state, decision = step(exploring(3), ground(), Cell(4, 3), search)
    assert search.asked == [(THOROUGH, Cell(4, 3), TARGET)] and decision.part is Part.SEARCH
    assert is_walk(state.past), "fields that were jumped over are filled in"


# --- part C: search (4.5, figure 14) ---------------------------------------------------------------------------------


def test_a_blocked_path_is_replaced_in_the_same_field():
    grid = ground("..........", "..........", "......#...")
    found = path((3, 0), (4, 1), (5, 1), (6, 1), (7, 1), (8, 1), (9, 0))
    state, decision = step(exploring(3), grid, ROW[3], Scripted(found))
    assert decision.part is Part.SEARCH and decision.reason is DecisionReason.PATH_BLOCKED and state.current is found


def test_an_obstacle_behind_the_rover_does_not_block():
    _, decision = step(exploring(3), ground("..........", "..........", ".#........"), ROW[4], unused)
    assert decision.part is Part.EXPLORE


def test_in_vain_the_past_path_is_simplified_and_part_a_follows_in_the_same_step():
    loop = (Cell(0, 0), Cell(1, 0), Cell(2, 0), Cell(2, 1), Cell(1, 1), Cell(1, 0), Cell(2, 0), Cell(3, 0))
    search = Scripted(NEVER)
    state, decision = step(NavState(TARGET, loop, draws=5), ground(), Cell(3, 0), search)
    assert search.kinds == [THOROUGH] and decision.searches == (THOROUGH,)
    assert state.returning and state.current is None and state.until_search in (2, 3)
    assert state.past == ROW[:4] and decision.path == ROW[3::-1] and decision.part is Part.RETURN


def test_in_vain_at_the_start_is_unreachable_in_the_same_step():
    search = Scripted(PROVED)
    _, decision = step(initial_state(ROW[0], TARGET), ground(), ROW[0], search)
    assert decision.action is Action.UNREACHABLE and decision.proved
    assert decision.searches == (THOROUGH, THOROUGH) == tuple(search.kinds)


def test_in_vain_at_the_start_the_last_search_may_still_find_a_path():
    _, decision = step(initial_state(ROW[0], TARGET), ground(), ROW[0], Scripted(NEVER, Path(ROW, 4.5)))
    assert decision.action is Action.FOLLOW and not decision.proved


def test_a_proof_is_passed_on():
    _, decision = step(exploring(3), ground(), ROW[3], unused)
    assert not decision.proved
    _, decision = step(abandon_path(exploring(3)), ground(), ROW[3], Scripted(PROVED))
    assert decision.action is Action.BACKTRACK and decision.proved


# --- section 4.6, and the helpers ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("walk", "without_loops"),
    [
        ("a", "a"),
        ("abc", "abc"),
        ("abab", "ab"),
        ("abcbd", "abd"),
        ("abcabd", "abd"),
        ("abcdcbe", "abe"),
        ("abcdbefbg", "abg"),
        ("abca", "a"),
    ],
)
def test_simplification_cuts_between_visits_of_one_field(walk, without_loops):
    fields = {letter: Cell(i, 0) for i, letter in enumerate("abcdefg")}
    assert simplified(tuple(fields[x] for x in walk)) == tuple(fields[x] for x in without_loops)


@pytest.mark.parametrize(
    ("rows", "cells", "clear"),
    [
        (("...", "..."), [(0, 0), (1, 1), (2, 0)], True),
        (("...", "#.."), [(0, 0), (1, 0), (2, 0)], True),
        (("...", ".#."), [(0, 0), (1, 0), (2, 0)], False),
        (("...", ".#."), [(0, 0), (1, 1)], False),
        (("#..", "..."), [(0, 0), (1, 1)], False),
        (("...", "..."), [(1, 1), (2, 2)], False),
        (("...", "..."), [(1, 0), (0, -1)], False),
        (("###", "###"), [(1, 1)], True),
        (("###", "###"), [], True),
    ],
    ids=["free", "first-is-here", "ahead", "corner", "other-corner", "outside", "negative", "one", "none"],
)
def test_is_clear(rows, cells, clear):
    assert is_clear(ground(*rows), tuple(Cell(*cell) for cell in cells)) is clear


def test_step_leaves_what_it_was_given_alone():
    grid = ground("..........", "..........", "......#...")
    state, weights = exploring(3), grid.weights.copy()
    before = replace(state)
    step(state, grid, ROW[4], Scripted(NEVER))
    assert np.array_equal(grid.weights, weights)
    assert (state.past, state.index, state.returning) == (before.past, before.index, before.returning)


def is_walk(cells: tuple[Cell, ...]) -> bool:
    return all(max(abs(a.x - b.x), abs(a.y - b.y)) == 1 for a, b in pairwise(cells))
