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
from companion.mapping.evidence_map import EvidenceMap
from companion.safety.reasons import EndReason, Reason
from companion.viewer import wire
from companion.viewer.arrivals import Arrivals
from companion.viewer.frame import end_of, frame_of, news_of, scene_of, told
from companion.viewer.headway import Headway
from companion.viewer.last_place import LastPlace
from companion.viewer.map_tiles import TileWatch
from companion.viewer.retelling import Receiver, Retelling, run_id
from companion.viewer.steady_frame import SteadyFrame

FRAME_S, TILES_S, SCENE_S = 0.19, 0.09, 2.0
"""So often each is told, in real time."""
LATE_S, MOST_S = 0.19, 0.25
"""After so long a frame does not keep tiles from being told; a look makes up for no more than so long."""
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
        self._note_reach(status)
        if self._companion.done:
            self._tell_last(status, now_s)
            return
        tells = knows_all and not self._receiver.is_full
        if now_s - self._frame_s < FRAME_S:
            if tells:
                self._tell_tiles(status, now_s)
            return
        self._frame_s, frame = now_s, self._frame(status)
        self._retelling.past.take(frame)
        if not tells:
            return
        self._tell_scene(now_s)
        if now_s - self._tiles_s >= LATE_S:
            self._tell_tiles(status, now_s)  # else in a tick of its own: the next one may be due soon
        if self._put({**frame, "news": self._news}):
            self._news = []

    def _tell_last(self, status: Status, now_s: float) -> None:
        """The last moment, with the map as it is; also where nothing more is taken now, as it will be closed then."""
        frame = self._frame(status)
        self._retelling.past.take(frame)
        self._tell_scene(now_s)
        self._tell_tiles(status, now_s, seconds=math.inf)
        if self._put({**frame, "news": self._news}, last=True):
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
        self._tell_tiles(self._companion.status(), stopwatch_s(), seconds=math.inf)
        if self._put({**frame, "news": self._news}, last=True):
            self._news = []

    def _tell_scene(self, now_s: float) -> None:
        """If anything of it is new; looked at now and then only."""
        companion = self._companion
        another = self._notice_map()
        if now_s - self._scene_s < SCENE_S and not another:
            return
        scene = scene_of(companion.mission_run.mission, companion.mission_run, self._epoch)
        scene = {**self.steady.scene(scene), **self._always}
        if scene == self._scene or self._put(scene, last=self._companion.done):
            self._scene, self._scene_s = scene, now_s

    def _notice_map(self) -> bool:
        """Whether it is another map than before."""
        executor = self._companion.executor
        evidence = None if executor is None else executor.evidence
        if evidence is self._evidence:
            return False
        self._evidence, self._epoch = evidence, self._epoch + 1
        self._watch = None if evidence is None else TileWatch(evidence)
        return True

    def _shown_map(self) -> EvidenceMap | None:
        """The map that the page shows; None if it shows none, or another one than the companion has now."""
        executor = self._companion.executor
        if executor is None or executor.evidence is not self._evidence:
            return None
        return executor.evidence

    def _reach_m(self) -> float:
        seen = self._companion.vehicle.scan
        return 0.0 if seen is None else seen.scan.max_range_m

    def _note_reach(self, status: Status) -> None:
        """What may change now must be looked at some time."""
        evidence = self._shown_map()
        if evidence is not None and self._watch is not None and status.pose is not None:
            self._watch.note(evidence, status.pose.point, self._reach_m())

    def _tell_tiles(self, status: Status, now_s: float, seconds: float | None = None) -> None:
        """What has changed. ``seconds``: how long no tiles were told; None: as it is, at most ``MOST_S``."""
        evidence, pose = self._shown_map(), status.pose
        if evidence is None or pose is None or self._watch is None or self._scene.get("map_epoch") != self._epoch:
            return
        if seconds is None and now_s - self._tiles_s < TILES_S:
            return
        due_s = min(now_s - self._tiles_s, MOST_S) if seconds is None else seconds
        self._tiles_s = now_s
        news = self._watch.changed(evidence, pose.point, self._reach_m(), due_s)
        if news and not self._receiver.put(wire.TILES, wire.tile_message(news), last=seconds is not None):
            self._watch.tell_again(place for place, _ in news)

    def _frame(self, status: Status) -> Json:
        places = self._companion.mission_run.places
        self.steady.note(None if places is None else places.origin)
        frame = self.steady.frame(frame_of(self._companion, status, self._headway))
        frame["rates"] = self._rates.at(self._companion.vehicle, status.time_s)
        frame["contacts"] = None if self.touched is None else len(self.touched)
        frame["touched"] = list((self.touched or ())[-TOUCHED_KEPT:])
        return self._last_place.told(frame, self._companion.vehicle, status.time_s)

    def _put(self, message: Json, *, last: bool = False) -> bool:
        return self._receiver.put(wire.JSON, json.dumps(message, allow_nan=False).encode(), last=last)
