"""A report is served with links that drive runs again: once each, one at a time, and only for this machine."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Thread

import pytest

from sitl.campaign.page_parts import document
from sitl.campaign.replay_server import Replay, Replays, ReplayServer, ServeError
from tests.support.records import MISSIONS
from tests.support.served import PATIENCE_S, wait_until

DRIVE = "import pathlib, sys; pathlib.Path(sys.argv[1]).mkdir(parents=True)"
REPORT = "import pathlib, sys; (pathlib.Path(sys.argv[1]) / 'report.html').write_text('<html>the drive</html>')"
FAIL = "import sys; sys.exit('no such seed')"


class Programs:
    """Small ones in the place of ours. ``wrong``: the drives that fail."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.running: list[subprocess.Popen[str]] = []
        self.at_once = 0
        self.wrong = True

    def __call__(self, command: Sequence[str]) -> subprocess.Popen[str]:
        self.begun.append(" ".join(command[1:-1]))
        is_report = command[1] == "report"
        code = REPORT if is_report else FAIL if self.wrong and "bad" in command else DRIVE
        process = subprocess.Popen([sys.executable, "-c", code, command[-1]], stderr=subprocess.PIPE, text=True)
        self.running.append(process)
        self.at_once = max(self.at_once, sum(one.poll() is None for one in self.running))
        return process


class Served:
    """A report of three runs."""

    def __init__(self, folder: Path) -> None:
        self.programs = Programs()
        self.server = ReplayServer(0)
        runs = [Replay(name, "digest", f"clutter, {name}", ("--replay", name)) for name in ("one", "two", "bad")]
        (folder / "report.html").write_text(document("runs", ["all of them"]))
        self.replays = Replays(folder / "replays", {one.run_id: one for one in runs}, self.programs)
        self.thread = Thread(target=self.server.serve, args=(folder / "report.html", self.replays))
        self.thread.start()

    def get(self, path: str, host: str | None = None) -> tuple[int, str]:
        """The status and the text; redirects are followed."""
        request = urllib.request.Request(self.server.url + path, headers={} if host is None else {"Host": host})
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def until(self, path: str, words: str) -> str:
        """What is there once it has these words; looked for as a browser does that waits."""
        end_s = time.monotonic() + PATIENCE_S
        while words not in (text := self.get(path)[1]):
            assert time.monotonic() < end_s, text
            time.sleep(0.05)
        return text


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    one = Served(tmp_path)
    yield one
    one.server.stop()
    one.thread.join()
    one.server.close()


def test_a_run_is_driven_again_once_and_its_report_shown(served: Served) -> None:
    status, text = served.get("")
    assert status == 200 and 'class="served"' in text and "all of them" in text
    assert served.programs.begun == [], "nothing is driven before it is asked for"
    for name in ("one", "two"):
        assert "driven again" in served.get(f"replay/{name}")[1]
    for name in ("one", "two"):
        assert served.until(f"replay/{name}", "the drive") == "<html>the drive</html>"
    served.get("replay/one")
    assert sorted(served.programs.begun) == ["--replay one --record", "--replay two --record", "report", "report"]
    assert served.programs.at_once == 1, "one at a time"


def test_a_report_that_is_there_is_not_made_again_and_a_torn_record_is(served: Served, tmp_path: Path) -> None:
    whole, torn = (tmp_path / "replays" / f"{name}-digest" for name in ("one", "two"))
    whole.mkdir(parents=True)
    torn.mkdir()
    (whole / "report.html").write_text("<html>of before</html>")
    assert served.get("replay/one")[1] == "<html>of before</html>"
    served.until("replay/two", "the drive")
    assert served.programs.begun == ["--replay two --record", "report"]


def test_a_record_that_was_deleted_is_made_again_and_a_report_that_is_gone_is_told(
    served: Served, tmp_path: Path
) -> None:
    served.until("replay/one", "the drive")
    shutil.rmtree(tmp_path / "replays" / "one-digest")
    served.until("replay/one", "the drive")
    assert served.programs.begun.count("report") == 2
    (tmp_path / "report.html").unlink()
    assert "report.html: cannot be read" in served.get("")[1]


def test_a_run_that_fails_says_why_and_may_be_tried_again(served: Served) -> None:
    assert "exit code 1: no such seed" in served.until("replay/bad", "could not be")
    served.programs.wrong = False
    served.until("replay/bad", "the drive")


def test_nobody_else_and_nothing_else_is_answered(served: Served) -> None:
    for host, status in (
        ("elsewhere.example:80", 403),
        ("localhost", 200),
        ("127.0.0.1", 200),
        ("LOCALHOST:8000", 200),
    ):
        assert served.get("", host)[0] == status
    for path in ("replay/three", "record/..", "replay/../../secret", "elsewhere"):
        assert served.get(path)[0] == 404, path
    assert served.programs.begun == []


def test_a_port_that_is_taken_is_told(served: Served) -> None:
    port = int(served.server.url.rpartition(":")[2].strip("/"))
    with pytest.raises(ServeError, match=f"--serve {port}: .*choose another port"):
        ReplayServer(port)


@pytest.mark.thorough
def test_a_program_ends_with_a_server_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "html.py").write_text("raise SystemExit(9)")  # takes the place of no module of Python's
    code = (
        "from sitl.campaign.replay_server import program\n"
        f"one = program(['sitl.cli.main', 'serve', {str(MISSIONS / 'open.toml')!r}, '--listen', 'tcp:127.0.0.1:0'])\n"
        "print(one.pid, flush=True)\none.communicate()"
    )
    parent = subprocess.Popen([sys.executable, "-P", "-c", code], stdout=subprocess.PIPE, cwd=tmp_path)
    with parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        time.sleep(2.0)
        os.kill(child, 0)
        parent.kill()
    wait_until(lambda: not Path(f"/proc/{child}").exists())


def test_what_is_being_driven_ends_with_the_server(tmp_path: Path) -> None:
    def sleep(command: Sequence[str]) -> subprocess.Popen[str]:
        begun.append(subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, text=True))
        return begun[-1]

    begun: list[subprocess.Popen[str]] = []
    replays = Replays(tmp_path, {"one": Replay("one", "", "one", ())}, sleep)
    state = replays.state("one")
    end_s = time.monotonic() + PATIENCE_S
    while not begun and time.monotonic() < end_s:
        time.sleep(0.01)
    replays.close()
    assert begun[0].wait(PATIENCE_S) < 0
    while not state.done and time.monotonic() < end_s:
        time.sleep(0.01)
    assert state.fault, "and nothing is shown as a drive"
