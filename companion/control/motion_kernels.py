"""Compiled motions: what becomes of a rover that follows a sequence of speeds and turn rates, and what that costs.

A motion is ``knots``, shape (n, 2): forward speed (m/s) and turn rate (rad/s, clockwise), told at equal times over the
horizon, with straight lines between them. Its cost is in seconds: how long it takes, what is then left to go, and what
is added for ground that is narrow or unseen, and for the time to turn and to gather speed at its end. Places are x
(east) and y (north) in metres from the corner of a ``MotionGround``; headings clockwise from north.

Nouns: motion, motion ground, rover model.
"""

# mypy: disable-error-code="no-untyped-def"

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

BLOCKED_S = 1e3
"""Added to the cost of a motion that touches something; more the earlier it does."""
NO_WAY_S = 60.0
"""The time left where no way is known to lead on."""
FAR_M = 10.0
"""No clearance is larger."""
ROOMY_M = 0.5
"""More room than this makes no difference."""
AS_AT_EDGE = math.nan
"""What stands at the edge of the ground that is looked at may go on beyond it."""
BEYOND_M = 0.3
"""The rover may stop so far beyond the end of its path."""
HASTE = 4.0
"""Seconds a second and m/s that the rover is too fast to stop there."""
ARRIVED_S = 0.1
"""With so little time left, the rest of a motion does not count."""
MOST_PIECES = 40
"""Of a braking distance that is looked at."""
NEARER_M, NEAREST_M = 0.01, -0.04
"""A rover that is too near to something may come nearer by the first, so that it gets away, but only down to the
second: else it would come nearer with every look."""
BETWEEN_CELLS = 1.5
"""Cells: a distance read between the middles of cells may be off by so much."""
AWAY = 0.1
"""One whose outline lies over something must get out of it by so much for each metre it goes: it may leave, but not
touch the next thing as deep."""


class MotionGround(NamedTuple):
    """The ground round the rover: rasters of one shape, a cell's side, and a raster of coarser cells.

    ``gap_m``: from a cell to the nearest obstacle. ``seen_m``: to the nearest obstacle or unseen place, such as the
    raster's edge. ``togo_s``: time left from a cell of ``togo_cell_m``; inf where no way leads. ``ends``: the rover
    stops where it is 0.
    """

    gap_m: Any
    seen_m: Any
    cell_m: float
    togo_s: Any
    togo_cell_m: float
    ends: bool


class RoverModel(NamedTuple):
    """How the autopilot and the rover follow commands: after ``dead_s``, with limited changes, within limits.

    ``turn_gain``: they turn by this factor more than told.
    """

    dead_s: float
    accel_m_s2: float
    decel_m_s2: float
    turn_accel_rad_s2: float
    fastest_m_s: float
    backwards_m_s: float
    turn_fastest_rad_s: float
    turn_gain: float


class Body(NamedTuple):
    """The rover's outline: discs so far ahead of its place, all of one radius, and the circle round them all."""

    ahead_m: Any
    radius_m: float
    around_m: float


class Weights(NamedTuple):
    """What the cost of a motion is made of.

    ``margin_m``: kept from obstacles, and ``margin_s`` more for each m/s; ``tight``: seconds a second at no room in it.
    ``near_m``: risk counts below this clearance;
    ``risk``: seconds a second at none. ``unseen``: seconds a second on unseen ground. ``turn``: seconds for each radian
    that the rover does not yet point where it must go. ``change``: seconds for a first command that differs from the
    last one by 1 m/s or 1 rad/s. ``late``: seconds for each second on the way and each second that is left from there:
    of two motions with the same end the one that is near it sooner costs less. Else the rover would put off what it
    could do now, and again the next time. ``in_line``: seconds for each second that the front of a long rover is later
    on its way at the end than if it pointed along it.
    """

    margin_m: float
    margin_s: float
    tight: float
    near_m: float
    risk: float
    unseen: float
    turn: float
    change: float
    late: float
    in_line: float


