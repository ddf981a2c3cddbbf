"""An interrupt does not cut a step in two."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import pytest

from companion.core.interrupts import WholeSteps


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def number(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    """One that is heeded by raising, as the commands do."""
    earlier = signal.signal(request.param, signal.default_int_handler)
    yield request.param
    signal.signal(request.param, earlier)


def test_a_step_is_done_whole_and_the_interrupt_is_heeded_after_it(number: signal.Signals) -> None:
    done: list[str] = []

    def step() -> None:
        os.kill(os.getpid(), number)
        done.append("whole")

    with pytest.raises(KeyboardInterrupt), WholeSteps() as steps:
        steps.do(step)
        done.append("more")
    assert done == ["whole"]
    assert signal.getsignal(number) is signal.default_int_handler


def test_between_steps_and_the_second_time_it_is_heeded_at_once(number: signal.Signals) -> None:
    done: list[str] = []

    def impatient() -> None:
        os.kill(os.getpid(), number)
        done.append("first")
        os.kill(os.getpid(), number)
        done.append("second")

    with pytest.raises(KeyboardInterrupt), WholeSteps() as steps:
        steps.do(lambda: None)
        os.kill(os.getpid(), number)
        done.append("between")
    with pytest.raises(KeyboardInterrupt), WholeSteps() as steps:
        steps.do(impatient)
    assert done == ["first"]


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    earlier = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with WholeSteps() as steps:
            steps.do(lambda: os.kill(os.getpid(), signal.SIGINT))
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, earlier)


def test_outside_the_main_thread_steps_are_only_done() -> None:
    done: list[str] = []

    def work() -> None:
        with WholeSteps() as steps:
            steps.do(lambda: done.append("whole"))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == ["whole"]
