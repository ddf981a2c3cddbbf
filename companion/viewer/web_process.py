"""The web process as the run sees it: started beside the drive, fed without ever waiting for it, started again.

A thread writes to its pipe. If the process stalls, the queue fills and moments are left out; if it ends, or takes
nothing for long, another one is started and told everything anew. The drive notices neither.

Nouns: web process.
"""

from __future__ import annotations

import contextlib
import ipaddress
import json
import os
import queue
import secrets
import select
import socket
import stat
import subprocess
import sys
import threading
from collections import deque
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from companion.core.clock import stopwatch_s
from companion.core.extras import not_installed
from companion.storage.files import OsDisk, read_at_most, replace_file
from companion.viewer import wire

QUEUE, QUEUE_LAST = 20, 8
"""So many messages wait; more of them at the end."""
FIRST_WAIT_S, LONGEST_WAIT_S = 0.5, 10.0
"""Before a web process that has ended is started again."""
HANGS_S = 10.0
"""A process that takes nothing for so long is ended."""
PIPE_BYTES = 16 * 1024
"""What waits in a pipe is seconds of moments before anybody notices that nothing is taken: not the usual 64 kB."""
CLOSE_S = 1.5
MOST_ACTIONS = 50
MOST_LINE_BYTES = 10_000
"""Of what a browser asks for, as the web process tells it."""
NICE = 5
"""By so much the drive comes before the page, which others may keep busy."""
NEEDED = ("starlette", "uvicorn", "websockets")
TOKEN_BYTES = 16
LEAST_TOKEN, MOST_TOKEN_BYTES = 8, 1000

WAKE = (b"", b"")
"""No message: whoever waits for one looks round."""

Json = dict[str, Any]


class WebError(Exception):
    """The page cannot be served; the text is one line with place and remedy."""


