"""What an interrupt is, and that it does not cut a step in two."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import pytest

from companion.core.interrupts import Terminated, WholeSteps, is_interrupt, was_terminated


@pytest.mark.parametrize(
    ("behind", "stops", "terminated"),
    [(KeyboardInterrupt(), True, False), (Terminated(), True, True), (ValueError(), False, False)],
)
def test_what_is_behind_an_error_is_found_however_many_others_lie_between(
    behind: BaseException, stops: bool, terminated: bool
) -> None:
    caused, met = SystemError("a loop"), SystemError("a loop that called it")
    caused.__cause__, met.__context__ = behind, caused
    for error in (behind, caused, met):
        assert (is_interrupt(error), was_terminated(error)) == (stops, terminated)
    assert not is_interrupt(None) and not was_terminated(None)


def test_errors_that_lie_behind_each_other_have_an_end() -> None:
    first, second = SystemError("first"), SystemError("second")
    first.__cause__, second.__cause__ = second, first
    assert not is_interrupt(first) and not was_terminated(second)


def test_ctrl_c_after_sigterm_is_still_an_end_by_sigterm() -> None:
    with pytest.raises(KeyboardInterrupt) as caught:
        try:
            raise Terminated
        finally:
            raise KeyboardInterrupt
    assert was_terminated(caught.value)


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
