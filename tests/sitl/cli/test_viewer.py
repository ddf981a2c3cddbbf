"""The terminal that the view needs, and that it is given back."""

import io
import os
import pty
import select
import signal
import sys
import threading
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from sitl.cli.commands import app
from sitl.cli.viewer import Viewer, ViewError, terminal
from tests.sitl.network.test_server import free_port
from tests.sitl.view.test_view import ROOM, a_view, scene
from tests.support.forked import Forked

MISSION = "[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n"


@pytest.mark.parametrize("command", ["drive", "serve"])
def test_without_a_terminal_there_is_one_line(tmp_path: Path, command: str) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION)
    result = CliRunner().invoke(app, [command, str(mission), "--view"])
    assert result.exit_code == 2 and result.output.count("\n") == 1 and "not a terminal" in result.output


def on_a_terminal(arguments: list[str], until: bytes, number: signal.Signals, **variables: str) -> tuple[int, bytes]:
    """Run on a pseudo-terminal, send a signal when some text has appeared; exit code and everything written."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", **variables}
    written = b""
    with Forked("sitl", arguments, environment, terminal=theirs) as child:
        os.close(theirs)
        try:
            told = False
            while select.select([ours], [], [], 180.0)[0]:
                try:
                    data = os.read(ours, 65536)
                except OSError:  # the other end is closed
                    break
                written += data
                if not data:
                    break
                if until in written and not told:
                    told = True
                    child.send_signal(number)
            return child.wait(timeout=180.0), written
        finally:
            child.kill()
            os.close(ours)


ENTER, LEAVE, SHOW_CURSOR = b"\x1b[?1049h", b"\x1b[?1049l", b"\x1b[?25h"


def test_serving_gives_the_terminal_back_and_needs_no_colours(tmp_path: Path) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION)
    arguments = ["serve", str(mission), "--view", "--listen", f"tcp:127.0.0.1:{free_port()}"]
    code, written = on_a_terminal(arguments, b"disarmed", signal.SIGINT, NO_COLOR="1")
    assert code == 0 and ENTER in written
    assert written.rindex(LEAVE) > written.rindex(ENTER) and written.rindex(SHOW_CURSOR) > written.rindex(ENTER)
    assert b"stopped after" in written[written.rindex(LEAVE) :]
    assert b"\x1b[38;" not in written and b"\x1b[48;" not in written


def test_driving_gives_the_terminal_back_when_it_is_ended(tmp_path: Path) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION.replace("20, 20", "2000, 20").replace("9, 9", "1990, 9"))
    code, written = on_a_terminal(["drive", str(mission), "--view"], b"GUIDED", signal.SIGTERM)
    assert code == 130 and written.rindex(LEAVE) > written.rindex(ENTER)
    assert b"stopped by SIGTERM" in written[written.rindex(LEAVE) :] and b"Traceback" not in written


def test_the_last_picture_of_a_drive_stays_on_the_terminal(tmp_path: Path) -> None:
    mission = tmp_path / "open.toml"
    mission.write_text(MISSION)
    arguments = ["drive", str(mission), "--view", "--speedup", "1000"]
    code, written = on_a_terminal(arguments, b"no such text", signal.SIGINT)
    after = written[written.rindex(LEAVE) :].decode()
    assert code == 0 and after.rindex("✓") > after.index("outcome: reached")


def test_a_terminal_that_cannot_move_its_cursor_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        monkeypatch.setenv("TERM", "dumb")
        with pytest.raises(ViewError, match="TERM=dumb"):
            terminal()
        monkeypatch.setenv("TERM", "xterm")
        assert terminal().is_terminal
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
    one = a_view(scene(ROOM))
    with Viewer(Console(file=stream, force_terminal=True, color_system="truecolor", width=80, height=24)) as viewer:
        stream.going.clear()
        viewer.show(one)
        assert stream.reached.wait(10.0)
        for _ in range(100):  # the terminal is stuck in the middle of the first picture all the while
            viewer.show(a_view(scene(ROOM)))
        assert not stream.going.is_set()
        stream.going.set()
    assert "GUIDED, armed" in stream.getvalue() and LEAVE.decode() in stream.getvalue()


def test_pictures_are_due_five_times_a_second() -> None:
    viewer = Viewer(Console(file=io.StringIO()))
    assert sum(viewer.is_due(hundredth / 100.0) for hundredth in range(1000)) == pytest.approx(50, abs=2)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_error_gives_the_terminal_back(error: type[BaseException]) -> None:
    stream = io.StringIO()
    with (
        pytest.raises(error),
        Viewer(Console(file=stream, force_terminal=True, color_system="truecolor", width=80, height=24)) as viewer,
    ):
        viewer.show(a_view(scene(ROOM)))
        raise error
    assert stream.getvalue().rindex(LEAVE.decode()) > stream.getvalue().rindex(ENTER.decode())