class Start(NamedTuple):
    """The rover now: place, heading, forward speed (signed) and turn rate."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_m_s: float
    turn_rad_s: float


class MotionProblem(NamedTuple):
    """What motions are judged by.

    ``pending``: shape (n, 2), the commands told that have not had their effect yet, one a step.
    ``admitted_m_s``: shape (n, 2), the fastest speeds that may be told, forwards and backwards, at n turn rates evenly
    from the fastest to the left to the fastest to the right.
    """

    start: Start
    pending: Any
    ground: MotionGround
    body: Body
    model: RoverModel
    weights: Weights
    admitted_m_s: Any
    horizon_s: float
    step_s: float


@njit(cache=True, nogil=True, inline="always")
def at_place(raster, cell_m, x_m, y_m, outside):
    """A raster's value between the middles of four cells; off its edges ``outside``, or the value at the edge."""
    height, width = raster.shape
    x, y = x_m / cell_m - 0.5, y_m / cell_m - 0.5
    if math.isnan(outside):
        x, y = min(max(x, 0.0), width - 1.001), min(max(y, 0.0), height - 1.001)
    if not (x >= 0.0 and y >= 0.0 and x < width - 1 and y < height - 1):  # chained, these take longer
        return outside
    left, low = np.uintp(x), np.uintp(y)  # with a sign, each index would be tried for counting from the end
    u, v = x - left, y - low
    return (1.0 - v) * ((1.0 - u) * raster[low, left] + u * raster[low, left + 1]) + v * (
        (1.0 - u) * raster[low + 1, left] + u * raster[low + 1, left + 1]
    )


@njit(cache=True, nogil=True, inline="always")
def clearance_m(raster, cell_m, body, x_m, y_m, heading_rad, outside_m=AS_AT_EDGE):
    """Metres between the rover's outline and what a raster of distances counts from; not exact above ``ROOMY_M``."""
    # The outline lies in one circle: most places need no closer look.
    nearest = at_place(raster, cell_m, x_m, y_m, outside_m) - body.around_m
    if nearest > ROOMY_M:
        return nearest
    return discs_clear_m(raster, cell_m, body, x_m, y_m, math.sin(heading_rad), math.cos(heading_rad), outside_m)


@njit(cache=True, nogil=True, inline="always")
def discs_clear_m(raster, cell_m, body, x_m, y_m, sine, cosine, outside_m):
    """``clearance_m`` by a closer look, for a heading with this sine and cosine."""
    nearest = FAR_M
    for disc in range(body.ahead_m.size):
        ahead_m = body.ahead_m[disc]
        nearest = min(nearest, at_place(raster, cell_m, x_m + ahead_m * sine, y_m + ahead_m * cosine, outside_m))
    return nearest - body.radius_m


@njit(cache=True, nogil=True)
def least_allowed_m(now_m):
    """The clearance that a rover must keep which is too near to something: so near as it is now."""
    return min(max(now_m - NEARER_M, NEAREST_M), now_m)


@njit(cache=True, nogil=True, inline="always")
def still_allowed_m(least_m, start, state):
    """The clearance that such a rover must keep at a place on its way."""
    if least_m >= 0.0:
        return least_m
    return min(least_m + AWAY * math.hypot(state[0] - start.x_m, state[1] - start.y_m), 0.0)


@njit(cache=True, nogil=True, inline="always")
def told_at(knots, share):
    """The command at a share (0 to 1) of the horizon."""
    last = knots.shape[0] - 1
    at = min(max(share, 0.0), 1.0) * last
    low = min(int(at), last - 1)
    part = at - low
    return (
        knots[low, 0] + part * (knots[low + 1, 0] - knots[low, 0]),
        knots[low, 1] + part * (knots[low + 1, 1] - knots[low, 1]),
    )


@njit(cache=True, nogil=True, inline="always")
def _told_in(step, knots, pending, step_share):
    """The command that has its effect in a step: first those that were told before, then the motion's.

    ``step_share``: of the horizon.
    """
    early = pending.shape[0]
    if step < early:
        return pending[step, 0], pending[step, 1]
    return told_at(knots, (step - early) * step_share)


@njit(cache=True, nogil=True, inline="always")
def moved(state, told_m_s, told_rad_s, model, step_s):
    """The rover a step later: place, heading, speed, turn rate."""
    x, y, heading, speed, turn = state
    speed = speed_after(speed, told_m_s, model, step_s)
    middle, heading, turn = turned(heading, turn, told_rad_s, model, step_s)
    return x + speed * step_s * math.sin(middle), y + speed * step_s * math.cos(middle), heading, speed, turn


@njit(cache=True, nogil=True, inline="always")
def speed_after(speed, told_m_s, model, step_s):
    """The speed a step later."""
    change = told_m_s - speed
    most = (model.decel_m_s2 if change * speed < 0.0 else model.accel_m_s2) * step_s
    return speed + min(max(change, -most), most)


