"""The web feed of the simulator: looks at it in each round, and tells a web process what is new, a few times a second.

It never waits. Whatever goes wrong in it, the simulator goes on.

Nouns: web feed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import Any

from companion.viewer import wire
from companion.viewer.feed import FRAME_S, NEWS_KEPT, SCENE_S
from companion.viewer.frame import told
from companion.viewer.retelling import Receiver, Retelling, run_id
from sitl.simulator import Simulator
from sitl.view.true_frame import frame_of, scene_of
from sitl.view.true_map import TrueMap
from sitl.view.watching import AutopilotState, Rates

HEARD_S = 5.0
"""So long after a client's last packet, in real time, it counts as connected."""
STOPPED = "the simulator was stopped"

Json = dict[str, Any]


class WebFeed:
    """``name``: of the mission; ``how``: how to connect, for a person; ``say``: told once if the page has to end.

    ``targets``: of the mission, with name and place, for people: the simulator itself knows of none.
    """

    def __init__(
        self,
        simulator: Simulator,
        receiver: Receiver,
        name: str,
        how: str,
        say: Callable[[str], None],
        targets: Sequence[Json] = (),
    ) -> None:
        self._simulator = simulator
        self._receiver = receiver
        self._name = name
        self._how = how
        self._say = say
        self._targets = list(targets)
        self._map = TrueMap(simulator.world)
        self._was = AutopilotState(simulator)
        self._scene: Json = {}
        self._frame_s = self._scene_s = -math.inf
        self._news: list[Json] = []
        self._retelling = Retelling(receiver)
        self._run = run_id()
        self._rates = Rates()
        self._heard: dict[str, tuple[int, float]] = {}
        """Packets heard on each link, and when the last came."""
        self._ended = False

    def tell(self, line: str, level: str = "info") -> None:
        """One more of the news."""
        one = told(self._simulator.time_s, level, line)
        self._news = [*self._news, one][-NEWS_KEPT:]
        self._retelling.past.news.append(one)

    def show(self, now_s: float) -> None:
        """To be called in each round. ``now_s``: real seconds."""
        if self._ended:
            return
        try:
            self._show(now_s)
        except Exception as error:  # a picture is not worth a stop
            self._ended = True
            self._say(f"the page has no more news, the simulator goes on: {type(error).__name__}: {error}")

    def end(self, now_s: float) -> None:
        """The last moment. ``now_s``: real seconds."""
        if self._ended:
            return
        self._ended = True
        try:
            self._put({**self._frame(now_s), "news": self._news, "state": "ended", "line": STOPPED, "why": ""})
        except Exception as error:  # what was asked for on the terminal has still to be told
            self._say(f"the page is not told of the end: {type(error).__name__}: {error}")

    def _show(self, now_s: float) -> None:
        was, self._was = self._was, AutopilotState(self._simulator)
        for line in self._was.events_since(was):
            self.tell(line, "warning" if self._was.is_off else "notice")
        if self._retelling.begins():
            self._news, self._scene, self._scene_s = [], {}, -math.inf
            self._map.tell_again()
        knows_all = self._retelling.tell()
        if now_s - self._frame_s < FRAME_S:
            return
        self._frame_s, frame = now_s, self._frame(now_s)
        self._retelling.past.take(frame)
        if self._receiver.is_full or not knows_all:
            return
        self._tell_scene(now_s)
        self._tell_map()
        if self._put({**frame, "news": self._news}):
            self._news = []

    def _tell_scene(self, now_s: float) -> None:
        if now_s - self._scene_s < SCENE_S:
            return
        self._scene_s = now_s
        scene = {**scene_of(self._simulator, self._name), "targets": self._targets, "run": self._run}
        if scene != self._scene and self._put(scene):
            self._scene = scene

    def _tell_map(self) -> None:
        if not self._scene.get("map"):
            return
        self._map.look(self._simulator.time_s)
        tiles = self._map.take()
        if tiles and not self._receiver.put(wire.TILES, wire.tile_message(tiles)):
            self._map.put_back(tiles)

    def _frame(self, now_s: float) -> Json:
        simulator = self._simulator
        rates = self._rates.update(
            simulator.time_s, {link.name: (link.heard.packets, link.sent.packets) for link in simulator.links}
        )
        return frame_of(simulator, self._connected(now_s), rates, self._how)

    def _connected(self, now_s: float) -> list[str]:
        """Links on which somebody has been heard lately."""
        counts = {link.name: link.heard.packets for link in self._simulator.links}
        for name, count in counts.items():
            before, _ = self._heard.get(name, (0, 0.0))
            if count != before:
                self._heard[name] = count, now_s
        self._heard = {name: seen for name, seen in self._heard.items() if name in counts}
        return [name for name, (_, last_s) in self._heard.items() if now_s - last_s <= HEARD_S]

    def _put(self, message: Json) -> bool:
        return self._receiver.put(wire.JSON, json.dumps(message, allow_nan=False).encode())
