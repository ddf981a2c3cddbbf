"""The list of a record's decisions: when, where, and what was decided, with what else happened between them.

Nouns: decision list.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass

from companion.app import Companion
from companion.core.frames import NedPoint
from companion.navigation.field_step import Decision
from companion.planning.problem import Path
from companion.recording.contacts import Contact
from companion.recording.reader import Record
from companion.recording.record_clock import SHOWN_S, RecordClock
from companion.recording.record_format import DECISIONS, RecordError
from companion.replay.replay import ReplayObserver

HEAD = f"{'no.':>5}  {'time of day':<11} {'after s':>9} {'north m':>8} {'east m':>8}  "


@dataclass(frozen=True, slots=True)
class Listed:
    """A decision with its number, or with None something else that happened. ``time_s``: since the start."""

    time_s: float
    text: str
    number: int | None = None
    place: NedPoint | None = None


class DecisionLister(ReplayObserver):
    """Collects the decisions of a replay in ``listed``, and what the companion said between them."""

    def __init__(self) -> None:
        self.listed: list[Listed] = []

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """See ``ReplayObserver``."""
        pose, evidence = companion.status().pose, companion.evidence
        resolution_m = 1.0 if evidence is None else evidence.base.resolution_m
        planner = "" if companion.driver is None else companion.driver.searcher.planner.name
        text = f"{target}: {decision_text(decision, resolution_m, planner)}"
        self.listed.append(Listed(time_s, text, number, None if pose is None else pose.point))

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        status = companion.status()
        place = None if status.pose is None else status.pose.point
        self.listed += [Listed(time_s, one.text, None, place) for one in status.news if one.own]

    def add_contacts(self, contacts: Iterable[Contact], clock: RecordClock) -> None:
        """Put the contacts of a simulated drive where they belong; their places count from the start."""
        for one in contacts:
            text = f"contact with {one['with']} at {one['speed_m_s']} m/s"
            self.listed.append(Listed(one["time_s"] - clock.began_s, text))
        self.listed.sort(key=lambda one: one.time_s)


def decision_text(decision: Decision, resolution_m: float, planner: str) -> str:
    """What was decided in a few words: why, how far the path leads, and what was searched for it."""
    parts = [str(decision.reason)]
    if decision.path:
        length_m = resolution_m * Path(decision.path, 0.0).length_fields
        cost = "" if decision.new_path is None else f", cost {decision.new_path.cost:.1f}"
        parts.append(f"{length_m:.1f} m{cost}")
    if decision.searches:
        parts.append(f"{planner} searched ({', '.join(decision.searches)})")
    return "; ".join(parts)


def list_lines(listed: Iterable[Listed], clock: RecordClock) -> list[str]:
    """The list as text: a head, and a line each."""
    lines = [f"{HEAD}what"]
    for one in listed:
        number = "" if one.number is None else f"{one.number}"
        where = f"{'':8} {'':8}" if one.place is None else f"{one.place.north_m:8.2f} {one.place.east_m:8.2f}"
        text = one.text if one.number is not None else f"- {one.text}"
        lines.append(f"{number:>5}  {clock.time_of_day(one.time_s):<11} {one.time_s:9.2f} {where}  {text}")
    return lines


def decision_at(record: Record, clock: RecordClock, text: str) -> int:
    """The number of the decision that a person asks for: by its number, or the one in force at a moment.

    A moment is seconds since the start (``83.5s``), minutes and seconds (``1:23``) or a time of day (``14:03:22``).
    Raises RecordError.
    """
    last = len(record.decisions)
    if text.isascii() and text.isdigit() and len(text) < 10:
        if not 1 <= int(text) <= last:
            raise RecordError(
                f"{record.directory}: there is no decision {int(text)}, the last one is {last}; seconds are {text}s"
            )
        return int(text)
    since_s = clock.moment_s(text)
    if since_s is None:
        raise RecordError(
            f"--why {text!r:.40}: give the number of a decision (66), the time since the start (83.5s or 1:23) or a "
            "time of day (14:03:22); --list shows all decisions"
        )
    if not clock.holds(since_s):
        raise RecordError(
            f"{record.directory}: {text} is not in it: it lasts {clock.length_s:.2f} s, from {clock.time_of_day(0.0)} "
            f"to {clock.time_of_day(clock.length_s)}; --list shows all decisions"
        )
    times_s = [_time_s(record, number) - clock.began_s for number in range(1, last + 1)]
    number = sum(time_s <= since_s + SHOWN_S for time_s in times_s)
    if number == 0:
        first = f"the first was made after {times_s[0]:.2f} s" if times_s else "the record has none"
        raise RecordError(f"{record.directory}: no decision had been made at {text}: {first}")
    return number


def _time_s(record: Record, number: int) -> float:
    try:
        return float(json.loads(record.decisions[number - 1])["time_s"])
    except (ValueError, TypeError, KeyError) as error:
        raise RecordError(
            f"{record.directory / DECISIONS}: line {number} is damaged; take the record from a copy that is whole"
        ) from error
