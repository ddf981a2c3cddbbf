"""A signal before the drive ends the program, also where the exception that it raises is lost."""

import contextlib
import signal
import time

import pytest

from companion.cli import stop_signals
from companion.cli.stop_signals import StopSignals


class Told:
    def stop(self) -> None:
        raise AssertionError("there is no drive")


def test_what_a_callback_has_lost_is_raised_again_and_no_drive_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stop_signals, "AGAIN_S", 0.05)
    with StopSignals() as stop:
        with contextlib.suppress(SystemExit):  # as a callback of the compiler does
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(SystemExit) as lost:
            stop.listener = Told()
        assert lost.value.code == 130 and stop.listener is None
        with pytest.raises(SystemExit):
            for _ in range(200):
                time.sleep(0.01)


def test_nothing_is_raised_after_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stop_signals, "AGAIN_S", 0.05)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SystemExit), StopSignals():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
    time.sleep(0.15)
