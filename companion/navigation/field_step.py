"""The navigator's decision in each field entered: follow, replan or go back (Kwasniewski & Gosiewski 2018, section 4).

``step`` is a pure function. Part A goes back out of a dead end, along the past path, and searches every second or
third field. Part B follows the current path and searches for a better one every few fields. Part C searches thoroughly
when the current path is blocked or missing (figures 10 to 14).

Where the paper leaves a choice: the retraced end of the past path is dropped while returning, so it is always a walk
from the start to here. "Better" compares with the rest of the current path. A blocked past path is repaired by a search
for the nearest past field that can still be reached. At the start a last thorough search precedes "unreachable".

Nouns: navigator, part, decision, dead end, past path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import compress, pairwise

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import Cell, Grid
from companion.planning.problem import Path, PlanResult, PlanStatus
from companion.planning.raster import CellArray, cells_cost, first_fault, plain

BACKTRACK_TRIES = 8
SMALL_M, SPUR_M, SPUR_RATIO = 0.5, 3.0, 3
"""With fields so small the rover leaves out, on its way back, what it drove between two places so near to each other,
if that is so many times as long as the straight way."""
AHEAD_M = 2.0
"""So far ahead the way back must be clear."""
NEVER = 2**62


class Part(StrEnum):
    """The three parts of the step function (section 4.2)."""

    RETURN = "A"
    EXPLORE = "B"
    SEARCH = "C"


class SearchKind(StrEnum):
    """How the planner is to search: quickly (parts A and B) or thoroughly (part C)."""

    RETURN = "return"
    BETTER = "better"
    THOROUGH = "thorough"


class Action(StrEnum):
    """What the rover is to do next."""

    FOLLOW = "follow"
    BACKTRACK = "backtrack"
    REACHED = "reached"
    UNREACHABLE = "unreachable"


Steps = frozenset[tuple[Cell, Cell]]
"""Steps from a field to a neighbour."""

Search = Callable[[SearchKind, Cell, Cell], PlanResult]
"""Find a path from the first field to the second."""


class DecisionReason(StrEnum):
    """Why the navigator decides so."""

    REACHED = "target reached"
    FOUND_GOING_BACK = "path found on the way back"
    NO_PATH_LEFT = "back at the start, and no path is known to be left"
    GOING_BACK = "going back along the past path"
    FOLLOWING = "following the current path"
    BETTER_PATH = "a better path"
    NO_BETTER_PATH = "no better path"
    PATH_BLOCKED = "current path blocked: new path"
    NEW_PATH = "new path"
    PAST_PATH_BLOCKED = "past path blocked: going back another way"
    SHUT_IN = "shut in: no way back either"


@dataclass(frozen=True, eq=False, slots=True)
class NavState:
    """The navigator's state on the way to one target.

    ``past``: the walk from the start to the last field entered. ``current``: the path that is followed; ``index``: the
    rover's place on it. ``returning``: part A. ``until_search``: fields until its next search. ``since_better``: fields
    since the last search for a better path, ``better_every``: after how many it is due. ``draws``: state of the random
    choice of two or three. ``driven``: steps that the map bars, but not the track that the rover left there: it passed
    beside what stands there.
    """

    target: Cell
    past: tuple[Cell, ...]
    current: Path | None = None
    index: int = 0
    returning: bool = False
    until_search: int = 0
    since_better: int = 0
    draws: int = 0
    better_every: int = 5
    driven: Steps = frozenset()


@dataclass(frozen=True, eq=False, slots=True)
class Decision:
    """What to do and why. ``path`` begins at the field entered or a neighbour; empty when there is nowhere to go."""

    action: Action
    part: Part
    path: tuple[Cell, ...]
    new_path: Path | None
    reason: DecisionReason
    searches: tuple[SearchKind, ...] = ()
    proved: bool = False
    """True if the last search proved that the map as known has no path."""


def initial_state(start: Cell, target: Cell, seed: int = 0, better_every: int = 5) -> NavState:
    """The state before the first step towards a target."""
    return NavState(target=target, past=(start,), draws=seed, better_every=better_every)


def step(state: NavState, grid: Grid, cell: Cell, search: Search) -> tuple[NavState, Decision]:
    """The step function (figure 11). Call it when a field is entered and when the path ahead gets blocked."""
    entered = cell != state.past[-1]
    state = arrived(state, cell)
    if cell == state.target:
        return state, Decision(Action.REACHED, Part.EXPLORE, (), None, DecisionReason.REACHED)
    if state.returning:
        return _return(state, grid, search, entered=entered)
    if follows_clear_path(state, grid):
        return _explore(state, grid, search, entered=entered)
    return _search(state, grid, search)


def retrace(state: NavState, way: tuple[Cell, ...], driven: Steps = frozenset()) -> NavState:
    """Follow fields from here to the target that were driven before, without better paths, while they are clear.

    ``driven``: steps that may be driven again though the map bars them.
    """
    return replace(state, current=Path(way, 0.0), index=0, better_every=NEVER, driven=driven)


def abandon_path(state: NavState) -> NavState:
    """Drop the current path (the rover could not follow it), so that the next step searches anew."""
    return replace(state, current=None)


def follows_clear_path(state: NavState, grid: Grid) -> bool:
    """Whether there is a current path, and what is left of it is clear."""
    return state.current is not None and is_clear(grid, state.current.cell_array[state.index :], state.driven)


def way_back_is_clear(state: NavState, grid: Grid, fields: int) -> bool:
    """Whether the next fields of the past path are clear: so many, with the rover's own, and all in ``AHEAD_M``."""
    fields = max(fields, round(AHEAD_M / grid.resolution_m))
    return is_clear(grid, state.past[: -fields - 1 : -1])


