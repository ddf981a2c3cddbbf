"""The live viewer: a web process and what feeds it, for one run.

Nouns: live viewer.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from companion.app import Companion, Status
from companion.core.clock import unix_time_us
from companion.mavlink.local_station import LocalStation
from companion.safety.reasons import EndReason
from companion.settings import Settings
from companion.settings.versions import versions
from companion.viewer import wire
from companion.viewer.feed import ViewerFeed
from companion.viewer.map_tiles import warm_up
from companion.viewer.page_requests import PageRequests
from companion.viewer.web_process import WebPlace, WebProcess

MOST_ERROR = 300
"""So many letters of an error are told."""


class LiveViewer:
    """``web`` is there before the companion, so that a place that cannot be served is told first.

    Whatever goes wrong in it, the drive goes on: ``say`` is told once, and the page has no more news. A process that
    ends is begun anew, and ``say`` is told.
    """

    def __init__(self, place: WebPlace, say: Callable[[str], None], station: LocalStation | None = None) -> None:
        """``station``: asks the companion for what people ask for on the page; None: nobody may. Raises WebError."""
        warm_up()
        self.web = WebProcess(place, takes_actions=station is not None)
        self.station = station
        self._requests = None if station is None else PageRequests(station)
        self._say = say
        self._feed: ViewerFeed | None = None
        self._companion: Companion | None = None
        self._told_of = self.web.started
        """So many processes of the page are known of."""

    def follow(self, companion: Companion, settings: Settings, *, simulated: bool) -> None:
        """From now on this companion is shown."""
        began_s = None if simulated else 1e-6 * unix_time_us() - companion.status().time_s
        always: dict[str, Any] = {
            "live": True,
            "simulated": simulated,
            "began_unix_s": None if began_s is None else round(began_s, 1),
            "versions": versions(),
            "settings": settings.model_dump(mode="json"),
        }
        self._feed, self._companion = ViewerFeed(companion, self.web, always), companion

    def warn(self, text: str) -> None:
        """Something bad that the companion does not know of."""
        if self._feed is not None:
            self._feed.warn(text)

    def show(self, status: Status, touched: Sequence[Sequence[float]] | None = None) -> None:
        """To be called after each tick. ``touched``: where a simulated rover touched something, north and east.

        None: nobody knows, as on a real rover.
        """
        try:
            if self._requests is not None:
                self._requests.note(status.time_s)
            self._pass_on()
        except Exception as error:  # nor is what somebody asks for
            self._requests = None
            self._say(f"nothing is heard from the page any more, the drive goes on: {type(error).__name__}: {error}")
        if self.web.started > max(self._told_of, 1):
            self._say("the page's process had ended; it was started again, and the drive went on")
        self._told_of = self.web.started
        if self._feed is None:
            return
        try:
            self._feed.touched = touched
            self._feed.show(status)
        except Exception as error:  # a picture is not worth a stop
            self._feed = None
            self._say(f"the page has no more news, the drive goes on: {type(error).__name__}: {error}")

    def _pass_on(self) -> None:
        """What was asked for on the page, and the answers."""
        asked = self.web.asked()
        if self._requests is None or self._companion is None:
            return
        origin = None if self._feed is None else self._feed.steady.origin
        for one in asked:
            try:
                self._requests.take(one, self._companion, origin)
            except (ValueError, TypeError, KeyError, OverflowError) as error:  # the next one is heard all the same
                self._say(f"a request of the page is no use: {type(error).__name__}: {error}")
        for answer in self._requests.answered(self._companion):
            self.web.put(wire.JSON, json.dumps(answer).encode())

    def end(self, reason: EndReason) -> None:
        """Tell how a run ended that did not end by itself."""
        if self._feed is None:
            return
        try:
            self._feed.end(reason)
        except Exception as error:  # record and report have still to be closed
            self._feed = None
            self._say(f"the page is not told how the run ended: {type(error).__name__}: {error}")

    def fail(self, error: BaseException) -> None:
        """Tell that an error has ended the program, and which. To be called once the rover has been stopped."""
        what = " ".join(f"{type(error).__name__}: {error}".split())
        self.warn(f"An error has ended the program: {what:.{MOST_ERROR}}")
        self.end(EndReason.ERROR)

    def close(self) -> None:
        """Tell the last moment, and end."""
        self.web.close()
