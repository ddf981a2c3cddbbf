"""The live viewer: a web process and what feeds it, for one run.

Nouns: live viewer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from companion.app import Companion, Status
from companion.core.clock import unix_time_us
from companion.settings import Settings
from companion.settings.versions import versions
from companion.viewer.feed import ViewerFeed
from companion.viewer.web_process import WebPlace, WebProcess


class LiveViewer:
    """``web`` is there before the companion, so that a place that cannot be served is told first.

    Whatever goes wrong in it, the drive goes on: ``say`` is told once, and the page has no more news.
    """

    def __init__(self, place: WebPlace, say: Callable[[str], None]) -> None:
        """Raises WebError."""
        self.web = WebProcess(place)
        self._say = say
        self._feed: ViewerFeed | None = None

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
        self._feed = ViewerFeed(companion, self.web, always)

    def show(self, status: Status, contacts: int = 0) -> None:
        """To be called after each tick. ``contacts``: of a simulated rover."""
        if self._feed is None:
            return
        try:
            self._feed.contacts = contacts
            self._feed.show(status)
        except Exception as error:  # a picture is not worth a stop
            self._feed = None
            self._say(f"the page has no more news, the drive goes on: {type(error).__name__}: {error}")

    def close(self) -> None:
        """Tell the last moment, and end."""
        self.web.close()
