"""Marks of one tick: what happened in it besides the packets that were received and sent.

A run follows from its inputs. Most of them are in other files of its record; these marks are what remains: when a
thread's answer was taken, when a person ended the run, which packets were refused.
"""

from __future__ import annotations

from enum import IntFlag


class Mark(IntFlag):
    """What happened in a tick besides packets. The numbers are those of the record's files."""

    BEGIN = 1
    """The companion was made; no packets were read."""
    ANSWER = 2
    """The result of the navigator's step, computed in a thread, was taken."""
    STOP = 4
    """A person's request to end the run was obeyed."""
    CLOSE = 8
    """An error ended the run and the shutdown began; no packets were read."""
    WORKING = 16
    """The thread was still computing a step."""
    SIGNED = 32
    """The run accepted signed packets only; refused packets are not recorded."""
    UNSIGNED = 64
    """Some packets had been refused by then because they were not signed."""
    WRONG = 128
    """Some packets had been refused by then because they were signed with another key."""
    OLD = 256
    """Some packets had been refused by then because their signature was too old or had been seen before."""
    UNSAVED = 512
    """The last attempt to save the state of the run failed."""
    SAVED = 1024
    """The announcement of a command was in the saved state, or there is no saved state: it may go out."""
    LIDAR = 2048
    """Bytes of a lidar that is wired to the companion were heard; they stand in a file of their own."""
    TERMINATED = 4096
    """Beside ``STOP``: the request came from a signal that is no Ctrl-C. A record that is not closed says it nowhere
    else."""
