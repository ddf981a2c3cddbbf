"""Compiled: which command may be the last one, because the rover that is left alone with it stands in time.

It is held for as long as a velocity lasts, and then the rover brakes; all the way there the outline must lie over
ground that is free and seen, however much the rover turns. Places and headings are those of ``motion_kernels``.

Nouns: turnings, spare.
"""

# mypy: disable-error-code="no-untyped-def"

import math

import numpy as np
from numba import njit

from companion.control.motion_kernels import (
    AS_AT_EDGE,
    BETWEEN_CELLS,
    FAR_M,
    at_place,
    discs_clear_m,
    least_allowed_m,
    speed_after,
    still_allowed_m,
    turned,
)

ENDLESS = 600
"""Steps: a rover that takes longer to stop may not be left alone with anything."""
SLOWEST = 1e-6
"""m/s² and rad/s²: one that brakes no better does not stop."""
TURNING = 6
"""What is known of a turning rover after a step: sine and cosine of its heading on average and at the end of the step,
by how much it has turned in it (rad) and how fast it turns then (rad/s)."""
TRIED = 10
"""So many speeds are tried, the slower the closer."""
HALVED = 3
"""So many times the step between two of them is halved: with 2 m/s next to 1.6, 1.9 would be lost."""


@njit(cache=True, nogil=True)
def _turnings(told_rad_s, held, gains, fastest_m_s, problem):
    """How a rover turns that is told a turn rate for ``held`` steps and then to stand, one row a step.

    Shape (gains, steps, ``TURNING``): it turns by each of the factors ``gains`` more than told. How fast it goes does
    not matter for that: so all speeds share one, and no sine is found twice. The steps are enough for a rover that is
    no faster than ``fastest_m_s`` to stand.
    """
    start, model, pending, step_s = problem.start, problem.model, problem.pending, problem.step_s
    early = pending.shape[0]
    fastest_m_s, fastest_rad_s = max(fastest_m_s, abs(start.speed_m_s)), abs(told_rad_s)
    for step in range(early):
        fastest_m_s = max(fastest_m_s, abs(pending[step, 0]))
        fastest_rad_s = max(fastest_rad_s, abs(pending[step, 1]))
    fastest_rad_s = max(model.turn_gain * max(gains) * fastest_rad_s, abs(start.turn_rad_s))
    stands_s = max(fastest_m_s / max(model.decel_m_s2, SLOWEST), fastest_rad_s / max(model.turn_accel_rad_s2, SLOWEST))
    steps = early + held + int(min(stands_s / step_s + 2.0, ENDLESS + 1.0))
    rows = np.empty((len(gains), steps, TURNING))
    for at, factor in enumerate(gains):
        heading, turn = start.heading_rad, start.turn_rad_s
        for step in range(steps):
            now_rad_s = 0.0
            if step < early:
                now_rad_s = pending[step, 1]
            elif step < early + held:
                now_rad_s = told_rad_s
            before, turned_before = heading, turn
            middle, heading, turn = turned(heading, turn, factor * now_rad_s, model, step_s)
            row = rows[at, step]
            if step > 0 and turned_before == 0.0 and turn == 0.0:  # as the step before: no sine is needed
                row[0] = row[2] = rows[at, step - 1, 2]
                row[1] = row[3] = rows[at, step - 1, 3]
            else:
                row[0], row[1] = math.sin(middle), math.cos(middle)
                row[2], row[3] = math.sin(heading), math.cos(heading)
            row[4], row[5] = abs(heading - before), abs(turn)
    return rows


@njit(cache=True, nogil=True)
def _spare_m(told_m_s, held, turning, margin_m, margin_s, problem, least_m, most_m):
    """How much more room than it must keep a rover has that is left alone, at the worst place; below 0 it may not be.

    It is told a speed for ``held`` steps and then to stand, and turns as ``turning`` says, one of ``_turnings``. It
    must keep ``margin_m``, and ``margin_s`` more for each m/s, over ground that is free and seen.
    ``most_m`` where it is more. Exact from ``least_m`` on: where it is surely less, the rest of the way is not looked
    at. Where it is surely more than ``most_m``, the rover is followed without a look until it may have come nearer.
    """
    start, ground, body, model = problem.start, problem.ground, problem.body, problem.model
    pending, step_s = problem.pending, problem.step_s
    gap_m, seen_m, cell_m = ground.gap_m, ground.seen_m, ground.cell_m
    x, y, speed, turn = start.x_m, start.y_m, start.speed_m_s, start.turn_rad_s
    early, side_m = pending.shape[0], body.around_m - body.radius_m
    sine, cosine = math.sin(start.heading_rad), math.cos(start.heading_rad)
    still = least_allowed_m(discs_clear_m(gap_m, cell_m, body, x, y, sine, cosine, AS_AT_EDGE))
    still_seen = least_allowed_m(discs_clear_m(seen_m, cell_m, body, x, y, sine, cosine, 0.0))
    fastest_m_s = max(abs(start.speed_m_s), abs(told_m_s))
    for before in range(early):
        fastest_m_s = max(fastest_m_s, abs(pending[before, 0]))
    between_m = BETWEEN_CELLS * cell_m
    roomy_m = margin_m + margin_s * fastest_m_s + most_m + between_m
    step, spare, sure_m = 0, most_m, 0.0
    while step < early + held or abs(speed) > 0.02 or abs(turn) > 0.02:
        if step == turning.shape[0]:
            return -FAR_M
        now_m_s = 0.0
        if step < early:
            now_m_s = pending[step, 0]
        elif step < early + held:
            now_m_s = told_m_s
        speed, turn = speed_after(speed, now_m_s, model, step_s), turning[step, 5]
        x, y = x + speed * step_s * turning[step, 0], y + speed * step_s * turning[step, 1]
        sine, cosine = turning[step, 2], turning[step, 3]
        sure_m -= abs(speed) * step_s + side_m * turning[step, 4]
        step += 1
        if sure_m > 0.0:
            continue
        # The circle round the outline first: mostly that is enough.
        most_room_m = margin_m + margin_s * abs(speed)
        clear_seen_m = at_place(seen_m, cell_m, x, y, 0.0) - body.around_m
        sure_m = clear_seen_m - roomy_m
        if clear_seen_m - between_m - most_room_m >= spare:
            continue
        clear_seen_m = discs_clear_m(seen_m, cell_m, body, x, y, sine, cosine, 0.0)
        sure_m = max(sure_m, clear_seen_m - roomy_m)
        # What stands is no nearer than what is unseen.
        if clear_seen_m - most_room_m >= spare:
            continue
        clear_m = discs_clear_m(gap_m, cell_m, body, x, y, sine, cosine, AS_AT_EDGE)
        room_m = min(most_room_m, still_allowed_m(still, start, (x, y)))
        spare = min(spare, clear_m - room_m, clear_seen_m - min(margin_m, still_seen))
        if spare < least_m:
            break
    return spare


