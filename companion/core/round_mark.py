"""Marks of a recorded round: what happened to the companion in it beside the bytes that it heard (docs/record.md)."""

from __future__ import annotations

from enum import IntFlag


class Mark(IntFlag):
    """What happened in a round beside bytes. The values are part of the record's format."""

    BEGIN = 1
    """The companion was made; nothing was heard."""
    ANSWER = 2
    """The answer of a navigator's step, computed in a thread, was taken."""
    STOP = 4
    """A person's request to stop the run was obeyed."""
    CLOSE = 8
    """An error broke the run off, and the shutdown began; nothing was heard."""
    WORKING = 16
    """The thread was still computing a step."""
    SIGNED = 32
    """The run accepted signed packets only; the packets that it refused are not recorded."""
    UNSIGNED = 64
    """Packets had been refused by now because they were not signed."""
    WRONG = 128
    """Packets had been refused by now because they were signed with another key."""
    OLD = 256
    """Packets had been refused by now because they were signed too long ago, or heard twice."""
    UNSAVED = 512
    """The last attempt to save the state of the run failed."""