@njit(cache=True, nogil=True, inline="always")
def turned(heading, turn, told_rad_s, model, step_s):
    """The heading in the middle of a step, and heading and turn rate after it."""
    most_turn = model.turn_accel_rad_s2 * step_s
    after = turn + min(max(model.turn_gain * told_rad_s - turn, -most_turn), most_turn)
    return heading + 0.25 * (turn + after) * step_s, heading + 0.5 * (turn + after) * step_s, after


@njit(cache=True, nogil=True)
def cost_s(knots, problem):
    """The cost of a motion."""
    start, ground, body, model = problem.start, problem.ground, problem.body, problem.model
    pending, weights, step_s = problem.pending, problem.weights, problem.step_s
    # Taken out of their tuples once: in the loop that would take longer than all the rest.
    gap_m, seen_m, cell_m, ends = ground.gap_m, ground.seen_m, ground.cell_m, ground.ends
    togo_s, togo_cell_m, step_share = ground.togo_s, ground.togo_cell_m, step_s / problem.horizon_s
    state = (start.x_m, start.y_m, start.heading_rad, start.speed_m_s, start.turn_rad_s)
    early = pending.shape[0]
    steps = early + int(round(problem.horizon_s / step_s))
    extra = 0.0
    if early > 0:
        last = pending[early - 1]
        extra = weights.change * (abs(knots[0, 0] - last[0]) + abs(knots[0, 1] - last[1]))
    least = least_allowed_m(clearance_m(gap_m, cell_m, body, start.x_m, start.y_m, start.heading_rad, AS_AT_EDGE))
    first_s = left_s(togo_s, togo_cell_m, start.x_m, start.y_m)
    between_m = BETWEEN_CELLS * cell_m
    matters_m = max(weights.near_m, weights.margin_m + weights.margin_s * _fastest_m_s(knots, start, model)) + between_m
    sure_m = sure_seen_m = 0.0
    for step in range(steps):
        told_m_s, told_rad_s = _told_in(step, knots, pending, step_share)
        before_rad = state[2]
        state = moved(state, told_m_s, told_rad_s, model, step_s)
        x, y, heading, speed = state[0], state[1], state[2], abs(state[3])
        # No place of the outline went farther: where there was room enough, no look is needed.
        went_m = speed * step_s + (body.around_m - body.radius_m) * abs(heading - before_rad)
        sure_m -= went_m
        sure_seen_m -= went_m
        if sure_m <= 0.0:
            room = clearance_m(gap_m, cell_m, body, x, y, heading, AS_AT_EDGE)
            sure_m = room - matters_m
            if room < min(0.0, still_allowed_m(least, start, state)):
                return BLOCKED_S * (2.0 - step / steps) + left_s(togo_s, togo_cell_m, x, y)
            margin = weights.margin_m + weights.margin_s * speed
            if room < margin:
                extra += weights.tight * (1.0 - room / margin) * step_s
            if room < weights.near_m:
                short = 1.0 - max(room, 0.0) / weights.near_m
                extra += weights.risk * short * short * (0.3 + speed) * step_s
        if sure_seen_m <= 0.0 and weights.unseen > 0.0:
            clear_seen_m = clearance_m(seen_m, cell_m, body, x, y, heading, 0.0)
            sure_seen_m = clear_seen_m - between_m
            if clear_seen_m < 0.0:
                extra += weights.unseen * step_s
        left = left_s(togo_s, togo_cell_m, x, y)
        extra += weights.late * min(left, first_s + 1.0) * step_s
        if ends:
            stops_m_s = math.sqrt(2.0 * model.decel_m_s2 * (left * model.fastest_m_s + BEYOND_M))
            extra += HASTE * max(speed - stops_m_s, 0.0) * step_s
        if left < ARRIVED_S:
            return step * step_s + extra
    return steps * step_s + extra + _after_s(state, still_allowed_m(least, start, state), problem)


@njit(cache=True, nogil=True)
def _fastest_m_s(knots, start, model):
    """No faster does the rover get on a motion."""
    fastest = max(abs(start.speed_m_s), model.fastest_m_s)
    for knot in range(knots.shape[0]):
        fastest = max(fastest, abs(knots[knot, 0]))
    return fastest


