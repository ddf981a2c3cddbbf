"""Model estimate: how the rover really follows velocities, from what it was told and what came back.

Twice a second the last seconds are driven once more by the model, with each of its figures a little larger and smaller.
What fits better is taken over. The figures begin as they are set or as the autopilot's parameters tell, and stay
within bounds round that.

Nouns: model estimate.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.control.following import Following
from companion.control.local_view import LocalView

WINDOW_S, EVERY_S = 12.0, 0.5
"""So long the model is driven again, and so often."""
LEAST_S = 1.5
"""With less it is not."""
GAP_S = 0.5
"""Moments farther apart do not belong together."""
DEADS_S = tuple(0.025 * step for step in range(2, 33))
"""Dead times that are tried: another one far away may fit best."""
MOST_DEAD_S = DEADS_S[-1]
CHANGES = (0.03, -0.03, 0.1, -0.1)
"""The other figures are tried with so much more or less."""
FIGURES = ("acceleration_m_s2", "deceleration_m_s2", "turn_acceleration_rad_s2", "turn_gain")
TELLS_S = 0.4
"""They stay as they are while the last seconds hold less than this of gathering speed, of braking, of changing the turn
rate, of turning steadily: drawn to what it began with, a figure would forget what was found."""
STEADY_S, STEADY_RAD_S, LEAST_RAD_S = 0.3, 0.3, 0.3
"""A turn is steady where the turn rate told is at least the last of these, and has changed by less than the second for
the first. Told one way and the other several times a second, nearly any figure fits, as what is seen is late."""
LEAST_SHARE, MOST_SHARE = 0.5, 2.0
"""No figure leaves these bounds, of what it began with."""
LIMITED = "turn_acceleration_rad_s2"
"""Where the autopilot has a limit of it, it changes the turn rate no faster: more than the doubt in that is never
believed, or a rover that turns a little late would be taken for one that turns fast."""
ERROR_M_S, ERROR_RAD_S = 0.1, 0.15
"""Differences that are usual."""
MOST_ERROR = 3.0
"""Larger differences, in these, count no more: wheels slip, and ground is soft."""
PULL = 0.01
"""How much figures are drawn to what they began with, so that they stay where nothing tells."""
KNOWN_S = 2.5
"""So long the rover must have gathered speed, braked, and changed its turn rate before the model counts as known."""
TURN_KNOWN_S = 1.0
"""So long it must have turned steadily, too, before it is known how far it turns: by then that was off by more than 6 %
in one of ten of 240 drawn rovers."""
POOR_FIT = 2.0
"""A mean squared difference from which what was known is doubted again."""


class Fit(NamedTuple):
    """How well figures fit: mean squared difference, and seconds of gathering speed, of braking, of changing the turn
    rate, of turning steadily."""

    error: float
    gathers_s: float
    brakes_s: float
    turns_s: float
    steady_s: float


@dataclass(frozen=True, slots=True)
class ModelEstimate:
    """``began``: what was assumed at first. ``figures``: found since. The seconds: each kind of motion seen so far;
    ``steady_s``: of turning steadily.
    """

    began: Following
    figures: Following
    gathered_s: float = 0.0
    braked_s: float = 0.0
    turned_s: float = 0.0
    steady_s: float = 0.0

    @property
    def known(self) -> float:
        """From 0, nothing is known, to 1."""
        return min(1.0, min(self.gathered_s, self.braked_s, self.turned_s) / KNOWN_S)

    @property
    def turn_known(self) -> float:
        """The same of how far it turns: only steady turns tell that."""
        return min(self.known, self.steady_s / TURN_KNOWN_S)

    def following(self, off_model_known: float) -> Following:
        """The figures, and how far the rover may be off them: the less, the more is known, down to that share.

        A rover that is told to gain speed gently is seen to gain less than it can: as much as the autopilot lets it
        (``gains_most_m_s2`` at first, but for the doubt in it) remains possible.
        """
        doubted = self.began.off_model
        most_known = max(doubted - off_model_known, 0.0)
        off, turn_off = doubted - self.known * most_known, doubted - self.turn_known * most_known
        most_m_s2 = self.began.gains_most_m_s2
        possible_m_s2 = self.known * most_m_s2 / (1.0 + doubted) + (1.0 - self.known) * most_m_s2
        most_m_s2 = max(self.figures.acceleration_m_s2 * (1.0 + off), possible_m_s2)
        return self.figures._replace(off_model=off, turn_off_model=turn_off, gains_most_m_s2=most_m_s2)


def bounded(figures: Following, began: Following) -> Following:
    """Figures that come from a file, within the bounds round what the estimate began with."""
    kept = {}
    for name in ("dead_s", *FIGURES):
        usual = getattr(began, name)
        kept[name] = min(max(getattr(figures, name), LEAST_SHARE * usual), MOST_SHARE * usual)
    return began._replace(**kept)


def described(estimate: ModelEstimate) -> str:
    """The estimate in one line, for people."""
    own = estimate.figures
    return (
        f"after {own.dead_s:.2f} s, gains {own.acceleration_m_s2:.2f} and loses {own.deceleration_m_s2:.2f} m/s², "
        f"turns {own.turn_gain:.2f} times as told, changes that by {own.turn_acceleration_rad_s2:.1f} rad/s² "
        f"({estimate.known:.0%} known, how far it turns {estimate.turn_known:.0%})"
    )


class ModelEstimator:
    """Keeps the last seconds, and the estimate."""

    def __init__(self, began: Following) -> None:
        """``began``: what is assumed at first."""
        self.estimate = ModelEstimate(began, began)
        self._earlier: ModelEstimate | None = None
        self._rows: deque[tuple[float, float, float, float, float]] = deque()
        self._fitted_s = -math.inf
        self._limited = False

    def assume(self, began: Following, *, limited: bool) -> None:
        """What is assumed at first, as far as is known now; if it is another than before, the estimate begins anew.

        ``limited``: whether the change of the turn rate is a limit of the autopilot's.
        """
        self._limited = limited
        if began != self.estimate.began:
            earlier = self._earlier
            self.estimate = earlier if earlier and earlier.began == began else ModelEstimate(began, began)

    def go_on(self, earlier: ModelEstimate) -> None:
        """What an earlier run had found counts as soon as the same is assumed as there."""
        self._earlier = earlier
        if earlier.began == self.estimate.began:
            self.estimate = earlier

    def note(self, view: LocalView) -> None:
        """One moment. Only velocities tell: after anything else it begins anew."""
        now_s, rows = view.pose.time_s, self._rows
        if not view.lately or (rows and not 0.0 < now_s - rows[-1][0] < GAP_S):
            rows.clear()
        if not view.lately:
            return
        told = view.lately[-1]
        rows.append((now_s, told.speed_m_s, told.turn_rad_s, view.forward_m_s, view.yaw_rate_rad_s))
        while rows[0][0] < now_s - WINDOW_S:
            rows.popleft()
        if now_s - self._fitted_s >= EVERY_S and now_s - rows[0][0] >= LEAST_S:
            self._fitted_s = now_s
            self.estimate = _fitted(self.estimate, np.array(rows), limited=self._limited)


def _fitted(before: ModelEstimate, rows: NDArray[np.float64], *, limited: bool) -> ModelEstimate:
    """The estimate after one more look at the last seconds."""
    began, best = before.began, before.figures
    if limited:
        most_rad_s2 = (1.0 + began.off_model) * began.turn_acceleration_rad_s2
        best = best._replace(turn_acceleration_rad_s2=min(best.turn_acceleration_rad_s2, most_rad_s2))
    least = _error(best, began, rows)
    for dead_s in DEADS_S:
        if not LEAST_SHARE * began.dead_s <= dead_s <= MOST_SHARE * began.dead_s:
            continue
        tried = best._replace(dead_s=dead_s)
        if (error := _error(tried, began, rows)) < least:
            best, least = tried, error
    in_window = Fit(*fit_of(best, rows, -math.inf))
    told_s = (in_window.gathers_s, in_window.brakes_s, in_window.turns_s, in_window.steady_s)
    for name, tells_s in zip(FIGURES, told_s, strict=True):
        if tells_s < TELLS_S:
            continue
        usual = getattr(began, name)
        for change in CHANGES:
            most = 1.0 + began.off_model if limited and name == LIMITED else MOST_SHARE
            value = min(max(getattr(best, name) * (1.0 + change), LEAST_SHARE * usual), most * usual)
            tried = best._replace(**{name: value})
            if (error := _error(tried, began, rows)) < least:
                best, least = tried, error
    fit = Fit(*fit_of(best, rows, rows[-1, 0] - EVERY_S))
    if fit.error > POOR_FIT:
        return replace(
            before, figures=best,
            gathered_s=0.5 * before.gathered_s, braked_s=0.5 * before.braked_s, turned_s=0.5 * before.turned_s,
            steady_s=0.5 * before.steady_s,
        )  # fmt: skip
    return replace(
        before, figures=best,
        gathered_s=min(before.gathered_s + fit.gathers_s, KNOWN_S),
        braked_s=min(before.braked_s + fit.brakes_s, KNOWN_S),
        turned_s=min(before.turned_s + fit.turns_s, KNOWN_S),
        steady_s=min(before.steady_s + fit.steady_s, TURN_KNOWN_S),
    )  # fmt: skip


def _error(figures: Following, began: Following, rows: NDArray[np.float64]) -> float:
    """How badly figures fit, and how far they are from what was assumed."""
    pulled = (figures.dead_s - began.dead_s) ** 2
    pulled += sum(math.log(getattr(figures, name) / getattr(began, name)) ** 2 for name in FIGURES)
    return float(fit_of(figures, rows, math.inf)[0]) + PULL * pulled


@njit(cache=True, nogil=True)
def fit_of(figures, rows, since_s):
    """The values of a ``Fit``.

    ``rows``: shape (n, 5), time, speed and turn rate told since the row before, speed and turn rate seen;
    ``since_s``: the kinds of motion are counted from then on.
    """
    speed, turn, at, counted = rows[0, 3], rows[0, 4], 0, 0
    error = gathers_s = brakes_s = turns_s = steady_s = 0.0
    held, held_s = rows[0, 2], rows[0, 0]
    for row in range(1, rows.shape[0]):
        now_s, step_s = rows[row, 0], rows[row, 0] - rows[row - 1, 0]
        while at + 1 < row and rows[at + 1, 0] <= now_s - figures.dead_s:
            at += 1
        if now_s - rows[0, 0] < MOST_DEAD_S:
            # The same moments for every dead time, or the noise of the first ones would choose it.
            speed, turn = rows[row, 3], rows[row, 4]
            continue
        counted += 1
        change, turned = rows[at + 1, 1] - speed, figures.turn_gain * rows[at + 1, 2] - turn
        slows = change * speed < 0.0
        most = (figures.deceleration_m_s2 if slows else figures.acceleration_m_s2) * step_s
        most_turn = figures.turn_acceleration_rad_s2 * step_s
        if abs(rows[at + 1, 2] - held) > STEADY_RAD_S:
            held, held_s = rows[at + 1, 2], now_s
        if now_s > since_s:
            if abs(held) > LEAST_RAD_S and now_s - held_s > STEADY_S:
                steady_s += step_s
            if abs(change) > most:
                gathers_s += 0.0 if slows else step_s
                brakes_s += step_s if slows else 0.0
            if abs(turned) > most_turn:
                turns_s += step_s
        speed += min(max(change, -most), most)
        turn += min(max(turned, -most_turn), most_turn)
        off, off_turn = (rows[row, 3] - speed) / ERROR_M_S, (rows[row, 4] - turn) / ERROR_RAD_S
        error += min(off * off, MOST_ERROR * MOST_ERROR) + min(off_turn * off_turn, MOST_ERROR * MOST_ERROR)
    return error / max(counted, 1), gathers_s, brakes_s, turns_s, steady_s
