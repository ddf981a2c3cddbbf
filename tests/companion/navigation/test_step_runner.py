"""Both runners give each result once; the thread passes errors on, never blocks, and what it does is noted."""

import threading

import pytest

from companion.core.tick_marks import Mark
from companion.navigation.step_runner import InlineRunner, NotedRunner, ThreadRunner

RESULT = (object(), object())


def finished(runner):
    """Wait for the thread to finish its step."""
    deadline = threading.Event()
    for _ in range(1000):
        if not runner.working:
            return
        deadline.wait(0.01)
    raise AssertionError("the step never ended")


@pytest.fixture(params=[InlineRunner, ThreadRunner])
def runner(request):
    made = request.param()
    yield made
    made.close()


def test_a_result_is_taken_once(runner):
    assert not runner.busy and not runner.working and runner.take() is None
    runner.start(lambda: RESULT)
    assert runner.busy
    finished(runner)
    assert runner.busy, "until its result is taken"
    assert runner.take() is RESULT
    assert not runner.busy and runner.take() is None


def test_one_runner_computes_one_step_after_another(runner):
    for number in range(3):
        runner.start(lambda number=number: (number, number))
        finished(runner)
        assert runner.take() == (number, number)


def test_the_thread_works_while_the_loop_goes_on():
    runner, hold = ThreadRunner(), threading.Event()
    runner.start(lambda: RESULT if hold.wait(10.0) else None)
    assert runner.busy and runner.working and runner.take() is None
    hold.set()
    finished(runner)
    assert runner.take() is RESULT
    runner.close()


def test_an_error_in_the_thread_is_raised_where_the_result_is_taken():
    def failing():
        raise ZeroDivisionError("in the step")

    runner = ThreadRunner()
    runner.start(failing)
    finished(runner)
    with pytest.raises(ZeroDivisionError):
        runner.take()
    assert not runner.busy
    runner.start(lambda: RESULT)
    finished(runner)
    assert runner.take() is RESULT, "the thread survives an error"
    runner.close()


def test_closing_does_not_wait_for_the_step():
    runner, hold = ThreadRunner(), threading.Event()
    runner.start(lambda: RESULT if hold.wait(10.0) else None)
    runner.close()
    assert runner.working
    hold.set()
    finished(runner)


def test_work_and_results_are_noted():
    marks, hold = [], threading.Event()
    runner = NotedRunner(ThreadRunner(), marks.append)
    runner.start(lambda: RESULT if hold.wait(10.0) else None)
    assert runner.take() is None and runner.working
    assert marks == [Mark.WORKING]
    hold.set()
    finished(runner)
    marks.clear()
    assert runner.busy and runner.take() is RESULT
    assert marks == [Mark.ANSWER]
    assert runner.take() is None and not runner.busy
    assert marks == [Mark.ANSWER]
    runner.close()


def test_an_error_is_noted_like_a_result():
    def failing():
        raise ZeroDivisionError

    marks = []
    runner = NotedRunner(ThreadRunner(), marks.append)
    runner.start(failing)
    finished(runner)
    marks.clear()
    with pytest.raises(ZeroDivisionError):
        runner.take()
    assert marks == [Mark.ANSWER]
    runner.close()