@njit(cache=True, nogil=True)
def _after_s(state, least, problem):
    """What comes after the horizon: the way that is left, once the rover points along it and has gathered speed.

    From there it must be able to brake, too. Speed counts as far as it leads on: a rover that is fast before a bend
    must brake there. Else it would rather wait, and plan again and again to arrive at the bend fast.
    """
    model, weights, body = problem.model, problem.weights, problem.body
    ground = problem.ground
    gap_m, cell_m, togo_s, togo_cell_m = ground.gap_m, ground.cell_m, ground.togo_s, ground.togo_cell_m
    x, y, heading, speed = state[0], state[1], state[2], state[3]
    brakes_m = speed * abs(speed) / (2.0 * model.decel_m_s2)
    # In pieces that nothing fits between.
    pieces = min(max(int(math.ceil(abs(brakes_m) / body.radius_m)), 3), MOST_PIECES)
    for piece in range(1, pieces + 1):
        to_x = x + brakes_m * piece / pieces * math.sin(heading)
        to_y = y + brakes_m * piece / pieces * math.cos(heading)
        if clearance_m(gap_m, cell_m, body, to_x, to_y, heading, AS_AT_EDGE) < min(weights.margin_m, least):
            return BLOCKED_S + left_s(togo_s, togo_cell_m, x, y)
    left = left_s(togo_s, togo_cell_m, x, y)
    leads_on = 1.0
    if brakes_m > 0.0:
        gained = left - left_s(togo_s, togo_cell_m, x + brakes_m * math.sin(heading), y + brakes_m * math.cos(heading))
        leads_on = min(max(gained * model.fastest_m_s / brakes_m, 0.0), 1.0)
    lacks = model.fastest_m_s - leads_on * max(speed, 0.0)
    slow = lacks * lacks / (2.0 * model.accel_m_s2 * model.fastest_m_s)
    turned = weights.turn * _off_course_rad(togo_s, togo_cell_m, x, y, heading)
    turned += weights.in_line * _front_lags_s(left, x, y, heading, problem)
    return left + min(slow + turned, left + 1.0)


@njit(cache=True, nogil=True)
def long_m(body):
    """How far ahead of its place the front disc of a long rover lies; 0 for one that is hardly longer than wide."""
    front_m, rear_m = body.ahead_m.max(), body.ahead_m.min()
    return max(front_m, 0.0) if front_m - rear_m >= LONG * body.radius_m else 0.0


@njit(cache=True, nogil=True)
def _front_lags_s(left, x_m, y_m, heading_rad, problem):
    """How much later the front of a long rover is on its way than if it pointed along it.

    ``left``: the time that is left from its place.
    """
    ground, front_m = problem.ground, long_m(problem.body)
    if front_m == 0.0:
        return 0.0
    to_x, to_y = x_m + front_m * math.sin(heading_rad), y_m + front_m * math.cos(heading_rad)
    in_line_s = max(left - front_m / problem.model.fastest_m_s, 0.0)
    return max(left_s(ground.togo_s, ground.togo_cell_m, to_x, to_y) - in_line_s, 0.0)


@njit(cache=True, nogil=True, inline="always")
def left_s(togo_s, togo_cell_m, x_m, y_m):
    """The time that is left from a place, by a raster of it."""
    left = at_place(togo_s, togo_cell_m, x_m, y_m, NO_WAY_S)
    return left if left < NO_WAY_S else _least_left_s(togo_s, togo_cell_m, x_m, y_m)


@njit(cache=True, nogil=True)
def _least_left_s(togo_s, togo_cell_m, x_m, y_m):
    """Beside ground from which no way leads: the best of the cells round it."""
    height, width = togo_s.shape
    x, y = int(x_m / togo_cell_m), int(y_m / togo_cell_m)
    best = NO_WAY_S
    for row in range(max(0, y - 1), min(height, y + 2)):
        for column in range(max(0, x - 1), min(width, x + 2)):
            best = min(best, togo_s[row, column] + ARRIVED_S)
    return best


@njit(cache=True, nogil=True)
def _off_course_rad(togo_s, togo_cell_m, x_m, y_m, heading_rad):
    """How far the heading is from where the time that is left falls fastest; 0 where that is not known."""
    reach = 1.5 * togo_cell_m
    east = left_s(togo_s, togo_cell_m, x_m + reach, y_m) - left_s(togo_s, togo_cell_m, x_m - reach, y_m)
    north = left_s(togo_s, togo_cell_m, x_m, y_m + reach) - left_s(togo_s, togo_cell_m, x_m, y_m - reach)
    if abs(east) + abs(north) < 1e-6 or max(abs(east), abs(north)) > 0.5 * NO_WAY_S:
        return 0.0
    off = math.atan2(-east, -north) - heading_rad
    return abs((off + math.pi) % (2.0 * math.pi) - math.pi)


