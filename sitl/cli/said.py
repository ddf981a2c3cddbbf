"""New texts of the companion since the last look, for progress and view."""

from __future__ import annotations

from sitl.lockstep import Drive


class Said:
    """The texts of one run."""

    def __init__(self, run: Drive) -> None:
        self._run = run
        self._before: list[str] = []

    def news(self) -> list[str]:
        """The texts since the last call."""
        before, self._before = self._before, self._run.companion.outcome.said.copy()
        return new_texts(before, self._before)


def new_texts(before: list[str], now: list[str]) -> list[str]:
    """The texts added since ``before``; when a full list drops its oldest, only a new last text is recognised."""
    if len(now) > len(before):
        return now[len(before) :]
    return now[-1:] if now[-1:] != before[-1:] else []
