"""The web process: serves the page, and tells browsers what the run tells it over a pipe.

``python -m companion.viewer.server`` is started by ``web_process`` with the listening socket as a file descriptor. The
first message on its standard input says how it serves. What browsers ask for goes to its standard output, one line of
JSON each. It ends when its input ends. Nothing here imports numpy: it shares a small computer with the drive.

Nouns: web app.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import hashlib
import hmac
import ipaddress
import json
import math
import re
import secrets
import socket
import sys
import threading
from collections import deque
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from companion.viewer import wire
from companion.viewer.live_board import LiveBoard, Spectator

PAGE = Path(__file__).parent / "page"
DENIED, TOO_MANY, SLOW, BAD = 4401, 1013, 1008, 1003
"""Codes with which sockets are closed."""
MOST_SPECTATORS = 64
MOST_BYTES = 2048
"""Of a message of a browser."""
MOST_NAME = 200
HELLO_S, SEND_S = 10.0, 20.0
ACTIONS_A_SECOND = 5
MOST_BYTES_A_SECOND = 8 * MOST_BYTES
"""Of a browser, more than all that is passed on; whoever sends more is ended."""
WRONG_TOKEN_S = 0.5
BEAT_S, BEAT = 2.0, json.dumps({"kind": "beat"})
"""After so long without a word a browser is told that somebody is there: nothing else ends a half-open connection."""
MOST_UNSENT, LOOK_S = 16_000_000, 0.2
"""Bytes that browsers have not taken yet, of all together; they are looked at so often."""
SILENT_S = 5.0
"""After so long a connection without a request is ended: nobody may take all of them."""
MOST_WAITING = 20
"""Messages of the run that have been read but not taken."""
LAST_S = 0.4
"""So long browsers have to be told the last moment."""
LONGEST_S = 1e9
"""Of a time that a page tells."""
FARTHEST_M = 1e7
ACTIONS = ("pause", "resume", "goto", "skip")
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


class WebApp:
    """``token``: what a browser must know to act, and to look on if ``private``; empty: nobody may act.

    ``host``: the name or address that was asked for.
    """

    def __init__(self, board: LiveBoard, host: str, token: str, private: bool) -> None:
        self.board = board
        self._host = host
        self._token = token
        self._private = private
        self._asks: dict[int, Spectator] = {}
        self._asked = secrets.randbelow(2**40)
        """Not from 0: an answer to a request of the process before must not find one of this."""
        index = (PAGE / "index.html").read_text(encoding="utf-8")
        self._index = index
        self._policy = _policy(index)

    def routes(self) -> Starlette:
        """The application."""
        return Starlette(
            routes=[
                Route("/", self.index),
                Mount("/page", _Files(directory=PAGE)),
                WebSocketRoute("/ws", self.socket),
            ]
        )

    async def index(self, request: Request) -> Response:
        """The page."""
        if not self._is_addressed(request):
            return PlainTextResponse("unknown host", 421)
        headers = {**HEADERS, "Content-Security-Policy": self._policy}
        return Response(self._index, media_type="text/html", headers=headers)

    async def socket(self, socket: WebSocket) -> None:
        """One browser."""
        if not self._is_addressed(socket) or not self._is_own_origin(socket):
            await socket.close(DENIED)  # before it is accepted: the browser gets a 403
            return
        await socket.accept()
        # KeyError: bytes where text is wanted.
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, asyncio.TimeoutError, KeyError):
            may_act = await self._greeted(socket)
            if may_act is None:
                return
            if len(self.board) >= MOST_SPECTATORS:
                await socket.close(TOO_MANY)
                return
            await self._serve(socket, may_act)

    async def _greeted(self, socket: WebSocket) -> bool | None:
        """Whether this one may act; None if it may not even look on."""
        hello = _message(await asyncio.wait_for(socket.receive_text(), HELLO_S))
        given = hello.get("token") if hello.get("kind") == "hello" else None
        knows = isinstance(given, str) and bool(self._token) and _same(given, self._token)
        if (given is not None and not knows) or (self._private and not knows):
            await asyncio.sleep(WRONG_TOKEN_S)
            text = "This token is wrong." if given else "The file that --web-token names has it."
            await socket.send_text(json.dumps({"kind": "denied", "text": text}))
            await socket.close(DENIED)
            return None
        return knows

    async def _serve(self, socket: WebSocket, may_act: bool) -> None:
        """Tell it what there is, and hear what it asks for, until either ends."""
        news = asyncio.Event()
        spectator = self.board.join(may_act, news.set)
        news.set()
        tasks = {
            asyncio.create_task(self._tell(socket, spectator, news)),
            asyncio.create_task(self._hear(socket, spectator)),
        }
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.exception()
        finally:
            self.board.leave(spectator)
            self._asks = {number: one for number, one in self._asks.items() if one is not spectator}
            for task in tasks:
                task.cancel()
            with contextlib.suppress(Exception):
                await asyncio.wait_for(socket.close(), 1.0)

    async def _tell(self, socket: WebSocket, spectator: Spectator, news: asyncio.Event) -> None:
        while True:
            # ``wait_for`` would make a task each time, which costs more than the message.
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(BEAT_S):
                    await news.wait()
            if not news.is_set():
                await _sent(socket, BEAT)
            news.clear()
            while messages := spectator.messages():
                for message in messages:
                    await _sent(socket, message)

    async def _hear(self, socket: WebSocket, spectator: Spectator) -> None:
        times_s: deque[float] = deque([-1.0] * ACTIONS_A_SECOND, maxlen=ACTIONS_A_SECOND)
        while True:
            asked = _message(await socket.receive_text())
            now_s = asyncio.get_running_loop().time()
            early_s = times_s[0] + 1.0 - now_s
            times_s.append(now_s)
            fault = "too many requests" if early_s > 0.0 else self._fault(asked, spectator)
            if fault:
                spectator.answer(
                    {"kind": "answer", "action": str(asked.get("action"))[:20], "ok": False, "text": fault}
                )
                await asyncio.sleep(early_s)  # nothing more is read meanwhile, so that the network holds it up
                continue
            self._asked += 1
            self._asks[self._asked] = spectator
            place = asked["place"] if asked["action"] == "goto" else []
            goal, shown_s = str(asked.get("goal", ""))[:MOST_NAME], asked.get("t")
            line = {"number": self._asked, "action": asked["action"], "place": place, "goal": goal, "t": shown_s}
            sys.stdout.write(json.dumps(line) + "\n")
            sys.stdout.flush()

    def _fault(self, asked: dict[str, Any], spectator: Spectator) -> str:
        """Why a request is not even passed on; empty if it is."""
        if not spectator.may_act or not self.board.takes_actions:
            return "not allowed"
        if asked.get("kind") != "act" or asked.get("action") not in ACTIONS:
            return "unknown request"
        if not _is_number(asked.get("t"), LONGEST_S):
            return "no time"
        place = asked.get("place")
        if asked["action"] == "goto" and not (
            isinstance(place, list) and len(place) == 2 and all(_is_number(one, FARTHEST_M) for one in place)
        ):
            return "no place"
        return ""

    def answer(self, answer: dict[str, Any]) -> None:
        """The run's answer to a request, for the browser that asked."""
        spectator = self._asks.pop(answer.pop("number"), None)
        if spectator is not None:
            spectator.answer(answer)

    def _is_addressed(self, request: HTTPConnection) -> bool:
        """Whether the browser means this machine: a name of somebody else's may lead here, too (DNS rebinding)."""
        name = _host_of(request.headers.get("host", ""))
        own = socket.gethostname().lower()
        if name in ("localhost", self._host.lower(), own, f"{own.split('.')[0]}.local"):
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def _is_own_origin(self, socket: WebSocket) -> bool:
        """Whether it comes from this page, or from no page at all."""
        origin = socket.headers.get("origin")
        return origin is None or re.sub(r"^https?://", "", origin) == socket.headers.get("host", "")


