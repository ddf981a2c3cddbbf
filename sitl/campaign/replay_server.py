"""The report of a campaign or a search as a page whose links drive single runs again, each with a record.

Only this machine can reach it. One run is driven at a time, in a process of its own.

Nouns: replay server.
"""

from __future__ import annotations

import contextlib
import html
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from companion.core.clock import stopwatch_s
from companion.storage.files import read_at_most
from sitl.campaign.page_parts import document, served

HOST, HERE = "127.0.0.1", ("127.0.0.1", "localhost")
AGAIN_S = 1
"""So often a page that waits looks again."""
REPORT = "report.html"
PROGRAM, REPORTER = "sitl.cli.main", "companion.cli.main"
MOST_BYTES = 500_000_000
"""Of a report."""
MOST_WORDS = 500
"""Letters of an error that are shown."""


class ServeError(Exception):
    """The port cannot be used; the text is the message for the user."""


@dataclass(frozen=True, slots=True)
class Replay:
    """A run that can be driven again. ``command``: of ``rover-sitl``, without the place of the record.

    ``digest``: of the code and the files that made the run, so that a record of other code is not taken for its record.
    """

    run_id: str
    digest: str
    what: str
    command: Sequence[str]


@dataclass
class _State:
    """How far a replay is. ``began_s``: None while it waits for another one. ``fault``: why there is no record."""

    began_s: float | None = None
    done: bool = False
    fault: str = ""


