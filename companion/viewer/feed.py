"""The viewer's feed: looks at a companion after each tick, and tells a web process what is new, a few times a second.

It never waits, and gives up telling whatever would make it wait.

Nouns: viewer feed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

from companion.app import Companion, Status
from companion.core.clock import stopwatch_s
from companion.safety.reasons import EndReason, Reason
from companion.viewer import wire
from companion.viewer.arrivals import Arrivals
from companion.viewer.frame import end_of, frame_of, news_of, scene_of, told
from companion.viewer.headway import Headway
from companion.viewer.last_place import LastPlace
from companion.viewer.map_tiles import TileWatch
from companion.viewer.retelling import Receiver, Retelling, run_id
from companion.viewer.steady_frame import SteadyFrame

FRAME_S, TILES_S, SCENE_S = 0.19, 0.24, 2.0
"""So often each is told, in real time."""
BEHIND_S, LATE_S = 0.04, 0.5
"""So often tiles are told while there are some that nobody has looked at yet; after so long a frame does not keep them
from being told."""
NEWS_KEPT, TOUCHED_KEPT = 200, 50

Json = dict[str, Any]


class ViewerFeed:
    """``always``: keys and values that each scene has, such as versions and settings."""

    def __init__(self, companion: Companion, receiver: Receiver, always: Json) -> None:
        self._companion = companion
        self._receiver = receiver
        self._always = {"run": run_id(), **always}
        self._watch: TileWatch | None = None
        self._evidence: object = None
        self._epoch = 0
        self._scene: Json = {}
        self._frame_s = self._tiles_s = self._scene_s = -math.inf
        self._news: list[Json] = []
        self._retelling = Retelling(receiver)
        self._rates = Arrivals()
        self._last_place, self._headway = LastPlace(), Headway()
        self.steady = SteadyFrame()
        self.touched: Sequence[Sequence[float]] | None = None
        """Where a simulated rover touched something, north and east; whoever knows it writes it here."""

    def warn(self, text: str) -> None:
        """Something bad that the companion does not know of."""
        self._note([told(self._companion.status().time_s, "error", text)])

    def show(self, status: Status) -> None:
        """To be called after each tick."""
        self._headway.note(self._companion, status)
        self._note(news_of(status, self._headway))
        self._rates.note(self._companion.vehicle)
        if self._retelling.begins():
            self._news, self._scene, self._scene_s = [], {}, -math.inf
            if self._watch is not None:
                self._watch.tell_again()
        knows_all, now_s = self._retelling.tell(), stopwatch_s()
        if now_s - self._frame_s < FRAME_S and not self._companion.done:
            if knows_all and not self._receiver.is_full:
                self._tell_tiles(status, now_s)
            return
        self._frame_s, frame = now_s, self._frame(status)
        self._retelling.past.take(frame)
        if self._receiver.is_full or not (knows_all or self._companion.done):
            return
        self._tell_scene(now_s)
        if self._companion.done or now_s - self._tiles_s >= LATE_S:
            self._tell_tiles(status, now_s)  # else in a tick of its own: the next one may be due soon
        if self._put({**frame, "news": self._news}):
            self._news = []

    def _note(self, news: list[Json]) -> None:
        """More news: to be told, and to be kept."""
        self._news = [*self._news, *news][-NEWS_KEPT:]
        self._retelling.past.news.extend(news)

    def end(self, reason: EndReason) -> None:
        """The last moment, of a run that ended otherwise than by itself."""
        frame = self._frame(self._companion.status())
        if frame["state"] != "ended":
            frame.update(**end_of(self._companion, Reason(reason)), **wire.NOBODY_DRIVES)
        if self._put({**frame, "news": self._news}):
            self._news = []

    def _tell_scene(self, now_s: float) -> None:
        """If anything of it is new; looked at now and then only."""
        companion = self._companion
        another = self._notice_map()
        if now_s - self._scene_s < SCENE_S and not another:
            return
        self._scene_s = now_s
        scene = scene_of(companion.mission_run.mission, companion.mission_run, self._epoch)
        scene = {**self.steady.scene(scene), **self._always}
        if scene != self._scene and self._put(scene):
            self._scene = scene

    def _notice_map(self) -> bool:
        """Whether it is another map than before."""
        executor = self._companion.executor
        evidence = None if executor is None else executor.evidence
        if evidence is self._evidence:
            return False
        self._evidence, self._epoch = evidence, self._epoch + 1
        self._watch = None if evidence is None else TileWatch(evidence)
        return True

    def _tell_tiles(self, status: Status, now_s: float) -> None:
        executor, pose = self._companion.executor, status.pose
        if executor is None or pose is None or self._watch is None or self._scene.get("map_epoch") != self._epoch:
            return
        if executor.evidence is not self._evidence:
            return  # another map, of which the scene says nothing yet
        due_s = self._tiles_s + (BEHIND_S if self._watch.is_behind else TILES_S)
        if now_s < due_s and not self._companion.done:
            return
        self._tiles_s = now_s
        seen = self._companion.vehicle.scan
        reach_m = 0.0 if seen is None else seen.scan.max_range_m
        news = self._watch.changed(executor.evidence, pose.point, reach_m)
        if news and not self._receiver.put(wire.TILES, wire.tile_message(news)):
            self._watch.tell_again(place for place, _ in news)

    def _frame(self, status: Status) -> Json:
        places = self._companion.mission_run.places
        self.steady.note(None if places is None else places.origin)
        frame = self.steady.frame(frame_of(self._companion, status, self._headway))
        frame["rates"] = self._rates.at(self._companion.vehicle, status.time_s)
        frame["contacts"] = None if self.touched is None else len(self.touched)
        frame["touched"] = list((self.touched or ())[-TOUCHED_KEPT:])
        return self._last_place.told(frame, self._companion.vehicle, status.time_s)

    def _put(self, message: Json) -> bool:
        return self._receiver.put(wire.JSON, json.dumps(message, allow_nan=False).encode())