class _Files(StaticFiles):
    """The page's files, to be asked for again each time: a newer program may serve them."""

    async def get_response(self, path: str, scope: Any) -> Response:
        response = await super().get_response(path, scope)
        response.headers.update(HEADERS)
        return response


class _Counted(WebSocketsSansIOProtocol):
    """Ends a browser that floods, before its bytes are looked at: the library takes each ping, each pong and each empty
    part of a message at once, and nobody else hears of them."""

    _since_s, _got = -math.inf, 0

    def data_received(self, data: bytes) -> None:
        now_s = self.loop.time()
        if now_s - self._since_s >= 1.0:
            self._since_s, self._got = now_s, 0
        if self.handshake_initiated:  # the request before it may be large: it has the cookies of this host
            self._got += len(data)
        if self._got > MOST_BYTES_A_SECOND:
            self.transport.abort()
        else:
            super().data_received(data)


async def _sent(socket: WebSocket, message: str | bytes) -> None:
    """Send it. Raises TimeoutError if it is not taken."""
    async with asyncio.timeout(SEND_S):
        await (socket.send_text(message) if isinstance(message, str) else socket.send_bytes(message))


def _is_number(value: object, most: float) -> bool:
    """Whether it is a number within bounds; an integer of hundreds of digits is no float."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -most < value < most


def _policy(index: str) -> str:
    """The page may load nothing but its own files; its import map is known by its sum."""
    found = re.search(r'<script type="importmap">(.*?)</script>', index, re.DOTALL)
    digest = hashlib.sha256((found.group(1) if found else "").encode()).digest()
    script = f"'self' 'sha256-{base64.b64encode(digest).decode()}'"
    return (
        f"default-src 'none'; script-src {script}; style-src 'self'; img-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def _host_of(header: str) -> str:
    """The host of a Host header, without port and brackets."""
    host = header.rpartition(":")[0] if re.search(r":\d+$", header) else header
    return host.removeprefix("[").removesuffix("]").lower()


def _same(given: str, token: str) -> bool:
    return hmac.compare_digest(given.encode(errors="replace"), token.encode())


def _message(text: str) -> dict[str, Any]:
    """A browser's message; an empty one if it is none."""
    try:
        message = json.loads(text) if len(text) <= MOST_BYTES else None
    except (ValueError, RecursionError):
        message = None
    return message if isinstance(message, dict) else {}


