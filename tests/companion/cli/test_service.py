"""What systemd and its journal are told."""

from __future__ import annotations

import os
import socket
from pathlib import Path

from companion.cli.live import Reader, levelled, reader_of
from companion.cli.service import Service
from companion.core.severity import Severity
from companion.operator.notifications import Status
from companion.safety.reasons import Activity, RunPhase


def status(time_s: float, phase: RunPhase) -> Status:
    return Status(time_s, Activity(phase), None, None, "", 0, 1, 0)


def test_systemd_is_told_that_it_is_ready_alive_and_ending(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(5.0)
        service = Service({"NOTIFY_SOCKET": str(tmp_path / "notify")})
        service.ready()
        for tick in range(41):
            service.show(status(0.05 * tick, RunPhase.DRIVING if tick < 30 else RunPhase.STAYING))
        service.stopping()
        told = []
        while not told or told[-1] != "STOPPING=1":
            told.append(systemd.recv(1000).decode())
    assert told[0] == "READY=1"
    assert told[1:-1] == [f"WATCHDOG=1\nSTATUS={doing}" for doing in ("driving", "driving", "staying at the target")]


def test_an_abstract_socket_is_found() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        name = f"rover-companion-test-{os.getpid()}"
        systemd.bind(f"\0{name}")
        systemd.settimeout(5.0)
        service = Service({"NOTIFY_SOCKET": f"@{name}"})
        service.ready()
        service.stopping()
        assert systemd.recv(100) == b"READY=1"


def test_without_systemd_nothing_happens(tmp_path: Path) -> None:
    for environment in ({}, {"NOTIFY_SOCKET": str(tmp_path / "none")}, {"NOTIFY_SOCKET": "vsock:2:3"}):
        service = Service(environment)
        service.ready()
        service.show(status(0.0, RunPhase.DRIVING))
        service.stopping()
    assert list(tmp_path.iterdir()) == [], "not even a socket"


def test_who_reads_is_known_and_gets_the_level_his_way() -> None:
    ours, theirs = os.pipe()
    stat = os.fstat(theirs)
    journal = {"JOURNAL_STREAM": f"{stat.st_dev}:{stat.st_ino}"}
    assert reader_of(theirs, journal) is Reader.JOURNAL
    assert reader_of(ours, {"JOURNAL_STREAM": "1:2"}) is reader_of(ours, {}) is Reader.LOG
    os.close(ours)
    assert reader_of(ours, {}) is Reader.LOG
    master, terminal = os.openpty()
    assert reader_of(terminal, {}) is Reader.PERSON
    for descriptor in (master, terminal, theirs):
        os.close(descriptor)
    assert levelled("HOLD: no position", Severity.WARNING, Reader.JOURNAL) == "<4>HOLD: no position"
    assert levelled("HOLD: no position", Severity.WARNING, Reader.LOG) == "warning: HOLD: no position"
    assert levelled("HOLD: no position", Severity.WARNING, Reader.PERSON) == "HOLD: no position"