def is_clear(grid: Grid, cells: CellArray | tuple[Cell, ...], driven: Steps = frozenset()) -> bool:
    """Whether none of these fields but the first (where the rover is) is an obstacle, and no step cuts a corner.

    Steps in ``driven`` are clear.
    """
    if len(cells) < 2 or first_fault(plain(grid.weights), np.asarray(cells), False)[0] == 0:
        return True
    barred = _barred(grid, cells)  # which steps they are, and the field where the rover is may be an obstacle
    return not barred.any() or driven.issuperset(_steps(cells, barred))


def _steps(cells: CellArray | tuple[Cell, ...], chosen: NDArray[np.bool_]) -> Iterator[tuple[Cell, Cell]]:
    fields = [Cell(int(x), int(y)) for x, y in cells]
    return compress(pairwise(fields), chosen)


def _barred(grid: Grid, cells: CellArray | tuple[Cell, ...]) -> NDArray[np.bool_]:
    """For each step whether it leads into an obstacle, cuts a corner of one, or leaves the map (then all do)."""
    x, y = np.asarray(cells).T
    if x.min() < 0 or y.min() < 0 or x.max() >= grid.width or y.max() >= grid.height:
        return np.ones(len(x) - 1, dtype=np.bool_)
    ahead = grid.weights[y[1:], x[1:]]
    corners = np.maximum(grid.weights[y[:-1], x[1:]], grid.weights[y[1:], x[:-1]])
    diagonal = (x[1:] != x[:-1]) & (y[1:] != y[:-1])
    barred: NDArray[np.bool_] = (ahead >= 1.0) | (diagonal & (corners >= 1.0))
    return barred


def simplified(past: tuple[Cell, ...]) -> tuple[Cell, ...]:
    """The past path without its loops (section 4.6): from each field on, jump to where it was last visited."""
    last = {cell: i for i, cell in enumerate(past)}
    result = []
    i = 0
    while i < len(past):
        result.append(past[i])
        i = last[past[i]] + 1
    return tuple(result)


