"""The two programs as processes of their own, forked from one that has loaded them.

A start then takes milliseconds. A fresh interpreter needs seconds of a processor, most of them to load the compiler
and the kernels; ``test_entry.py``, ``test_outputs.py`` and ``test_realtime.py`` start some.
"""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.reduction import DupFd
from pathlib import Path
from types import TracebackType
from typing import IO, Any

PRELOADED = "tests.support.preloaded"
LIMIT_S = 180.0
"""For a command on a busy machine."""


class Forked:
    """A running program, used like a ``subprocess.Popen`` with pipes for standard output and standard error.

    ``module``: companion or sitl. ``first``: code that the process runs before anything else. ``merged``: standard
    error goes to standard output. Standard input is empty. ``terminal``: an open one that
    takes the place of all three.
    """

    stdin = None

    def __init__(
        self,
        module: str,
        arguments: Sequence[object],
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
        first: str = "",
        *,
        merged: bool = False,
        terminal: int | None = None,
    ) -> None:
        context = get_context("forkserver")
        context.set_forkserver_preload([PRELOADED])
        pipes = [os.pipe() for _ in range(2)]
        outputs = [pipes[0][1], pipes[0 if merged else 1][1]]
        streams = [None, *outputs] if terminal is None else [terminal] * 3
        self._process = context.Process(
            target=_run,
            args=(
                module,
                [str(argument) for argument in arguments],
                dict(os.environ if environment is None else environment),
                str(folder or Path.cwd()),
                first,
                [None if stream is None else _Descriptor(stream) for stream in streams],
            ),
        )
        self._process.start()
        for _, write in pipes:
            os.close(write)
        self.stdout, self.stderr = (_reader(read) for read, _ in pipes)

    @property
    def pid(self) -> int:
        """Of the process, for signals."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Exit code, or minus the number of the signal that has ended it; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """As ``returncode``."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end. Raises subprocess.TimeoutExpired."""
        self._process.join(timeout)
        if (code := self.returncode) is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Nothing happens if it has ended."""
        if self.returncode is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """All that it still says, after its end. Raises subprocess.TimeoutExpired."""
        said = {}

        def read(stream: IO[str]) -> None:
            said[stream] = stream.read()

        readers = [threading.Thread(target=read, args=(stream,), daemon=True) for stream in (self.stdout, self.stderr)]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join(timeout)
        return said[self.stdout], said[self.stderr]

    def __enter__(self) -> Forked:
        """The process itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wait for its end and close the pipes."""
        self.wait()
        self.stdout.close()
        self.stderr.close()


def run(module: str, *arguments: object, folder: Path | None = None, **changed: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command. ``changed``: variables of its environment."""
    with Forked(module, arguments, {**os.environ, **changed}, folder) as child:
        out, err = child.communicate(timeout=LIMIT_S)
    return child.wait(), out, err


class _Descriptor:
    """An open file of this process, in the other process its number there."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __reduce__(self) -> tuple[Any, ...]:
        """As it is sent to the other process."""
        return _received, (DupFd(self._number),)


def _received(sent: Any) -> int:
    return int(sent.detach())


def _reader(descriptor: int) -> IO[str]:
    return io.TextIOWrapper(io.FileIO(descriptor, closefd=True), encoding="utf-8", errors="replace")


def _run(
    module: str, arguments: list[str], environment: dict[str, str], folder: str, first: str, streams: list[int | None]
) -> None:
    """In the new process: what an interpreter does before it calls ``main``."""
    for number, stream in enumerate(streams):
        if stream is not None:
            os.dup2(stream, number)
            os.close(stream)
    sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False), "utf-8", line_buffering=os.isatty(1))
    sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), "utf-8", "backslashreplace", line_buffering=True)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = [f"rover-{module}", *arguments]
    exec(first, {"__name__": "first"})
    import_module(f"{module}.cli.main").main()
