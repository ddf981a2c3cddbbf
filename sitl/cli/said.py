"""The companion's texts, as those see them who look on now and then."""

from __future__ import annotations

from sitl.lockstep import Drive


class Said:
    """Of one run."""

    def __init__(self, run: Drive) -> None:
        self._run = run
        self._before: list[str] = []

    def news(self) -> list[str]:
        """What has been said since the last call."""
        before, self._before = self._before, self._run.companion.outcome.said.copy()
        return new_texts(before, self._before)


def new_texts(before: list[str], now: list[str]) -> list[str]:
    """What was said since then; of a list whose oldest texts go when it is full only what can be told apart from before."""
    if len(now) > len(before):
        return now[len(before) :]
    return now[-1:] if now[-1:] != before[-1:] else []
