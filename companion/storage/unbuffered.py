"""Text straight to a descriptor, and letting go of outputs that nobody reads.

A thread that is stuck in ``write`` holds no lock that other writers, or the end of the program, would wait for.

Nouns: unbuffered output.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterable


class UnbufferedOutput(io.TextIOBase):
    """A text file that writes at once, in UTF-8."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return os.isatty(self._descriptor)

    def write(self, text: str) -> int:
        """Write all of it. Raises OSError."""
        data = text.encode("utf-8", "replace")
        while data:
            data = data[os.write(self._descriptor, data) :]
        return len(text)


def let_go(descriptors: Iterable[int]) -> None:
    """What is written to them from now on is dropped."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in descriptors:
        os.dup2(nowhere, descriptor)
    os.close(nowhere)


def shared_with(descriptor: int, others: Iterable[int]) -> list[int]:
    """The descriptor, and those of the others that lead to the same place."""
    return [descriptor, *(other for other in others if other != descriptor and _same(descriptor, other))]


def _same(one: int, other: int) -> bool:
    try:
        return os.path.sameopenfile(one, other)
    except OSError:  # closed
        return False