@njit(cache=True, nogil=True)
def way_of(knots, problem):
    """Where a motion leads: x and y of each step, from where the rover is now on; also through obstacles."""
    start, step_s = problem.start, problem.step_s
    state = (start.x_m, start.y_m, start.heading_rad, start.speed_m_s, start.turn_rad_s)
    steps = problem.pending.shape[0] + int(round(problem.horizon_s / step_s))
    way = np.empty((steps + 1, 2))
    way[0, 0], way[0, 1] = start.x_m, start.y_m
    for step in range(steps):
        told_m_s, told_rad_s = _told_in(step, knots, problem.pending, step_s / problem.horizon_s)
        state = moved(state, told_m_s, told_rad_s, problem.model, step_s)
        way[step + 1, 0], way[step + 1, 1] = state[0], state[1]
    return way


@njit(cache=True, nogil=True)
def costs_s(motions, problem):
    """The costs of motions, shape (m, n, 2)."""
    costs = np.empty(motions.shape[0])
    for one in range(motions.shape[0]):
        costs[one] = cost_s(motions[one], problem)
    return costs


@njit(cache=True, nogil=True)
def begin_later(motions, share):
    """The same motions begun a share of the horizon later, in place; what lies beyond its end stays as it is there."""
    count, size, _ = motions.shape
    for one in range(count):
        for knot in range(size):
            # A knot is made from itself and later ones, which are still as they were.
            speed, turn = told_at(motions[one], knot / (size - 1) + share)
            motions[one, knot, 0], motions[one, knot, 1] = speed, turn


@njit(cache=True, nogil=True)
def keep_within(motion, problem):
    """Keep a motion's commands within the rover's limits, and its first one within what may be told now."""
    model, admitted = problem.model, problem.admitted_m_s
    last = admitted.shape[0] - 1
    for knot in range(motion.shape[0]):
        fastest_m_s, backwards_m_s = model.fastest_m_s, model.backwards_m_s
        motion[knot, 1] = min(max(motion[knot, 1], -model.turn_fastest_rad_s), model.turn_fastest_rad_s)
        if knot == 0:
            at = int(round(0.5 * last * (1.0 + motion[knot, 1] / model.turn_fastest_rad_s)))
            fastest_m_s, backwards_m_s = admitted[at, 0], admitted[at, 1]
        motion[knot, 0] = min(max(motion[knot, 0], -backwards_m_s), fastest_m_s)


@njit(cache=True, nogil=True)
def keep_all_within(motions, problem):
    """``keep_within`` for each."""
    for one in range(motions.shape[0]):
        keep_within(motions[one], problem)


@njit(cache=True, nogil=True)
def next_generation(motions, costs, best, chances, kicks, sizes, problem):
    """One generation, in place: the best quarter stays, the rest become its children by crossover and mutation.

    ``best``: how many stay. ``chances``: shape (m, n + 4), even in 0 to 1. ``kicks``: shape (m, n, 2), normal.
    ``sizes``: of mutations, m/s and rad/s. The paper's operators (Kwasniewski & Gosiewski 2018, section 3), on knots
    of a motion instead of control points of a curve.
    """
    count, size, _ = motions.shape
    order = np.argsort(costs)
    parents, kept = motions[order[:best]].copy(), costs[order[:best]].copy()
    motions[:best] = parents
    costs[:best] = kept
    for one in range(best, count):
        chance = chances[one]
        mother, father = parents[int(chance[0] * best)], parents[int(chance[1] * best)]
        cut = int(chance[2] * (size + 1))
        for knot in range(size):
            parent = mother if knot < cut else father
            kicked = chance[4 + knot] < MUTATED
            for part in range(2):
                motions[one, knot, part] = parent[knot, part]
                if kicked:
                    motions[one, knot, part] += sizes[part] * (0.2 + chance[3]) * kicks[one, knot, part]
        keep_within(motions[one], problem)
        costs[one] = cost_s(motions[one], problem)


@njit(cache=True, nogil=True)
def evolve(motions, best, chances, kicks, sizes, problem):
    """One ``next_generation`` for each row of ``chances`` and ``kicks``, in place; gives the costs.

    One call for all: to hand over a problem takes as long as to judge some five motions.
    """
    costs = costs_s(motions, problem)
    for generation in range(chances.shape[0]):
        next_generation(motions, costs, best, chances[generation], kicks[generation], sizes, problem)
    return costs


LONG = 1.6
"""A rover is long if its discs lie along so many times their radius: turning then moves its ends far."""
MUTATED = 0.4
"""So large a share of a child's knots is changed."""
