"""The clock of a record: what its packets say, and moments that people name."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.recording.reader import load_record
from companion.recording.record_clock import RecordClock, record_clock
from companion.recording.record_format import STAMP
from tests.support.records import write_record

EVENING = RecordClock(50.0, 1_795_650_000_250_000, 45_000.0)
"""25 November 2026, 23:40:00.25."""


def test_the_clock_is_that_of_the_packets(tmp_path: Path) -> None:
    record = load_record(write_record(tmp_path))
    clock = record_clock(record)
    assert clock.simulated and "simulated" in clock.described
    packets = list(record.ticks())
    stamp_us = STAMP.unpack((record.directory / "link.tlog").read_bytes()[: STAMP.size])[0]
    first = next(one.entry.time_s for one in packets if one.heard)
    assert abs(clock.unix_us(first - clock.began_s) - stamp_us) <= 1
    assert clock.length_s == pytest.approx(packets[-1].entry.time_s - packets[0].entry.time_s)


def test_times_are_shown_as_they_can_be_typed() -> None:
    assert EVENING.utc(0.0) == "2026-11-25T23:40:00.250Z" and not EVENING.simulated
    assert "2026-11-25 23:40:00.250Z" in EVENING.described
    for since_s in (0.0, 0.01, 59.755, 1199.75, 1200.0, 40_000.004):
        shown = EVENING.time_of_day(since_s)
        assert EVENING.moment_s(shown) == pytest.approx(since_s, abs=0.0051), shown


@pytest.mark.parametrize(
    ("text", "since_s"),
    [
        ("0s", 0.0),
        ("83.5s", 83.5),
        ("83.5 s", 83.5),
        ("83.5", 83.5),
        ("23:41", 59.75),
        ("23:41:3", 62.75),
        ("00:00:00", 1199.75),
        ("9:40:00.25", 36_000.0),
    ],
)
def test_a_moment_is_seconds_or_a_time_of_day(text: str, since_s: float) -> None:
    assert EVENING.moment_s(text) == pytest.approx(since_s)


@pytest.mark.parametrize(("text", "since_s"), [("1:30", 90.0), ("00:01:30", 90.05), ("2:30", 9_000.05)])
def test_minutes_and_seconds_are_since_the_start_where_no_such_time_of_day_came(text: str, since_s: float) -> None:
    assert EVENING.moment_s("45:10") == pytest.approx(2710.0), "no hour of a day"
    simulated = RecordClock(0.0, 1_577_836_799_950_000, 103.4)
    assert simulated.moment_s(text) == pytest.approx(since_s)
    assert simulated.time_of_day(0.0) == "00:00:00.00" and simulated.time_of_day(1.0) == "00:00:00.95"


def test_a_time_of_day_that_never_came_is_not_in_the_record() -> None:
    late_s = EVENING.moment_s("23:39:59")
    assert late_s is not None and late_s > 86_000.0 and not EVENING.holds(late_s)


@pytest.mark.parametrize(
    "text", ["", "s", "66", "-1s", "1e3s", "nans", "24:00:00", "12:60", "12:00:60", "12", ".5", "5.", "٣s", "1:2:3"]
)
def test_anything_else_is_no_moment(text: str) -> None:
    assert EVENING.moment_s(text) is None
