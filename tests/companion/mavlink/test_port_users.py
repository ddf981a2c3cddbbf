"""Who has a port open: real processes, devices and sockets."""

from __future__ import annotations

import os
import pty
import socket
import subprocess
import sys
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from companion.core.clock import WallClock
from companion.mavlink import port_users
from companion.mavlink.byte_link import LinkError
from companion.mavlink.serial_port import SerialLink, rivals_of
from companion.mavlink.transport import open_link

WAIT = "print('there', flush=True); import sys; sys.stdin.read()"


@contextmanager
def other(code: str, *arguments: object, name: str = "thief.py", folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that does something with a port, and waits."""
    script = folder / name
    script.write_text(f"import sys\n{code}\n{WAIT}\n")
    command = [sys.executable, str(script), *map(str, arguments)]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    with child:
        assert child.stdout is not None and child.stdout.readline() == "there\n"
        yield child
        assert child.stdin is not None
        child.stdin.close()


@pytest.fixture
def line() -> Iterator[str]:
    """A pseudo-terminal; this process is its wire."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def test_another_program_on_the_same_device_is_named(line: str, tmp_path: Path) -> None:
    assert port_users.of_device(line) == ()
    link = SerialLink(line, 115200, WallClock())
    with other("port = open(sys.argv[1], 'rb')", line, folder=tmp_path) as thief:
        (user,) = rivals_of(link)
        assert (user.program, user.pid) == ("thief.py", thief.pid) and str(user) == f"thief.py (process {thief.pid})"
    assert rivals_of(link) == ()
    link.close()


def test_who_holds_the_wire_is_no_rival(tmp_path: Path) -> None:
    code = "import os, pty; ends = pty.openpty(); open(sys.argv[1], 'w').write(os.ttyname(ends[1]))"
    with other(code, tmp_path / "name", folder=tmp_path):
        assert port_users.of_device((tmp_path / "name").read_text()) == ()


def test_a_locked_device_is_one_line_with_the_program(line: str, tmp_path: Path) -> None:
    code = "import fcntl; port = open(sys.argv[1], 'rb'); fcntl.flock(port, fcntl.LOCK_EX)"
    with (
        other(code, line, folder=tmp_path) as thief,
        pytest.raises(LinkError, match=rf"cannot be opened: thief\.py \(process {thief.pid}\) uses it; stop that one"),
    ):
        open_link(f"serial:{line}:115200")


@pytest.mark.parametrize(("kind", "url"), [("udp", "udpin"), ("tcp", "tcpin")])
def test_a_taken_network_port_is_one_line_with_the_program(kind: str, url: str, tmp_path: Path) -> None:
    code = (
        f"import socket; taken = socket.socket(type=socket.{'SOCK_DGRAM' if kind == 'udp' else 'SOCK_STREAM'})\n"
        "taken.bind(('127.0.0.1', 0)); open(sys.argv[1], 'w').write(str(taken.getsockname()[1]))\n"
        f"{'' if kind == 'udp' else 'taken.listen()'}"
    )
    with other(code, tmp_path / "port", name="station.py", folder=tmp_path) as thief:
        port = int((tmp_path / "port").read_text())
        (user,) = port_users.of_port(kind, port)
        assert (user.program, user.pid) == ("station.py", thief.pid)
        with pytest.raises(LinkError, match=rf"station\.py \(process {thief.pid}\) has it; stop that one or choose"):
            open_link(f"{url}:127.0.0.1:{port}")


def test_our_own_ports_and_what_is_no_port_have_no_users(tmp_path: Path) -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        assert port_users.of_port("udp", own.getsockname()[1]) == ()
    assert (
        port_users.of_device(str(tmp_path)) == port_users.of_device("/dev/none") == port_users.of_device("a\0b") == ()
    )


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["/usr/bin/mavlink-routerd", "-c", "main.conf"], "mavlink-routerd"),
        (["/usr/bin/python3", "/usr/bin/mavproxy.py", "--master", "x"], "mavproxy.py"),
        (["python3.13", "-u", "-m", "MAVProxy.mavproxy"], "MAVProxy.mavproxy"),
        (["python3"], "python3"),
        ([""], "comm"),
        (["\x1b[31mred"], "[31mred"),
    ],
)
def test_a_program_is_called_what_people_call_it(words: list[str], name: str, tmp_path: Path) -> None:
    (tmp_path / "cmdline").write_bytes("\0".join([*words, ""]).encode())
    (tmp_path / "comm").write_text("comm\n")
    assert port_users._program(tmp_path) == name
