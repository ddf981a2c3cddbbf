"""What takes long is told once."""

from __future__ import annotations

import threading
import time

from companion.cli.patience import Patience


def test_it_is_told_once_and_only_if_nothing_ended_in_time() -> None:
    told, heard = [], threading.Event()

    def say() -> None:
        told.append(time.monotonic())
        heard.set()

    patience = Patience(0.2, say)
    for _ in range(4):
        patience.begin()
        time.sleep(0.02)
    begun_s = time.monotonic()
    patience.begin()
    assert heard.wait(20.0) and told[0] >= begun_s + 0.2
    time.sleep(0.3)
    assert len(told) == 1
    patience.begin()
    patience.end()
    patience.end()
    time.sleep(0.3)
    assert len(told) == 1
