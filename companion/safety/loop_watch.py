"""The companion's own work: ticks that come late again and again, and a navigator's step that does not end."""

from __future__ import annotations

from collections import deque

LATE_S = 0.1
"""A tick that begins so much after its time is late: two whole ticks at 20 Hz."""
WINDOW_S = 4.0
LATE_SHARE = 0.5
"""Late for more than this share of the window, the computer is too slow, or busy."""
HICCUP_S = 1.0
"""One stall counts for no more than this, however long it was: a computer that was suspended is not slow."""


class LoopWatch:
    """Told at every tick; all times are the companion's clock. ``planner_s``: a step may take so long."""

    def __init__(self, planner_s: float) -> None:
        self._planner_s = planner_s
        self._ticks: deque[tuple[float, float]] = deque()
        self._late_s = 0.0
        self._before_s: float | None = None
        self._works_since_s: float | None = None
        self._reason = ""

    @property
    def reason(self) -> str:
        """Why the rover must not move now; empty when it may."""
        return self._reason

    def tick(self, now_s: float, late_s: float, *, planner_works: bool) -> None:
        """A tick begins now, ``late_s`` after its time; ``planner_works``: a step is being computed beside the loop."""
        elapsed_s = now_s - (now_s if self._before_s is None else self._before_s)
        self._before_s = now_s
        self._note(now_s, min(elapsed_s, HICCUP_S) if late_s > LATE_S else 0.0)
        since_s = now_s if self._works_since_s is None else self._works_since_s
        self._works_since_s = since_s if planner_works else None
        if planner_works and now_s - since_s > self._planner_s:
            self._reason = f"planning has taken over {self._planner_s:g} s"
        else:
            self._reason = "the companion is too slow" if self._late_s > LATE_SHARE * WINDOW_S else ""

    def _note(self, now_s: float, late_s: float) -> None:
        self._ticks.append((now_s, late_s))
        self._late_s += late_s
        while self._ticks[0][0] < now_s - WINDOW_S:
            self._late_s -= self._ticks.popleft()[1]
        if len(self._ticks) == 1:
            self._late_s = late_s  # what rounding has left over does not pile up
