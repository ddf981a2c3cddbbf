"""The painter: never waited for, writes what has changed, gives the terminal back."""

import io
import os
import pty
import threading

import pytest
from rich.console import Console

from companion.viewer.terminal.painter import CLEAR, Painter, ViewError, terminal
from companion.viewer.terminal.screen import SMALLEST, View
from tests.companion.viewer.terminal.test_screen import ROOM, a_view, sketch
from tests.support.pseudo_terminal import ENTER, LEAVE
from tests.support.served import wait_until


def console(stream: io.StringIO, **more: object) -> Console:
    options = {"force_terminal": True, "color_system": "truecolor", "width": 80, "height": 24, **more}
    return Console(file=stream, **options)  # type: ignore[arg-type]


def test_a_terminal_that_cannot_move_its_cursor_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as stream:
        monkeypatch.setenv("TERM", "dumb")
        with pytest.raises(ViewError, match="TERM=dumb"):
            terminal(stream)
        monkeypatch.setenv("TERM", "xterm")
        assert terminal(stream).is_terminal
    os.close(ours)


class Stopped(io.StringIO):
    """A terminal that takes nothing more once ``held``, as after Ctrl-S, until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.going, self.reached = threading.Event(), threading.Event()
        self.going.set()

    def write(self, text: str) -> int:
        if not self.going.is_set():
            self.reached.set()
            self.going.wait(30.0)
        return super().write(text)


def test_a_stopped_terminal_does_not_hold_up_who_shows() -> None:
    stream = Stopped()
    one = a_view(sketch(ROOM))
    with Painter(console(stream)) as painter:
        stream.going.clear()
        painter.show(lambda: one)
        assert stream.reached.wait(10.0)
        for _ in range(100):  # the terminal is stuck in the middle of the first picture all the while
            painter.show(lambda: a_view(sketch(ROOM)))
        assert not stream.going.is_set()
        stream.going.set()
    assert "GUIDED, armed" in stream.getvalue() and LEAVE.decode() in stream.getvalue()


def test_pictures_are_due_five_times_a_second() -> None:
    painter = Painter(Console(file=io.StringIO()))
    assert sum(painter.is_due(hundredth / 100.0) for hundredth in range(1000)) == pytest.approx(50, abs=2)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_error_gives_the_terminal_back(error: type[BaseException]) -> None:
    stream = io.StringIO()
    with (
        pytest.raises(error),
        Painter(console(stream)) as painter,
    ):
        painter.show(lambda: a_view(sketch(ROOM)))
        raise error
    assert stream.getvalue().rindex(LEAVE.decode()) > stream.getvalue().rindex(ENTER.decode())


def test_only_lines_that_have_changed_are_written() -> None:
    stream, drawn = io.StringIO(), threading.Event()

    def making(view: View) -> View:
        drawn.set()
        return view

    with Painter(console(stream)) as painter:
        lengths = []
        for text in ("first", "first", "second"):
            drawn.clear()
            painter.show(lambda text=text: making(a_view(sketch(ROOM), events=(text,))))  # type: ignore[misc]
            assert drawn.wait(10.0)
            wait_until(lambda text=text: text in "".join(painter._shown[1]))  # type: ignore[misc]
            lengths.append(len(stream.getvalue()))
    assert lengths[0] > 2000 and lengths[1] == lengths[0] and 0 < lengths[2] - lengths[1] < 300
    assert stream.getvalue().count(CLEAR) == 2, "one of them when it takes the terminal"


def test_a_fault_in_a_view_ends_the_pictures_and_is_told() -> None:
    stream = io.StringIO()

    def broken() -> View:
        raise ValueError("no such map")

    with Painter(console(stream)) as painter:
        painter.show(broken)
        painter._thread.join(10.0)
        assert painter.problem == "ValueError: no such map" and LEAVE.decode() in stream.getvalue()
    assert not painter.stuck


def test_a_terminal_that_is_stuck_is_not_waited_for_long() -> None:
    stream = Stopped()
    stream.going.clear()
    with Painter(console(stream)) as painter:
        painter.show(lambda: a_view(sketch(ROOM)))
    assert painter.stuck
    stream.going.set()
    painter._thread.join(10.0)


@pytest.mark.parametrize("rows_below", [0, 3])
def test_the_smallest_terminal_that_shows_a_picture_keeps_the_last_one(rows_below: int) -> None:
    stream = io.StringIO()
    with Painter(console(stream, width=SMALLEST[0], height=SMALLEST[1])) as painter:
        painter.show(lambda: a_view(sketch(ROOM), events=("the newest",)))
    stream.truncate(stream.seek(0))
    painter.print_last(rows_below)
    last = stream.getvalue()
    assert last.count("\n") == SMALLEST[1] - 1 and "╰" in last and "the newest" in last and "too few" not in last