@njit(cache=True, nogil=True)
def _way_it_may_not(told_m_s, held, turnings, margin_m, margin_s, problem, first):
    """One of these ways to turn in which a rover that is told this may not be left alone; -1 if it may in all.

    The way numbered ``first`` is looked at first: what is told next mostly fails in the same way.
    """
    ways = turnings.shape[0]
    for nth in range(ways):
        way = (first + nth) % ways
        if _spare_m(told_m_s, held, turnings[way], margin_m, margin_s, problem, 0.0, 0.0) < 0.0:
            return way
    return -1


@njit(cache=True, nogil=True)
def _steps(lasts_s, problem):
    return int(math.ceil(lasts_s / problem.step_s))


@njit(cache=True, nogil=True)
def admitted_speeds(turns_rad_s, lasts_s, gains, margin_m, margin_s, problem):
    """The fastest speeds at these turn rates, forwards and backwards, shape (n, 2), that may be the last command.

    Whether the rover turns by any of the factors ``gains``. A few speeds are tried, and then some between the fastest
    of them that may be told and the next.
    """
    model, held, hardest = problem.model, _steps(lasts_s, problem), 0
    fastest_m_s = max(model.fastest_m_s, model.backwards_m_s)
    admitted = np.zeros((turns_rad_s.size, 2))
    for at in range(turns_rad_s.size):
        turnings = _turnings(turns_rad_s[at], held, gains, fastest_m_s, problem)
        for side in range(2):
            most = model.fastest_m_s if side == 0 else -model.backwards_m_s
            share, step = 1.0, 1.0 / TRIED
            while share > 0.5 * step:
                way = _way_it_may_not(most * share * share, held, turnings, margin_m, margin_s, problem, hardest)
                if way < 0:
                    break
                hardest = way
                share -= step
            if share < 0.5 * step:
                continue
            if share < 1.0 - 0.5 * step:
                for _ in range(HALVED):
                    step *= 0.5
                    faster = share + step
                    tried = most * faster * faster
                    way = _way_it_may_not(tried, held, turnings, margin_m, margin_s, problem, hardest)
                    if way < 0:
                        share = faster
                    else:
                        hardest = way
            admitted[at, side] = abs(most * share * share)
    return admitted


@njit(cache=True, nogil=True)
def may_be_last(told_m_s, told_rad_s, lasts_s, gains, margin_m, margin_s, problem):
    """Whether a command may be the last: held so long, then braked, it leads over ground that is free and seen.

    The rover keeps ``margin_m``, and ``margin_s`` more for each m/s, whether it turns by any of the factors ``gains``.
    """
    held = _steps(lasts_s, problem)
    turnings = _turnings(told_rad_s, held, gains, abs(told_m_s), problem)
    return _way_it_may_not(told_m_s, held, turnings, margin_m, margin_s, problem, 0) < 0


@njit(cache=True, nogil=True)
def spare_m(told_m_s, told_rad_s, lasts_s, gains, margin_m, margin_s, problem, least_m=-math.inf, most_m=FAR_M):
    """How much more room than it must keep such a rover has, at the worst place.

    ``most_m`` where it is more; exact only from ``least_m`` on.
    """
    held = _steps(lasts_s, problem)
    turnings = _turnings(told_rad_s, held, gains, abs(told_m_s), problem)
    spare = most_m
    for way in range(len(gains)):
        spare = min(spare, _spare_m(told_m_s, held, turnings[way], margin_m, margin_s, problem, least_m, most_m))
        if spare < least_m:
            break
    return spare


@njit(cache=True, nogil=True)
def braking_spares_m(turns_rad_s, lasts_s, gains, most_m, problem):
    """``spare_m`` of a rover that is told to stand and to turn, for each turn rate; ``most_m`` where it is more."""
    spares = np.empty(turns_rad_s.size)
    for at in range(turns_rad_s.size):
        spares[at] = spare_m(0.0, turns_rad_s[at], lasts_s, gains, 0.0, 0.0, problem, -math.inf, most_m)
    return spares
