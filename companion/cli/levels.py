"""Lines with their level, for those who read them: systemd's journal, a log file, a person at a terminal."""

from __future__ import annotations

import os
from collections.abc import Mapping
from enum import Enum

ERROR, WARNING, INFO = 3, 4, 6
"""As in MAVLink and in syslog."""
WORDS = ("error", "error", "error", "error", "warning", "notice", "info", "debug")


class Reader(Enum):
    """Who reads."""

    PERSON = "terminal"
    LOG = "file or pipe"
    JOURNAL = "journal"


def reader_of(descriptor: int, environment: Mapping[str, str]) -> Reader:
    """Who reads what is written there. systemd says in ``JOURNAL_STREAM`` which stream leads to its journal: device and inode."""
    try:
        status = os.fstat(descriptor)
    except OSError:
        return Reader.LOG
    if environment.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}":
        return Reader.JOURNAL
    return Reader.PERSON if os.isatty(descriptor) else Reader.LOG


def levelled(text: str, severity: int, reader: Reader) -> str:
    """The line: ``<4>text`` for the journal, ``warning: text`` in a log, the text alone for a person."""
    severity = min(max(severity, 0), 7)
    match reader:
        case Reader.JOURNAL:
            return f"<{severity}>{text}"
        case Reader.LOG:
            return f"{WORDS[severity]}: {text}"
        case _:
            return text
