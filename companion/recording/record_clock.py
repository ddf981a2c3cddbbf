"""The clock of a record: seconds since its start, the time of day as its packets have it, and moments named by people.

Nouns: record clock.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from companion.recording.reader import MAX_BYTES, Record
from companion.recording.record_format import PACKETS, STAMP, TICKS, RecordError, unpacked_ticks
from companion.storage.files import open_file, read_at_most

SIMULATED_UNTIL_US = 1_600_000_000_000_000
"""September 2020: simulated time begins with that year."""
DAY_S, DAY_US = 86_400.0, 86_400_000_000
SHOWN_S = 0.006
"""Times are shown to a hundredth: one that was read off a list means the moment that was listed."""
SECONDS = re.compile(r"(\d{1,9}(?:\.\d{1,9})?) ?s|(\d{1,9}\.\d{1,9})", re.ASCII)
"""A whole number without the s is that of a decision."""
OF_DAY = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{1,2}(?:\.\d{1,9})?))?", re.ASCII)


@dataclass(frozen=True, slots=True)
class RecordClock:
    """``began_s``: the companion's clock in the first tick; ``began_us``: microseconds since 1970 then.

    ``length_s``: from the first tick to the last.
    """

    began_s: float
    began_us: int
    length_s: float

    @property
    def simulated(self) -> bool:
        """Whether its time of day is a simulator's, which begins at midnight."""
        return self.began_us < SIMULATED_UNTIL_US

    @property
    def described(self) -> str:
        """What clock the times of day are of, for people."""
        if self.simulated:
            return "times of day are simulated, as in link.tlog: its first packet has 00:00:00"
        began = self.utc(0.0).replace("T", " ")
        return f"times of day are UTC by the clock of the rover's computer, as in link.tlog; it begins {began}"

    def unix_us(self, since_s: float) -> int:
        """Microseconds since 1970, so many seconds after the start."""
        return self.began_us + round(1e6 * since_s)

    def utc(self, since_s: float) -> str:
        """Date and time of day, as ISO 8601 has them, with milliseconds."""
        return f"{np.datetime_as_string(np.datetime64(self.unix_us(since_s) + 500, 'us'), unit='ms')}Z"

    def time_of_day(self, since_s: float) -> str:
        """Hours, minutes and seconds with hundredths; a simulated day has nothing before its first packet."""
        us = self.unix_us(since_s)
        if self.simulated:
            us = max(us, round(self.began_us / DAY_US) * DAY_US)
        return str(np.datetime_as_string(np.datetime64(us + 5000, "us"), unit="ms"))[11:22]

    def moment_s(self, text: str) -> float | None:
        """Seconds since the start, of a text like ``83.5s`` or ``14:03:22``; None for any other text.

        A time of day is the first one in the record; it may lie behind its end. ``1:30`` is a minute and a half after
        the start where the record has no such time of day.
        """
        if found := SECONDS.fullmatch(text):
            return float(found[1] or found[2])
        found = OF_DAY.fullmatch(text)
        hour, minute, second_s = (0, 0, 0.0) if found is None else (int(found[1]), int(found[2]), float(found[3] or 0))
        if found is None or minute > 59 or second_s >= 60.0:
            return None
        after_s = 60.0 * hour + minute
        is_after = found[3] is None and self.holds(after_s)
        if hour > 23:
            return after_s if is_after else None
        of_day_s = 3600.0 * hour + 60.0 * minute + second_s
        since_s = (of_day_s - 1e-6 * self.began_us + SHOWN_S) % DAY_S - SHOWN_S
        return after_s if is_after and not self.holds(since_s) else since_s

    def holds(self, since_s: float) -> bool:
        """Whether the record had not ended by then."""
        return since_s <= self.length_s + SHOWN_S


def record_clock(record: Record) -> RecordClock:
    """The clock of a record. Raises RecordError if it cannot be read."""
    try:
        ticks, _ = unpacked_ticks(read_at_most(record.directory / TICKS, MAX_BYTES))
        with open_file(record.directory / PACKETS) as file:
            stamp = file.read(STAMP.size)
    except OSError as error:
        raise RecordError(f"{record.directory}: cannot be read: {error.strerror}") from error
    first_us = STAMP.unpack(stamp)[0] if len(stamp) == STAMP.size else record.meta.start_unix_us
    stamped = next((one for one in ticks if one.heard + one.said), ticks[0])
    began_us = first_us - round(1e6 * (stamped.time_s - ticks[0].time_s))
    return RecordClock(ticks[0].time_s, began_us, ticks[-1].time_s - ticks[0].time_s)
