"""The web process with real sockets: what browsers are told, who may act, and that it never holds up the drive."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from companion.viewer import server, web_process, wire
from companion.viewer.live_board import LiveBoard
from companion.viewer.map_tiles import run_lengths
from companion.viewer.server import ACTIONS_A_SECOND, MOST_BYTES, MOST_SPECTATORS, WebApp, fullest
from companion.viewer.web_process import WebError, WebPlace, WebProcess, web_place
from tests.companion.viewer.test_live_board import SCENE, frame
from tests.support.full_disk import full_after

WAIT_S = 20.0
TOKEN = "a-token-for-tests"


@pytest.fixture
def web() -> Iterator[WebProcess]:
    yield from served("")


@pytest.fixture(scope="module")
def with_token() -> Iterator[WebProcess]:
    yield from served(TOKEN)


def served(token: str) -> Iterator[WebProcess]:
    process = WebProcess(WebPlace("127.0.0.1", 0, token), takes_actions=True)
    try:
        begin(process)
        yield process
    finally:
        process.close()


def begin(process: WebProcess) -> None:
    """Once it listens, tell it the scene."""
    wait_until(lambda: process.begins_anew.is_set() and process.started > 0 and process.process_id is not None)
    process.begins_anew.clear()
    assert process.put(wire.JSON, json.dumps(SCENE).encode())


def wait_until(holds, seconds: float = WAIT_S) -> None:
    end_s = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end_s, "it takes too long"
        time.sleep(0.02)


@contextmanager
def looking(process: WebProcess, token: str | None = None, **headers: str) -> Iterator[ClientConnection]:
    address = f"ws://127.0.0.1:{process.place.port}/ws"
    with connect(address, additional_headers=headers, open_timeout=WAIT_S, compression=None) as client:
        client.send(json.dumps({"kind": "hello", "token": token}))
        yield client


def next_of(client: ClientConnection, kind: str) -> dict:
    while True:
        message = client.recv(WAIT_S)
        if isinstance(message, str) and (told := json.loads(message))["kind"] == kind:
            return told


def newest(client: ClientConnection, until_s: float) -> float:
    """The time of the newest frame, once one of that time has come."""
    while (time_s := next_of(client, "frame")["t"]) < until_s - 1e-6:
        pass
    return time_s


def got(process: WebProcess, path: str, host: str | None = None) -> tuple[int, str]:
    request = urllib.request.Request(f"http://127.0.0.1:{process.place.port}{path}")
    if host is not None:
        request.add_header("Host", host)
    try:
        with urllib.request.urlopen(request, timeout=WAIT_S) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, ""


def test_a_browser_gets_the_page_and_what_the_run_tells(web: WebProcess) -> None:
    status, page = got(web, "/")
    assert status == 200 and "importmap" in page and got(web, "/page/live.js")[0] == 200
    assert got(web, "/page/../server.py")[0] == 404 and got(web, "/page/%2e%2e/server.py")[0] == 404
    with looking(web) as client:
        assert next_of(client, "scene")["mission"] == "yard"
        runs = run_lengths(np.ones((64, 64), np.uint8))
        web.put(wire.TILES, wire.tile_message([((3, 4), runs)]))
        web.put(wire.JSON, json.dumps(frame(1.0, "hello")).encode())
        kinds = [message if isinstance(message, bytes) else json.loads(message)["kind"] for message in
                 (client.recv(WAIT_S) for _ in range(3))]  # fmt: skip
        assert wire.tile_message([((3, 4), runs)]) in kinds and "frame" in kinds


def test_a_companion_that_is_gone_without_a_word_is_told(web: WebProcess) -> None:
    """Its pipe ends, as when it is killed."""
    with looking(web) as client:
        web.put(wire.JSON, json.dumps(frame(1.0)).encode())
        assert next_of(client, "frame")["state"] == "driving"
        web.close()
        last = next_of(client, "frame")
    assert last["state"] == "ended" and last["line"].startswith("ended, the companion's program is gone")


def test_a_process_that_stood_still_until_the_end_is_told_the_end(web: WebProcess) -> None:
    """The queue is full, and yet there is room for the last words."""
    with looking(web) as client:
        web.put(wire.JSON, json.dumps(frame(1.0)).encode())
        assert newest(client, 1.0) == 1.0 and web.process_id is not None
        os.kill(web.process_id, signal.SIGSTOP)
        try:
            for number in range(100_000):
                if not web.put(wire.JSON, json.dumps({**frame(2.0 + number), "line": "x" * 2000}).encode()):
                    break
            assert web.is_full
            assert web.put(wire.JSON, json.dumps(frame(1e6)).encode(), last=True)
        finally:
            os.kill(web.process_id, signal.SIGCONT)
        web.close()
        assert newest(client, 1e6) == 1e6


def test_no_other_page_and_no_other_name_gets_in(web: WebProcess) -> None:
    port = web.place.port
    for origin in ("http://evil.example", "http://127.0.0.1:1", "null"):
        with pytest.raises(InvalidStatus, match="403"), looking(web, Origin=origin):
            pass
    with looking(web, Origin=f"http://127.0.0.1:{port}") as client:
        assert next_of(client, "scene")
    assert got(web, "/", f"evil.example:{port}")[0] == 421
    assert got(web, "/", f"localhost:{port}")[0] == got(web, "/", f"192.168.4.1:{port}")[0] == 200


def test_who_knows_the_token_may_act_and_nobody_else(with_token: WebProcess) -> None:
    act = json.dumps({"kind": "act", "action": "goto", "place": [1.0, 2.0], "t": 9.0})
    with looking(with_token) as client:
        assert next_of(client, "scene")["may_act"] is False
        client.send(act)
        assert next_of(client, "answer") == {"kind": "answer", "action": "goto", "ok": False, "text": "not allowed"}
    with looking(with_token, TOKEN) as client:
        assert next_of(client, "scene")["may_act"] is True
        client.send(act)
        asked: list[dict] = []
        wait_until(lambda: asked.extend(with_token.asked()) or bool(asked))
        assert [(one["action"], one["place"]) for one in asked] == [("goto", [1.0, 2.0])]
        answer = {"kind": "answer", "number": asked[0]["number"], "action": "goto", "ok": True, "text": "accepted"}
        with_token.put(wire.JSON, json.dumps(answer).encode())
        assert next_of(client, "answer")["text"] == "accepted"
    with looking(with_token, "another-token-") as client:
        assert next_of(client, "denied")["text"] == "This token is wrong."
        with pytest.raises(ConnectionClosed):
            client.recv(WAIT_S)
    assert with_token.asked() == []


def test_without_a_token_nobody_may_act(web: WebProcess) -> None:
    with looking(web) as client:
        assert next_of(client, "scene")["may_act"] is False
        client.send(json.dumps({"kind": "act", "action": "pause"}))
        assert next_of(client, "answer")["text"] == "not allowed"
    assert web.asked() == []


@pytest.mark.parametrize(
    "garbage",
    [
        "", "null", "[]", "{", "[" * 1500, '{"kind": "act"}', '{"kind":"act","action":"goto","place":[NaN,1]}',
        '{"kind":"act","action":"pause","goal":"","t":1' + "0" * 400 + "}",
        '{"kind":"act","action":"goto","goal":"","t":1,"place":[1' + "0" * 400 + ",1]}",
    ],
)  # fmt: skip
def test_garbage_is_answered_or_passed_over(with_token: WebProcess, garbage: str) -> None:
    with looking(with_token, TOKEN) as client:
        next_of(client, "scene")
        client.send(garbage)
        assert next_of(client, "answer")["ok"] is False
    for words in ("x" * 100_000, b"bytes"):
        with connect(f"ws://127.0.0.1:{with_token.place.port}/ws", open_timeout=WAIT_S) as rude:
            rude.send(words)
            with pytest.raises(ConnectionClosed):
                rude.recv(WAIT_S)
    assert with_token.asked() == [] and got(with_token, "/")[0] == 200


def test_it_is_started_again_and_told_anew_when_it_is_killed(web: WebProcess) -> None:
    first = web.process_id
    assert first is not None
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: web.put(wire.JSON, json.dumps(frame(1.0)).encode()) and web.started == 2)
    begin(web)
    with looking(web) as client:
        assert next_of(client, "scene")["mission"] == "yard"
    assert web.process_id != first


def test_it_is_started_again_while_the_run_has_nothing_to_tell(web: WebProcess) -> None:
    """As while it compiles."""
    assert web.process_id is not None
    os.kill(web.process_id, signal.SIGKILL)
    wait_until(lambda: web.started == 2)
    begin(web)


def columns_until(client: ClientConnection, until_s: float) -> list[int]:
    """The columns of the tiles that are told before the frame of this time."""
    columns: list[int] = []
    while True:
        message = client.recv(WAIT_S)
        if isinstance(message, bytes):
            columns += [column for (column, _), _ in wire.tiles_in(message)]
        elif (told := json.loads(message))["kind"] == "frame" and told["t"] == until_s:
            return columns


def test_a_piece_of_the_map_is_told_once_and_before_the_frame_after_it(web: WebProcess) -> None:
    runs = run_lengths(np.ones((64, 64), np.uint8))
    with looking(web) as client:
        next_of(client, "scene")
        for number in range(3):
            web.put(wire.TILES, wire.tile_message([((number, 4), runs)]))
            web.put(wire.JSON, json.dumps(frame(1.0 + number)).encode())
            assert columns_until(client, 1.0 + number) == [number]
        for number, message in ((5, {**SCENE, "map_epoch": 2}), (6, frame(9.0))):
            web.put(wire.TILES, wire.tile_message([((number, 4), runs)]))
            web.put(wire.JSON, json.dumps(message).encode())
        assert columns_until(client, 9.0) == [6], "the other one is of the map before"


def test_a_process_that_stalls_costs_moments_and_no_time(web: WebProcess) -> None:
    process_id = web.process_id
    assert process_id is not None
    os.kill(process_id, signal.SIGSTOP)
    big, longest_s, refused = json.dumps({**frame(1.0), "path": [[0.0, 0.0]] * 20_000}).encode(), 0.0, 0
    for _ in range(200):
        began_s = time.perf_counter()
        refused += not web.put(wire.JSON, big)
        longest_s = max(longest_s, time.perf_counter() - began_s)
    assert refused > 100 and web.is_full and longest_s < 0.5
    os.kill(process_id, signal.SIGCONT)
    wait_until(lambda: not web.is_full)
    began_s = time.monotonic()
    web.close()
    assert time.monotonic() - began_s < 5.0


def test_a_process_that_hangs_is_ended_and_begun_anew(web: WebProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    first = web.process_id
    assert first is not None
    os.kill(first, signal.SIGSTOP)
    monkeypatch.setattr(web_process, "HANGS_S", 0.1)
    moment = json.dumps({**frame(1.0), "path": [[0.0, 0.0]] * 100}).encode()
    for _ in range(8 * 5):  # of 8 seconds
        wait_until(lambda: web.put(wire.JSON, moment))
    wait_until(lambda: web.started == 2)
    monkeypatch.undo()
    begin(web)
    with looking(web) as client:
        assert next_of(client, "scene")["mission"] == "yard"
    assert web.process_id != first and not psutil.pid_exists(first)


@pytest.mark.parametrize("said", ["b'x' * 65536", "b'[' * 5000 + b'\\n'", "b'7\\n'"])
def test_a_process_that_talks_nonsense_is_ended_and_another_one_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str
) -> None:
    """Whatever has got into it: it neither fills the memory of the drive nor makes it deaf for good."""
    mad = tmp_path / "python"
    mad.write_text(f"#!{sys.executable}\nimport os\nwhile True: os.write(1, {said})\n")
    mad.chmod(0o755)
    sound = sys.executable
    monkeypatch.setattr(sys, "executable", str(mad))
    monkeypatch.setattr(web_process, "FIRST_WAIT_S", 0.01)
    process = WebProcess(WebPlace("127.0.0.1", 0, TOKEN), takes_actions=True)
    try:
        wait_until(lambda: process.started > 0)
        monkeypatch.setattr(sys, "executable", sound)
        wait_until(lambda: process.put(wire.JSON, b"{}") and process.started > 1)
        begin(process)
        assert process.asked() == []
    finally:
        process.close()


@contextmanager
def unread(port: int) -> Iterator[socket.socket]:
    """A browser that has said hello and reads nothing any more."""
    deaf = socket.create_connection(("127.0.0.1", port))
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    upgrade = (
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {'A' * 22}==",
    )
    head = ("GET /ws HTTP/1.1", f"Host: 127.0.0.1:{port}", *upgrade, "", "")
    deaf.sendall("\r\n".join(head).encode())
    assert deaf.recv(2000).startswith(b"HTTP/1.1 101")
    hello = b'{"kind":"hello"}'
    deaf.sendall(bytes([0x81, 0x80 | len(hello)]) + bytes(4) + hello)
    with deaf:
        yield deaf


def test_a_browser_that_never_reads_holds_up_nobody(web: WebProcess) -> None:
    with unread(web.place.port), looking(web) as client:
        next_of(client, "scene")
        for step in range(40):
            message = json.dumps({**frame(0.2 * step), "path": [[0.0, 0.0]] * 5000}).encode()
            wait_until(lambda told=message: web.put(wire.JSON, told))
        assert newest(client, 0.2 * 39) == pytest.approx(0.2 * 39)


def test_fifty_browsers_all_see_the_newest_moment(web: WebProcess) -> None:
    with ExitStack() as stack:
        clients = [stack.enter_context(looking(web)) for _ in range(50)]
        for step in range(20):
            message = json.dumps(frame(0.2 * step)).encode()
            wait_until(lambda told=message: web.put(wire.JSON, told))
        assert [newest(client, 0.2 * 19) for client in clients] == pytest.approx([0.2 * 19] * 50)


def test_places_and_tokens(tmp_path: Path) -> None:
    assert web_place("8000", None) == WebPlace("127.0.0.1", 8000)
    file = tmp_path / "token"
    place = web_place("0.0.0.0:8000", file)
    assert place.private and place.token == file.read_text().strip() and len(place.token) >= 16
    assert file.stat().st_mode & 0o077 == 0 and web_place("[::1]:8000", file).token == place.token
    assert (
        web_place("8000", None).url == "http://127.0.0.1:8000/" and web_place("[::1]:1", file).url == "http://[::1]:1/"
    )
    for text, given, says in (
        ("0.0.0.0:8000", None, "--web-token FILE"),
        ("http://localhost", None, "not a place"),
        ("70000", None, "not a place"),
        ("a b:8000", None, "not a place"),
        ("127.0.0.1:8000:9", None, "not a place"),
        ("8000", tmp_path, "is a folder; name a file"),
        ("8000", Path("/dev/null"), "is no ordinary file"),
        ("8000", tmp_path / "none" / "token", "there is no folder"),
    ):
        with pytest.raises(WebError, match=says):
            web_place(text, given)
    file.write_text("short")
    with pytest.raises(WebError, match="8 letters or more"):
        web_place("8000", file)
    file.write_text("some long words")
    with pytest.raises(WebError, match="has blanks between words"):
        web_place("8000", file)


def test_a_full_disk_leaves_no_token_that_is_cut(tmp_path: Path) -> None:
    with full_after(5), pytest.raises(WebError, match="File too large"):
        web_place("8000", tmp_path / "token")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("there", "says"), [("starlette websockets", "uvicorn is not"), ("websockets", "starlette, uvicorn are not")]
)
def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, there: str, says: str) -> None:
    monkeypatch.setattr("companion.viewer.web_process.find_spec", lambda name: name if name in there else None)
    with pytest.raises(WebError) as caught:
        web_place("8000", None)
    them = "them" if " are " in says else "it"
    remedy = "pip install 'rover-companion[web]' (in the project's folder: .venv/bin/pip install -e '.[web]')"
    assert str(caught.value) == f"--web: {says} installed; install {them}: {remedy}"


def test_a_port_that_is_taken_is_told_at_once() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(WebError, match=rf"^--web 127.0.0.1:{port}: Address already in use; choose another one$"):
            WebProcess(WebPlace("127.0.0.1", port))


def memory_mb(process: WebProcess) -> float:
    assert process.process_id is not None
    return psutil.Process(process.process_id).memory_info().rss / 1e6


def test_the_fullest_are_ended_and_no_more_than_needed() -> None:
    class Sink:
        def __init__(self, unsent: int) -> None:
            self.get_write_buffer_size = lambda: unsent

    sinks = [Sink(size) for size in (3, 9, 0, 5)]
    assert fullest(sinks, 17) == [] and fullest(sinks, 8) == [sinks[1]]
    assert fullest(sinks, 0) == [sinks[1], sinks[3], sinks[0]]


def test_connections_that_ask_for_nothing_are_ended_and_lock_nobody_out(web: WebProcess) -> None:
    with ExitStack() as stack:
        address = ("127.0.0.1", web.place.port)
        silent = [stack.enter_context(socket.create_connection(address)) for _ in range(300)]
        silent[0].sendall(b"GET / HTTP/1.1\r\nHost:")
        wait_until(lambda: got(web, "/")[0] == 200)
        for one in (silent[0], silent[-1]):
            one.settimeout(WAIT_S)
            with contextlib.suppress(ConnectionResetError):
                assert one.recv(10) == b""


def test_more_than_may_look_on_at_once_are_told_so(web: WebProcess) -> None:
    address = f"ws://127.0.0.1:{web.place.port}/ws"
    with ExitStack() as stack:
        clients = [stack.enter_context(connect(address, open_timeout=WAIT_S)) for _ in range(MOST_SPECTATORS + 6)]
        for client in clients:
            client.send(json.dumps({"kind": "hello", "token": None}))
        turned_away = 0
        for client in clients:
            try:
                next_of(client, "scene")
            except ConnectionClosed as closed:
                turned_away += closed.rcvd is not None and closed.rcvd.code == 1013
        assert turned_away == 6


class Browser:
    """Stands in for a websocket: says what it is given, then nothing; hears everything at once."""

    def __init__(self, *says: str) -> None:
        self.headers = {"host": "127.0.0.1"}
        self.says = list(says)
        self.heard: list[str] = []

    async def accept(self) -> None:
        pass

    async def close(self, code: int = 1000) -> None:
        pass

    async def receive_text(self) -> str:
        if not self.says:
            await asyncio.sleep(WAIT_S)
        return self.says.pop(0)

    async def send_text(self, text: str) -> None:
        self.heard.append(text)


def served_for(seconds: float, app: WebApp, *browsers: Browser) -> None:
    async def serve() -> None:
        tasks = [asyncio.create_task(app.socket(one)) for one in browsers]
        await asyncio.sleep(seconds)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    asyncio.run(serve())


def test_a_browser_hears_something_though_there_is_no_news(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "BEAT_S", 0.02)
    browser = Browser('{"kind":"hello"}')
    served_for(0.3, WebApp(LiveBoard(False), "127.0.0.1", "", False), browser)
    assert 2 <= len(browser.heard) <= 20 and set(browser.heard) == {'{"kind": "beat"}'}


def test_who_asks_too_fast_is_not_read_further_until_its_time() -> None:
    browser = Browser('{"kind":"hello"}', *["[]"] * 1000)
    served_for(0.3, WebApp(LiveBoard(False), "127.0.0.1", "", False), browser)
    told = [json.loads(one)["text"] for one in browser.heard]
    assert told == ["not allowed"] * ACTIONS_A_SECOND + ["too many requests"] and len(browser.says) > 900


MASK = bytes(4)
FLOODS = {
    "messages": (b"", bytes([0x81, 0x80 | 2]) + MASK + b"[]"),
    "pings": (b"", bytes([0x89, 0x80]) + MASK),
    "long pings": (b"", bytes([0x89, 0x80 | 125]) + MASK + bytes(125)),
    "pongs": (b"", bytes([0x8A, 0x80]) + MASK),
    "empty parts of a message": (bytes([0x01, 0x80]) + MASK, bytes([0x00, 0x80]) + MASK),
}
"""What comes first, and what comes again and again."""


def test_who_floods_is_ended_and_others_get_their_frames(web: WebProcess) -> None:
    served, started = psutil.Process(web.process_id), web.started
    with looking(web) as client:
        next_of(client, "scene")
        began_s, before_mb = sum(served.cpu_times()[:2]), memory_mb(web)
        for number, (first, again) in enumerate(FLOODS.values()):
            with unread(web.place.port) as flood:
                flood.settimeout(WAIT_S)
                with pytest.raises(ConnectionError):
                    flood.sendall(first)
                    for _ in range(1000):
                        flood.sendall(again * 10_000)
            message = json.dumps(frame(0.2 * number)).encode()
            wait_until(lambda told=message: web.put(wire.JSON, told))
            assert newest(client, 0.2 * number) == pytest.approx(0.2 * number)
        assert sum(served.cpu_times()[:2]) - began_s < 0.3 and memory_mb(web) < before_mb + 10.0
    assert web.started == started


def test_who_sends_as_much_as_anybody_may_stays(with_token: WebProcess) -> None:
    with looking(with_token, TOKEN) as client:
        next_of(client, "scene")
        for _ in range(ACTIONS_A_SECOND):
            client.send(" " * MOST_BYTES)
        for _ in range(ACTIONS_A_SECOND):
            assert next_of(client, "answer")["ok"] is False


def test_the_page_comes_after_the_drive(web: WebProcess) -> None:
    assert psutil.Process(web.process_id).nice() > psutil.Process().nice()