@dataclass
class Replays:
    """Drives runs again, one at a time; a report that is there is not made again. ``folder``: of their records."""

    folder: Path
    by_id: Mapping[str, Replay]
    run: Callable[[Sequence[str]], subprocess.Popen[str]]
    _states: dict[str, _State] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)
    _turn: Lock = field(default_factory=Lock)
    _process: subprocess.Popen[str] | None = None
    _closed: bool = False

    def report_of(self, run_id: str) -> Path:
        """Where the report of its record is, or will be."""
        return self.folder / f"{run_id}-{self.by_id[run_id].digest}" / REPORT

    def state(self, run_id: str) -> _State:
        """Begin it if it has not begun; one that has failed begins anew after it was told once."""
        with self._lock:
            state, there = self._states.get(run_id), self.report_of(run_id).exists()
            if state is None or (state.done and not state.fault and not there):
                state = self._states[run_id] = _State(done=there)
                if not there:
                    Thread(target=self._drive, args=(run_id, state), daemon=True).start()
            elif state.fault:
                del self._states[run_id]
            return state

    def close(self) -> None:
        """End what is being driven."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()

    def _drive(self, run_id: str, state: _State) -> None:
        """In a thread."""
        place = self.report_of(run_id).parent
        try:
            with self._turn:
                state.began_s = stopwatch_s()
                shutil.rmtree(place, ignore_errors=True)  # what an end before the time has left
                self._done([PROGRAM, *self.by_id[run_id].command, "--record", str(place)])
                self._done([REPORTER, "report", str(place)])
        except Exception as error:  # whatever it is, the page that waits must end
            state.fault = f"{error}" or type(error).__name__
        state.done = True

    def _done(self, command: Sequence[str]) -> None:
        """Wait for a program. Raises ServeError where it fails."""
        with self._lock:
            if self._closed:
                raise ServeError("the server ends")
            self._process = process = self.run(command)
        _, said = process.communicate()
        if process.returncode:
            raise ServeError(f"exit code {process.returncode}: {' '.join(said.split())[-MOST_WORDS:]}")


def program(command: Sequence[str]) -> subprocess.Popen[str]:
    """A program of this project, begun in this folder. ``command``: its module, and what it is told.

    It ends with this process, however that ends, and what lies in the folder takes the place of no module.
    """
    module, *arguments = command
    started = f"from sitl.worker_end import end_with; end_with({os.getpid()}); from {module} import main; main()"
    return subprocess.Popen(
        [sys.executable, "-P", "-c", started, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, errors="replace", start_new_session=True,
    )  # fmt: skip


class ReplayServer:
    """Has its port from the start, so that one that is taken is told before hours of driving."""

    def __init__(self, port: int) -> None:
        """``port``: 0 for any that is free. Raises ServeError when it cannot be used."""
        try:
            self._http = _Http((HOST, port), _Handler)
        except OSError as error:
            raise ServeError(f"--serve {port}: {error.strerror or error}; choose another port") from error

    @property
    def url(self) -> str:
        """Of the report."""
        return f"http://{HOST}:{self._http.server_address[1]}/"

    def serve(self, report: Path, replays: Replays) -> None:
        """Until Ctrl-C, which it raises as KeyboardInterrupt, or ``stop`` in another thread."""
        self._http.RequestHandlerClass = type("_Bound", (_Handler,), {"report": report, "replays": replays})
        try:
            self._http.serve_forever(poll_interval=0.2)
        finally:
            replays.close()

    def stop(self) -> None:
        """End ``serve``, from another thread."""
        self._http.shutdown()

    def close(self) -> None:
        """Let go of the port."""
        self._http.server_close()


class _Http(ThreadingHTTPServer):
    """A thread a request; says nothing of a browser that has gone."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """See ``BaseServer``."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """One request. ``/``: the report; ``/replay/ID``: its run; ``/record/ID``: the report of its record."""

    report: Path
    replays: Replays

    def do_GET(self) -> None:
        """Answer it."""
        host = self.headers.get("Host", "").partition(":")[0].lower()
        # Not for a page of elsewhere, also one whose name was made to lead here.
        if host not in HERE or self.headers.get("Sec-Fetch-Site") == "cross-site":
            return self._answer(HTTPStatus.FORBIDDEN, "only this machine is answered")
        kind, _, run_id = self.path.strip("/").partition("/")
        if not kind:
            return self._file(self.report, served)
        if kind not in ("replay", "record") or run_id not in self.replays.by_id:
            return self._answer(HTTPStatus.NOT_FOUND, "there is no such page")
        if kind == "record" and (file := self.replays.report_of(run_id)).exists():
            return self._file(file)
        return self._replay(run_id)

    def _file(self, file: Path, changed: Callable[[str], str] = str) -> None:
        try:
            text = changed(read_at_most(file, MOST_BYTES).decode())
        except (OSError, UnicodeDecodeError) as error:
            return self._answer(HTTPStatus.NOT_FOUND, f"{file}: cannot be read: {error}")
        return self._page(text)

    def _replay(self, run_id: str) -> None:
        state, what = self.replays.state(run_id), html.escape(self.replays.by_id[run_id].what)
        if state.fault:
            text = f"It could not be driven again: {html.escape(state.fault)}"
            return self._page(document(run_id, [f"<h1>{what}</h1><p>{text}</p>"]))
        if state.done:
            self.send_response(HTTPStatus.SEE_OTHER)
            self.send_header("Location", f"/record/{run_id}")
            self.send_header("Content-Length", "0")
            return self.end_headers()
        text = "This run is driven again as soon as another one is done."
        if state.began_s is not None:
            seconds = stopwatch_s() - state.began_s
            text = f"This run is driven again, and shown here when it is done. {seconds:.0f} s so far."
        return self._page(document(run_id, [f"<h1>{what}</h1><p>{text}</p>"]), again=True)

    def _page(self, text: str, *, again: bool = False) -> None:
        self._answer(HTTPStatus.OK, text, "text/html", again=again)

    def _answer(self, status: HTTPStatus, text: str, kind: str = "text/plain", *, again: bool = False) -> None:
        body = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", f"{len(body)}")
        self.send_header("Cache-Control", "no-store")
        if again:
            self.send_header("Refresh", f"{AGAIN_S}")
        self.end_headers()
        with contextlib.suppress(OSError):  # the browser has gone
            self.wfile.write(body)

    def log_message(self, format: str, *arguments: object) -> None:
        """Nothing is told of single requests."""
