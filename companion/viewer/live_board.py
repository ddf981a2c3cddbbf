"""The live board: what a run has told its web process so far, and what each browser has still to be told.

A browser that reads slowly misses frames, never tiles or news. Imports nothing heavy.

Nouns: live board, spectator.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from typing import Any

from companion.safety.reasons import EndReason
from companion.viewer.past import Past
from companion.viewer.wire import NOBODY_DRIVES, Place, tile_message, tiles_in

BACK_S = 1.0
"""A clock that goes back by more than this is another run's."""
TILES_AT_ONCE = 200
WHERE = "why may be in the program's terminal or journal"
TAKE_OVER = f"take the rover over if it still moves; {WHERE}"
RUN_KEYS = ("run", "map_epoch", "began_unix_s", "map")
"""Where one of these differs in a scene, a page forgets the map, and mostly everything that it has heard before."""

Json = dict[str, Any]


class Spectator:
    """One browser: what it has not been told yet. ``wake`` is called whenever there is something."""

    def __init__(self, board: LiveBoard, may_act: bool, wake: Callable[[], None]) -> None:
        self.may_act = may_act
        self.wake = wake
        self._board = board
        self._answers: deque[Json] = deque(maxlen=20)
        self.begin()

    def begin(self) -> None:
        """Everything is to be told, again."""
        self._scene = self._past = True
        self.stale = set(self._board.tiles)
        self._news = self._board.news_count
        self._frame = -1

    def tell_scene(self) -> None:
        """The scene is to be told, again."""
        self._scene = True

    def answer(self, answer: Json) -> None:
        """Something for this one alone."""
        self._answers.append(answer)
        self.wake()

    def messages(self) -> list[str | bytes]:
        """What is to be told now: texts of JSON, and tiles."""
        board, told = self._board, []
        if self._scene and board.scene is not None:
            self._scene = False
            acts = {"may_act": self.may_act and board.takes_actions, "takes_actions": board.takes_actions}
            told.append(json.dumps({**board.scene, **acts}))
            if self._past:
                self._past = False
                told.append(json.dumps(board.past.message))
                self._news = board.news_count
        told += [json.dumps(self._answers.popleft()) for _ in range(len(self._answers))]
        tiles, frames = self._tiles(), self._frames()
        # How a run ended does not wait for a map that may take long.
        return [*told, *frames, *tiles] if board.has_ended else [*told, *tiles, *frames]

    def _tiles(self) -> list[bytes]:
        board = self._board
        if board.scene is None or not self.stale:
            return []
        places = [self.stale.pop() for _ in range(min(TILES_AT_ONCE, len(self.stale)))]
        return [tile_message([(place, board.tiles[place]) for place in places if place in board.tiles])]

    def _frames(self) -> list[str]:
        board = self._board
        if board.frame is None or board.frame_count == self._frame:
            return []
        self._frame = board.frame_count
        all_told = self._news == board.news_count - len(board.frame["news"])
        text = board.frame_text if all_told else board.frame_with(board.news_since(self._news))
        self._news = board.news_count
        return [text]


class LiveBoard:
    """``takes_actions``: whether anybody may act at all."""

    def __init__(self, takes_actions: bool) -> None:
        self.takes_actions = takes_actions
        self.scene: Json | None = None
        self.frame: Json | None = None
        self.frame_text = ""
        """The same as the run has said it, to be passed on as it is."""
        self.frame_count = 0
        self.tiles: dict[Place, bytes] = {}
        self.past = Past()
        """What a browser that comes now has missed."""
        self.news_count = 0
        self._spectators: set[Spectator] = set()

    def __len__(self) -> int:
        """How many look on."""
        return len(self._spectators)

    def join(self, may_act: bool, wake: Callable[[], None]) -> Spectator:
        """One more."""
        spectator = Spectator(self, may_act, wake)
        self._spectators.add(spectator)
        return spectator

    def leave(self, spectator: Spectator) -> None:
        """One less."""
        self._spectators.discard(spectator)

    def news_since(self, count: int) -> list[Json]:
        """The news after the first ``count``, as far as they are kept."""
        kept = self.past.news
        missed = min(self.news_count - count, len(kept))
        return list(kept)[len(kept) - missed :] if missed > 0 else []

    def frame_with(self, news: list[Json]) -> str:
        """The newest frame with other news than its own."""
        return json.dumps({**(self.frame or {}), "news": news})

    def take(self, message: Json, text: str | None = None) -> None:
        """A scene, a frame or a piece of the past of the run. ``text``: the same as it came, if it is known."""
        if message["kind"] == "scene":
            anew = self.scene is None or any(self.scene.get(key) != message.get(key) for key in RUN_KEYS)
            if anew and self.scene is not None:
                self.tiles.clear()
            self.scene = message
            for spectator in self._spectators:
                if anew:
                    spectator.begin()
                else:
                    spectator.tell_scene()
        elif message["kind"] == "past":
            self._take_past(message)
        else:
            self._take_frame(message)
            self.frame_text = json.dumps(message) if text is None else text
        self._wake()

    def take_tiles(self, message: bytes) -> None:
        """Tiles of the map. They are told with the next frame: to wake a browser's task costs more than they do."""
        for place, runs in tiles_in(message):
            self.tiles[place] = runs
            for spectator in self._spectators:
                spectator.stale.add(place)

    def end(self) -> None:
        """Nothing more comes of the run: where it has not said that it ended, its program is gone."""
        if self.frame is not None and not self.has_ended:
            line, why = f"ended, {EndReason.GONE.value}", WHERE if self._is_simulated else TAKE_OVER
            self.take({**self.frame, "news": [], "state": "ended", "line": line, "why": why, **NOBODY_DRIVES})

    @property
    def has_ended(self) -> bool:
        """Whether the run has said so."""
        return self.frame is not None and self.frame["state"] == "ended"

    @property
    def _is_simulated(self) -> bool:
        """Whether the rover is one with the program, and gone with it."""
        return self.scene is not None and bool(self.scene.get("simulated"))

    def _take_frame(self, frame: Json) -> None:
        if frame["t"] < self.past.newest_s - BACK_S:  # a page forgets what was before, too
            self.past = Past()
        self.frame, self.frame_count = frame, self.frame_count + 1
        self.past.news.extend(frame["news"])
        self.news_count += len(frame["news"])
        self.past.take(frame)

    def _take_past(self, piece: Json) -> None:
        """Of before this process: nobody is told of it until the scene has come, too."""
        if piece["anew"]:  # what came in time from the process before is told again
            self.scene, self.frame, self.past = None, None, Past()
            self.tiles.clear()
        self.past.join(piece)
        self.news_count += len(piece["news"])

    def _wake(self) -> None:
        for spectator in self._spectators:
            spectator.wake()
