"""The past of a run: its track, its news, and one frame a second of the last while.

The web process keeps it for browsers that come later, the feed for a web process that begins anew. Imports nothing
heavy.

Nouns: past.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from companion.viewer.earlier_track import EarlierTrack

PAST_S = 600.0
EVERY_S = 1.0
"""One frame a second is kept, for so long; of what was before only the track."""
NEWS_KEPT = 500
KEPT_OF_PAST = ("kind", "t", "pose", "speed", "state", "figures", "statuses")
AT_ONCE = {"track": 300, "frames": 20, "news": 100}
"""So much is in one piece: to write it down takes less than a millisecond."""

Json = dict[str, Any]


class Past:
    """Takes frames of one run, in the order of time; ``news`` are added by whoever has them."""

    def __init__(self) -> None:
        self.frames: deque[Json] = deque(maxlen=round(PAST_S / EVERY_S))
        self.earlier = EarlierTrack()
        self.news: deque[Json] = deque(maxlen=NEWS_KEPT)
        self.newest_s = -EVERY_S

    def take(self, frame: Json) -> None:
        """One more; kept if a second has passed."""
        if 0.0 <= frame["t"] - self.newest_s < EVERY_S:
            return
        self.newest_s = frame["t"]
        if len(self.frames) == self.frames.maxlen:
            self.earlier.add(self.frames[0])
        self.frames.append({key: frame[key] for key in KEPT_OF_PAST})

    @property
    def message(self) -> Json:
        """All of it."""
        return {"kind": "past", "track": self.earlier.places, "news": list(self.news), "frames": list(self.frames)}

    def pieces(self) -> list[Json]:
        """The same as several messages, each soon written down. The first one says that nothing was before."""
        whole = self.message
        empty = {"kind": "past", "anew": False, "track": [], "news": [], "frames": []}
        return [{**empty, "anew": True}] + [
            {**empty, key: whole[key][at : at + most]}
            for key, most in AT_ONCE.items()
            for at in range(0, len(whole[key]), most)
        ]

    def join(self, piece: Json) -> None:
        """The next piece of another one's past."""
        self.earlier.extend(piece["track"])
        for frame in piece["frames"]:
            self.take(frame)
        self.news.extend(piece["news"])
