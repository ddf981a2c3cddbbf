"""Programs under test: processes whose output is kept and can be waited for, and who is ended when the test ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.forked import Forked
from tests.support.served import PATIENCE_S

AGAIN_S = 1.0
"""After so long a client asks again for what a busy computer did not do in time."""


def installed(module: str, package: str) -> None:
    """A client that is missing is a failure: the extra ``test`` installs it."""
    if find_spec(module) is None:
        pytest.fail(f"{package} is not installed; pip install -c constraints.txt -e '.[test]' does it")


class Program:
    """A running process; ``output`` is all it has said, standard error included."""

    def __init__(self, child: subprocess.Popen[bytes] | Forked) -> None:
        self.child = child
        self.output = ""
        self._since = 0
        self._silent = False
        self._more = threading.Condition()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.child.stdout is not None
        while data := os.read(self.child.stdout.fileno(), 65536):
            with self._more:
                self.output += data.decode(errors="replace")
                self._more.notify_all()
        with self._more:
            self._silent = True
            self._more.notify_all()

    def says(self, pattern: str, limit_s: float = PATIENCE_S) -> re.Match[str]:
        """Wait for a pattern in what it says, from the last thing it was told on."""
        stop_s = time.monotonic() + limit_s
        with self._more:
            while (found := re.search(pattern, self.output[self._since :])) is None:
                if self._silent or time.monotonic() > stop_s:
                    pytest.fail(f"never said: {pattern}\n{self.output}")
                self._more.wait(1.0)
        return found

    def tell(self, line: str) -> None:
        """Type a line."""
        assert self.child.stdin is not None
        with self._more:
            self._since = len(self.output)
        self.child.stdin.write(f"{line}\n".encode())
        self.child.stdin.flush()

    def told(self, line: str, answer: str, again: str = "(?!)") -> re.Match[str]:
        """Type a line and wait for what it answers; where that is ``again``, once more, as a person would."""
        stop_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < stop_s:
            self.tell(line)
            found = self.says(f"(?:{answer})|(?P<again>{again})")
            if found["again"] is None:
                return found
            time.sleep(AGAIN_S)
        pytest.fail(f"again and again: {again}\n{self.output}")

    def ended(self, limit_s: float = PATIENCE_S) -> int:
        """Wait for its end; gives the exit code."""
        code = self.child.wait(timeout=limit_s)
        self._reader.join(timeout=limit_s)
        return code

    def end(self, number: int = signal.SIGTERM) -> int:
        """Close its input and end it; killed if it does not go."""
        assert self.child.stdout is not None
        if self.child.stdin is not None:
            self.child.stdin.close()
        self.child.send_signal(number)
        try:
            code = self.ended(30.0)
        except subprocess.TimeoutExpired:
            self.child.kill()
            code = self.ended()
        for stream in (self.child.stdout, self.child.stderr):
            if stream is not None:
                stream.close()
        return code


@contextmanager
def program(folder: Path, *command: object) -> Iterator[Program]:
    """A Python program (the interpreter's arguments), ended in the end."""
    child = subprocess.Popen(
        [sys.executable, *map(str, command)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd=folder,
        env={**os.environ, "PYTHONUNBUFFERED": "1", "HOME": str(folder)},
    )
    with _ended(Program(child)) as running:
        yield running


@contextmanager
def ours(folder: Path, module: str, *arguments: object) -> Iterator[Program]:
    """``rover-companion`` (module companion) or ``rover-sitl`` (module sitl), ended in the end."""
    environment = {**os.environ, "HOME": str(folder)}
    with _ended(Program(Forked(module, arguments, environment, folder, merged=True))) as running:
        yield running


@contextmanager
def _ended(running: Program) -> Iterator[Program]:
    try:
        yield running
    finally:
        running.end()