def _return(state: NavState, grid: Grid, search: Search, *, entered: bool) -> tuple[NavState, Decision]:
    """Part A (figure 12): search if it is due, else one more field back."""
    searches: tuple[SearchKind, ...] = ()
    if entered:
        state = replace(state, past=_without_spur(state.past, grid))
    at_start = len(state.past) == 1
    due = state.until_search - (1 if entered else 0)
    proved = False
    if due <= 0 or at_start:
        kind = SearchKind.THOROUGH if at_start else SearchKind.RETURN
        result = search(kind, state.past[-1], state.target)
        searches = (kind,)
        proved = result.status is PlanStatus.NO_PATH
        if result.path is not None:
            return _follow_new(state, result.path, Part.RETURN, searches, DecisionReason.FOUND_GOING_BACK)
        draws, due = _two_or_three(state.draws)
        state = replace(state, draws=draws)
    state = replace(state, until_search=due)
    if at_start:
        reason = DecisionReason.NO_PATH_LEFT
        return state, Decision(Action.UNREACHABLE, Part.RETURN, (), None, reason, searches, proved)
    if not way_back_is_clear(state, grid, 2):
        return _repair_past(state, grid, search, searches)
    return state, Decision(
        Action.BACKTRACK, Part.RETURN, state.past[::-1], None, DecisionReason.GOING_BACK, searches, proved
    )


def _explore(state: NavState, grid: Grid, search: Search, *, entered: bool) -> tuple[NavState, Decision]:
    """Part B (figure 13): follow the current path; every few fields take a better one if there is one."""
    assert state.current is not None
    ahead = state.current.cell_array[state.index :]
    passed = state.since_better + (1 if entered else 0)
    if passed < state.better_every:
        return replace(state, since_better=passed), _follow(state, DecisionReason.FOLLOWING, ())
    state = replace(state, since_better=0)
    result = search(SearchKind.BETTER, state.past[-1], state.target)
    searches = (SearchKind.BETTER,)
    if result.path is not None and result.path.cost < cells_cost(plain(grid.weights), ahead) - 1e-9:
        return _follow_new(state, result.path, Part.EXPLORE, searches, DecisionReason.BETTER_PATH)
    return state, _follow(state, DecisionReason.NO_BETTER_PATH, searches)


def _search(state: NavState, grid: Grid, search: Search) -> tuple[NavState, Decision]:
    """Part C (figure 14): search thoroughly. Without success: simplify the past path and continue with part A."""
    had_path = state.current is not None
    result = search(SearchKind.THOROUGH, state.past[-1], state.target)
    if result.path is not None:
        reason = DecisionReason.PATH_BLOCKED if had_path else DecisionReason.NEW_PATH
        return _follow_new(state, result.path, Part.SEARCH, (SearchKind.THOROUGH,), reason)
    draws, due = _two_or_three(state.draws)
    state = replace(state, current=None, past=simplified(state.past), returning=True, draws=draws, until_search=due)
    state, decision = _return(state, grid, search, entered=False)
    return state, replace(
        decision,
        searches=(SearchKind.THOROUGH, *decision.searches),
        proved=decision.proved or result.status is PlanStatus.NO_PATH,
    )


