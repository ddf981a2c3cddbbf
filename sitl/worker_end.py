"""A process of ``--jobs`` ends with the one that began it, however that ended: ``kill -9`` lets nobody say a word."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from threading import Event, Thread
from typing import TypeVar

LOOK_S = 1.0
Result = TypeVar("Result")


def apart(parent: int, work: Callable[..., Result], *arguments: object) -> Result:
    """The result of ``work`` in a process that ``parent`` began, and that ends with it."""
    end_with(parent)
    return work(*arguments)


@cache
def end_with(parent: int) -> None:
    """Once in each worker. ``parent``: the process that began it; without effect in that process itself."""
    if os.getpid() != parent:
        Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    never = Event()
    while os.getppid() == parent:
        never.wait(LOOK_S)
    os._exit(1)  # nobody is left to be told anything
