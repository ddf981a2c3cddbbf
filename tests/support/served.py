"""A simulated rover on a TCP port of this process, and the companion as a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.clock import WallClock
from companion.mission.mission import Mission
from sitl.network import open_endpoint
from sitl.network.server import serve
from sitl.scenario import scenario_from_mission
from sitl.simulator import Simulator
from tests.sitl.network.test_server import free_port
from tests.support.forked import Forked

READY_S = 45.0
PATIENCE_S = 180.0
"""For anything that other processes do, on a machine that is busy with other things."""
PATIENT = """
[safety]
stale_s = 5.0
hold_after_s = 60.0
heartbeat_s = 30.0
latency_s = 10.0
planner_s = 120.0
"""
"""Settings of a companion that does not give up on a busy machine."""


class Served:
    """The simulator runs in a thread in real time; it has been switched on long enough to be armed."""

    def __init__(self, mission: Mission, *more: str, parameters: Mapping[str, float] | None = None) -> None:
        """``more``: addresses to listen on besides TCP. ``parameters``: of the autopilot, besides the mission's."""
        scenario = scenario_from_mission(mission)
        scenario = replace(scenario, parameters={**scenario.parameters, **(parameters or {})})
        self.simulator: Simulator = scenario.simulator(0)
        self.simulator.advance_to_s(READY_S)
        self.url = f"tcp:127.0.0.1:{free_port()}"
        self._endpoints = [
            open_endpoint(url, self.simulator, serial_port=port) for port, url in enumerate((self.url, *more))
        ]
        self._running = True
        self._pilot = self.simulator.connect()
        self._pilot_mav = mavlink.MAVLink(None, 255, 190)
        self._parser = mavlink.MAVLink(None)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        serve(self.simulator, self._endpoints, WallClock().now_s, 1.0, lambda: self._running)

    def pilot(self, command: int, *parameters: float) -> None:
        filled = [*parameters, *([0.0] * (7 - len(parameters)))]
        message = mavlink.MAVLink_command_long_message(1, 1, command, 0, *filled)
        self._pilot.receive(message.pack(self._pilot_mav))

    def heard(self) -> list[Any]:
        """What the ground station has been sent since the last call."""
        return self._parser.parse_buffer(self._pilot.take()) or []

    def mode(self) -> int:
        """As the next heartbeats say."""
        self.heard()
        beats: list[Any] = []
        wait_until(lambda: bool(beats.extend(self._beats()) or beats))
        return int(beats[-1].custom_mode)

    def _beats(self) -> list[Any]:
        return [m for m in self.heard() if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1]

    def close(self) -> None:
        self._running = False
        self._thread.join(timeout=PATIENCE_S)
        for endpoint in self._endpoints:
            endpoint.close()


def wait_until(done: Callable[[], bool]) -> None:
    stop_s = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < stop_s, f"not within {PATIENCE_S} s"
        time.sleep(0.02)


def slowness() -> float:
    """How many times longer some work takes now than on a quiet machine; at least 1."""
    began_s, worked_s = time.monotonic(), time.thread_time()
    while time.thread_time() < worked_s + 0.1:
        pass
    return max(1.0, (time.monotonic() - began_s) / 0.1)


class Stopwatch:
    """How long a block takes, and how busy the machine is meanwhile: a thread works a little all the time."""

    def __enter__(self) -> Stopwatch:
        """Begin."""
        self._over = threading.Event()
        self._worked_s = self._passed_s = 0.0
        self._sampler = threading.Thread(target=self._sample, daemon=True)
        self._sampler.start()
        self._began_s = time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        """End."""
        self._took_s = time.monotonic() - self._began_s
        self._over.set()
        self._sampler.join()

    @property
    def quiet_s(self) -> float:
        """How long the block would have taken on a quiet machine."""
        return self._took_s / max(1.0, self._passed_s / self._worked_s)

    def _sample(self) -> None:
        while True:
            began_s, worked_s = time.monotonic(), time.thread_time()
            while time.thread_time() < worked_s + 0.004:
                pass
            self._worked_s += time.thread_time() - worked_s
            self._passed_s += time.monotonic() - began_s
            if self._over.wait(0.05):
                return


@contextmanager
def process(module: str, *arguments: object, first: str = "", watchdogs: bool = False) -> Iterator[Forked]:
    """Runs ``rover-companion`` (module companion) or ``rover-sitl`` (module sitl), and kills it at the end.

    ``first``: code that the process runs before anything else. A companion that drives has PATIENT settings, unless it
    has others or ``watchdogs`` asks for the default ones.
    """
    with tempfile.TemporaryDirectory() as folder:
        if not watchdogs:
            arguments = _patient(module, arguments, Path(folder))
        with Forked(module, arguments, {**os.environ, "XDG_STATE_HOME": folder}, first=first) as child:
            try:
                yield child
            finally:
                child.kill()


@contextmanager
def interpreter(module: str, *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Like ``process``, in an interpreter of its own that has loaded nothing."""
    with tempfile.TemporaryDirectory() as folder:
        code = f"from {module}.cli.main import main; main()"
        command = [sys.executable, "-c", code, *map(str, _patient(module, arguments, Path(folder)))]
        environment = {**os.environ, "XDG_STATE_HOME": folder}
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        ) as child:
            try:
                yield child
            finally:
                child.kill()


def _patient(module: str, arguments: tuple[object, ...], folder: Path) -> tuple[object, ...]:
    if module != "companion" or arguments[0] != "run" or "--settings" in arguments:
        return arguments
    patient = folder / "patient.toml"
    patient.write_text(PATIENT)
    return *arguments, "--settings", patient


def finished(child: Forked | subprocess.Popen[str]) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a process that has ended or will."""
    out, err = child.communicate(timeout=PATIENCE_S)
    return child.wait(), out, err


@contextmanager
def served(mission: Mission, parameters: Mapping[str, float] | None = None) -> Iterator[Served]:
    world = Served(mission, parameters=parameters)
    try:
        yield world
    finally:
        world.close()


def mission_path(mission: Mission) -> Path:
    assert mission.source is not None
    return mission.source