@dataclass(frozen=True, slots=True)
class WebPlace:
    """Where it is served: ``host``, ``port``; ``token``: empty if nobody may act."""

    host: str
    port: int
    token: str = ""

    @property
    def private(self) -> bool:
        """Whether others than this machine can reach it, so that only those who know the token may look on."""
        return not _is_loopback(self.host)

    @property
    def url(self) -> str:
        """Without the token."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/"


def web_place(text: str, token_file: Path | None) -> WebPlace:
    """The place named by ``[HOST:]PORT``; the token is read from its file, which is made if it does not exist.

    Raises WebError.
    """
    host, _, port_text = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]") or "127.0.0.1"
    if not port_text.isascii() or not port_text.isdigit() or int(port_text) > 65535 or not _may_be_host(host):
        raise WebError(f"--web {text}: not a place to serve; use PORT (at most 65535) or HOST:PORT, for example 8000")
    place = WebPlace(host, int(port_text), "" if token_file is None else _token(token_file))
    if place.private and not place.token:
        raise WebError(
            f"--web {text}: others can reach {host}, so only those who know a token may look on: name a file for it "
            "with --web-token FILE (it is made if it does not exist)"
        )
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise WebError(not_installed("--web", "web", *missing))
    return place


def _token(file: Path) -> str:
    """The token in a file that only its owner may read. Raises WebError."""
    if file.is_dir():
        raise WebError(f"--web-token {file}: is a folder; name a file in it")
    if file.exists() and not file.is_file():
        raise WebError(f"--web-token {file}: is no ordinary file; name one, or one that does not exist yet")
    if not file.parent.is_dir():
        raise WebError(f"--web-token {file}: there is no folder {file.parent}; make it, or name another one")
    try:
        if not file.exists():
            replace_file(OsDisk(), file, f"{secrets.token_urlsafe(TOKEN_BYTES)}\n".encode())  # whole, or not at all
        if others := stat.S_IMODE(file.stat().st_mode) & (stat.S_IRWXG | stat.S_IRWXO):
            raise WebError(f"--web-token {file}: others may use this file (mode bits {others:03o}); chmod 600 {file}")
        token = read_at_most(file, MOST_TOKEN_BYTES).decode("ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not a text of plain letters"
        raise WebError(f"--web-token {file}: {why}") from error
    if len(token) >= LEAST_TOKEN and " " in token:
        raise WebError(f"--web-token {file}: has blanks between words; join them, or delete the file for a new token")
    if len(token) < LEAST_TOKEN or not token.isprintable():
        raise WebError(
            f"--web-token {file}: a token is one word of {LEAST_TOKEN} letters or more; delete the file for a new one"
        )
    return token


def _may_be_host(host: str) -> bool:
    """Whether it is written as a name or an address."""
    if ":" not in host:
        return not any(letter.isspace() or letter in "/[]@" for letter in host)
    try:
        ipaddress.IPv6Address(host)
    except ValueError:
        return False
    return True


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class WebProcess:
    """``begins_anew`` is set whenever a new process knows nothing yet; whoever feeds it clears it."""

    def __init__(self, place: WebPlace, *, takes_actions: bool = False) -> None:
        """``takes_actions``: what browsers ask for is heeded. Raises WebError if the place cannot be listened on."""
        self.place = place
        self.begins_anew = threading.Event()
        self.started = 0
        self._socket = _listening(place)
        self.place = WebPlace(place.host, self._socket.getsockname()[1], place.token)
        self._queue: queue.Queue[tuple[bytes, bytes] | None] = queue.Queue(QUEUE + QUEUE_LAST)
        self._asked: deque[Json] = deque(maxlen=MOST_ACTIONS)
        self._takes_actions = takes_actions
        self._closing = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._keep_up, name="web", daemon=True)
        self._thread.start()

    @property
    def process_id(self) -> int | None:
        """Of the process now."""
        process = self._process
        return None if process is None else process.pid

    @property
    def is_full(self) -> bool:
        """Whether nothing more can be taken now, but for the last ones."""
        return self._queue.qsize() >= QUEUE

    def put(self, kind: bytes, payload: bytes, *, last: bool = False) -> bool:
        """One more message; False, at once, if the process does not keep up. ``last``: see ``Receiver``."""
        if self.is_full and not last:
            return False
        try:
            self._queue.put_nowait((kind, payload))
        except queue.Full:
            return False
        return True

    def asked(self) -> list[Json]:
        """What browsers have asked for since the last call."""
        return [self._asked.popleft() for _ in range(len(self._asked))]

    def close(self) -> None:
        """Let it tell what it has been given, and end it. Takes no longer than ``CLOSE_S``."""
        if self._closing.is_set():
            return
        self._closing.set()
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(None)
        self._thread.join(CLOSE_S)
        process = self._process
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()
        self._socket.close()

    def _keep_up(self) -> None:
        """In a thread: start the process, feed it, and start it again if it ends."""
        wait_s = FIRST_WAIT_S
        while not self._closing.is_set():
            began_s = stopwatch_s()
            with contextlib.suppress(OSError):
                self._feed()
            if self._closing.wait(wait_s):
                return
            wait_s = FIRST_WAIT_S if stopwatch_s() - began_s > LONGEST_WAIT_S else min(2.0 * wait_s, LONGEST_WAIT_S)

    def _feed(self) -> None:
        """One process, from its start to its end. Raises OSError when its pipe breaks, or nothing is taken from it."""
        descriptor = self._socket.fileno()
        command = [sys.executable, "-P", "-m", "companion.viewer.server", str(descriptor)]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, pass_fds=(descriptor,),
            start_new_session=True, pipesize=PIPE_BYTES,
        )  # fmt: skip
        _yield(process.pid)
        self._process, self.started = process, self.started + 1
        gone = threading.Event()
        hearing = threading.Thread(target=self._hear, args=(process, gone), name="web requests", daemon=True)
        hearing.start()
        try:
            assert process.stdin is not None
            os.set_blocking(process.stdin.fileno(), False)
            self._write(process, wire.JSON, json.dumps(self._first()).encode())
            self._drain()
            self.begins_anew.set()
            while (message := self._queue.get()) is not None:
                if gone.is_set():
                    return
                if message is not WAKE:
                    self._write(process, *message)
            process.stdin.close()
            process.wait(CLOSE_S)
        except subprocess.TimeoutExpired:
            pass
        finally:
            process.kill()
            with contextlib.suppress(OSError):
                process.wait()
            hearing.join(CLOSE_S)
            for pipe in (process.stdin, process.stdout):
                with contextlib.suppress(OSError):
                    assert pipe is not None
                    pipe.close()

    def _first(self) -> Json:
        """How it serves."""
        place = self.place
        return {
            "host": place.host, "token": place.token, "private": place.private, "takes_actions": self._takes_actions,
        }  # fmt: skip

    def _write(self, process: subprocess.Popen[bytes], kind: bytes, payload: bytes) -> None:
        """Raises OSError."""
        assert process.stdin is not None
        pipe, rest = process.stdin.fileno(), memoryview(wire.packed(kind, payload))
        room = select.poll()
        room.register(pipe, select.POLLOUT)
        while rest:
            if not room.poll(1000.0 * HANGS_S):
                raise TimeoutError("the web process takes nothing")
            rest = rest[os.write(pipe, rest) :]

    def _drain(self) -> None:
        """What was meant for the process before: the new one is told everything anew."""
        with contextlib.suppress(queue.Empty):
            while True:
                if self._queue.get_nowait() is None:
                    self._closing.set()
                    return

    def _hear(self, process: subprocess.Popen[bytes], gone: threading.Event) -> None:
        """In a thread: what browsers ask for, until the process ends or says anything else; ``gone`` is set then.

        It is seen here at once: there may be nothing to write, as while the run compiles.
        """
        assert process.stdout is not None
        with contextlib.suppress(OSError, ValueError):  # its end
            while line := process.stdout.readline(MOST_LINE_BYTES):
                if (asked := _asked(line)) is None:
                    break
                self._asked.append(asked)
        gone.set()
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(WAKE)


def _asked(line: bytes) -> Json | None:
    """What a line asks for; None if it is none that the web process says."""
    try:
        asked = json.loads(line) if line.endswith(b"\n") else None
    except (ValueError, RecursionError):
        return None
    return asked if isinstance(asked, dict) else None


def _yield(process_id: int) -> None:
    """Let this process come after the drive, as far as the system has it."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process_id, os.getpriority(os.PRIO_PROCESS, 0) + NICE)
    with contextlib.suppress(OSError):  # where sessions share the processor, a session's own value counts
        Path(f"/proc/{process_id}/autogroup").write_text(f"{NICE}\n", encoding="ascii")


def _listening(place: WebPlace) -> socket.socket:
    """A socket that listens, so that a place that is taken is told at once. Raises WebError."""
    listening: socket.socket | None = None
    try:
        found = socket.getaddrinfo(place.host, place.port, type=socket.SOCK_STREAM)[0]
        listening = socket.socket(found[0], socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(found[4])
        listening.listen(64)
    except OSError as error:
        if listening is not None:
            listening.close()
        raise WebError(f"--web {place.host}:{place.port}: {error.strerror or error}; choose another one") from error
    return listening
