"""``run --web``: the page is served beside the run, and is told what ended it."""

from __future__ import annotations

import json
import re
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner
from websockets.sync.client import ClientConnection, connect

from companion.app import Companion
from companion.cli import run
from companion.cli.commands import app
from companion.cli.web import served
from tests.support.rig import yard
from tests.support.served import mission_path

WAIT_S = 20.0


def next_frame(client: ClientConnection) -> dict[str, Any]:
    while (told := client.recv(WAIT_S))[:1] != "{" or json.loads(told)["kind"] != "frame":
        pass
    return dict(json.loads(told))


class Onlooker:
    """Opens the page at the second tick; once it was shown, the program fails."""

    def __init__(self, ends: ExitStack) -> None:
        self.places: list[str] = []
        self.client: ClientConnection | None = None
        self.first: dict[str, Any] = {}
        self.ticks = 0
        self._ends = ends

    def served(self, *given: Any, **more: Any) -> str:
        line = served(*given, **more)
        self.places.extend(re.findall(r"http://[\d.:]+/", line))
        return line

    def look(self) -> None:
        self.ticks += 1
        if self.ticks < 2:
            return
        (place,) = self.places
        with urllib.request.urlopen(place, timeout=WAIT_S) as answer:
            assert "importmap" in answer.read().decode()
        self.client = self._ends.enter_context(connect(f"ws{place.removeprefix('http')}ws", open_timeout=WAIT_S))
        self.client.send(json.dumps({"kind": "hello", "token": None}))
        self.first = next_frame(self.client)
        raise RuntimeError("made up")


def test_the_page_shows_the_run_and_the_error_that_ended_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ExitStack() as ends:
        onlooker, tick = Onlooker(ends), Companion.tick
        monkeypatch.setattr(Companion, "tick", lambda companion: (tick(companion), onlooker.look()))
        monkeypatch.setattr(run, "served", onlooker.served)
        mission = mission_path(yard(tmp_path))
        result = CliRunner().invoke(app, ["run", str(mission), "--connect", "udpin:127.0.0.1:0", "--web", "0"])
        assert str(result.exception) == "made up" and "the run is shown at" in result.stderr
        assert onlooker.client is not None
        last = next_frame(onlooker.client)
    assert onlooker.first["state"] in ("connecting", "waiting") and last["state"] == "ended"
    assert last["line"] == "ended, an error in the program: 0 of 1 targets reached"
    assert last["news"][-1]["text"] == "An error has ended the program: RuntimeError: made up"