def _repair_past(
    state: NavState, grid: Grid, search: Search, searches: tuple[SearchKind, ...]
) -> tuple[NavState, Decision]:
    """The past path is blocked: search for the nearest past field that can be reached, and go back through it."""
    here = state.past[-1]
    free = [i for i in range(len(state.past) - 2, -1, -1) if not grid.is_obstacle(state.past[i])]
    tries = free[:2] + free[2 :: max(1, len(free) // BACKTRACK_TRIES)] + free[-1:]
    for i in dict.fromkeys(tries):
        result = search(SearchKind.THOROUGH, here, state.past[i])
        searches = (*searches, SearchKind.THOROUGH)
        if result.path is not None:
            past = state.past[:i] + result.path.cells[::-1]
            state = replace(state, past=past)
            return state, Decision(
                Action.BACKTRACK, Part.RETURN, past[::-1], None, DecisionReason.PAST_PATH_BLOCKED, searches
            )
    return state, Decision(Action.UNREACHABLE, Part.RETURN, (), None, DecisionReason.SHUT_IN, searches)


def _follow_new(
    state: NavState, path: Path, part: Part, searches: tuple[SearchKind, ...], reason: DecisionReason
) -> tuple[NavState, Decision]:
    state = replace(state, current=path, index=0, returning=False, since_better=0, until_search=0, driven=frozenset())
    return state, Decision(Action.FOLLOW, part, path.cells, path, reason, searches)


def _follow(state: NavState, reason: DecisionReason, searches: tuple[SearchKind, ...]) -> Decision:
    assert state.current is not None
    return Decision(Action.FOLLOW, Part.EXPLORE, state.current.cells[state.index :], None, reason, searches)


def arrived(state: NavState, cell: Cell) -> NavState:
    """Record the field entered on the past path (its retraced end is dropped in return mode) and the current path.

    A path that the rover is not beside any more is dropped.
    """
    if cell == state.past[-1]:
        return state
    if state.returning:
        return replace(state, past=_retraced(state.past, cell))
    past = state.past + fields_between(state.past[-1], cell) + (cell,)
    if state.current is None:
        return replace(state, past=past)
    index = _place_on(state.current.cell_array, state.index, cell)
    return replace(state, past=past, index=index, current=None if index < 0 else state.current)


def _retraced(past: tuple[Cell, ...], cell: Cell) -> tuple[Cell, ...]:
    """The past path up to its field nearest to the rover, and from there to the rover."""
    gaps = [max(abs(p.x - cell.x), abs(p.y - cell.y)) for p in past[:-1]]
    nearest = min(range(len(gaps)), key=lambda i: (gaps[i], -i), default=0)
    if not gaps:
        return (*past, *fields_between(past[-1], cell), cell)
    if gaps[nearest] == 0:
        return past[: nearest + 1]
    return (*past[: nearest + 1], *fields_between(past[nearest], cell), cell)


def _without_spur(past: tuple[Cell, ...], grid: Grid) -> tuple[Cell, ...]:
    """The past path without a spur at its end: straight to the rover from the earliest field where it began.

    Where fields are much smaller than the rover, it does not drive back through each of them. Beside its past path it
    leaves a new one, and would be led back to where it left the old one, and to and fro.
    """
    if grid.resolution_m > SMALL_M:
        return past
    reach, here = int(SPUR_M / grid.resolution_m), past[-1]
    for i, cell in enumerate(past):
        gap = max(abs(cell.x - here.x), abs(cell.y - here.y))
        if gap > reach or len(past) - 1 - i < SPUR_RATIO * max(gap, 1):
            continue
        straight = (here, *fields_between(here, cell), cell)
        if is_clear(grid, straight):
            return (*past[:i], *reversed(straight))
    return past


def _place_on(cells: CellArray, index: int, cell: Cell) -> int:
    """The index on the path of the field, else of its first neighbour, from ``index`` on; -1 if the path is lost."""
    gaps = np.abs(cells[index:] - cell).max(axis=1, initial=0)
    for reach in (0, 1):
        near = np.flatnonzero(gaps <= reach)
        if len(near) > 0:
            return index + int(near[0])
    return -1


def fields_between(a: Cell, b: Cell) -> tuple[Cell, ...]:
    """The fields strictly between two, 8-connected along the straight line (none when they are neighbours)."""
    n = max(abs(b.x - a.x), abs(b.y - a.y))
    return tuple(Cell(a.x + round((b.x - a.x) * i / n), a.y + round((b.y - a.y) * i / n)) for i in range(1, n))


def _two_or_three(draws: int) -> tuple[int, int]:
    """The next random state, and two or three (section 4.3) with equal chance; a multiplicative congruential draw."""
    draws = (draws * 6364136223846793005 + 1442695040888963407) % 2**64
    return draws, 2 + (draws >> 33) % 2