async def _watch(server: uvicorn.Server) -> None:
    """End connections that fill the memory, the fullest first, and those that ask for nothing.

    The library answers each ping at once, however much the other end has not taken; and it waits for ever for a first
    request.
    """
    since_s: dict[Any, float] = {}
    while True:
        await asyncio.sleep(LOOK_S)
        now_s, open_ones = asyncio.get_running_loop().time(), list(server.server_state.connections)
        since_s = {one: since_s.get(one, now_s) for one in open_ones}
        for transport in fullest([one.transport for one in open_ones], MOST_UNSENT):
            transport.abort()
        for one, first_s in since_s.items():
            if getattr(one, "cycle", True) is None and now_s - first_s > SILENT_S:
                one.transport.abort()


def fullest(transports: list[Any], most: int) -> list[Any]:
    """Those with the most unsent bytes, so many that the others together have no more than ``most``."""
    ordered = sorted(transports, key=lambda one: one.get_write_buffer_size(), reverse=True)
    unsent, ended = sum(one.get_write_buffer_size() for one in ordered), []
    for one in ordered:
        if unsent <= most:
            break
        unsent -= one.get_write_buffer_size()
        ended.append(one)
    return ended


def _listen(app: WebApp, server: uvicorn.Server, loop: asyncio.AbstractEventLoop) -> None:
    """In a thread: what the run says, to the end."""
    room = threading.Semaphore(MOST_WAITING)

    def take(tiles: list[bytes], payload: bytes) -> None:
        room.release()
        for some in tiles:
            app.board.take_tiles(some)
        message = json.loads(payload)
        if message["kind"] == "answer":
            app.answer(message)
        else:
            app.board.take(message, payload.decode())

    tiles: list[bytes] = []
    with contextlib.suppress(ValueError, OSError, RuntimeError):
        while (message := wire.read_message(sys.stdin.buffer)) is not None:
            kind, payload = message
            if kind == wire.TILES:
                tiles.append(payload)  # nobody is told of them before the next frame: that wakes the loop once for both
                continue
            room.acquire()  # a server that hangs takes nothing any more: that is noticed at the other end
            loop.call_soon_threadsafe(take, tiles, payload)
            tiles = []
    with contextlib.suppress(RuntimeError):
        for some in tiles:
            loop.call_soon_threadsafe(app.board.take_tiles, some)
        loop.call_soon_threadsafe(app.board.end)
    with contextlib.suppress(RuntimeError):  # once everybody has been told the last moment
        loop.call_soon_threadsafe(loop.call_later, LAST_S, setattr, server, "should_exit", True)


async def _run(descriptor: int) -> None:
    first = wire.read_message(sys.stdin.buffer)
    if first is None:
        return
    given = json.loads(first[1])
    app = WebApp(
        LiveBoard(given["takes_actions"] and bool(given["token"])), given["host"], given["token"], given["private"]
    )
    config = uvicorn.Config(
        app.routes(),
        log_level="critical",
        ws=_Counted,
        ws_max_size=MOST_BYTES,
        ws_per_message_deflate=False,
        lifespan="off",
        timeout_graceful_shutdown=1,
        server_header=False,
        limit_concurrency=4 * MOST_SPECTATORS,
    )
    server = uvicorn.Server(config)
    threading.Thread(target=_listen, args=(app, server, asyncio.get_running_loop()), daemon=True).start()
    watch = asyncio.create_task(_watch(server))
    await server.serve(sockets=[socket.socket(fileno=descriptor)])
    watch.cancel()


if __name__ == "__main__":
    asyncio.run(_run(int(sys.argv[1])))
