"""A web process that begins anew is told everything that the one before it knew, or never got."""

from __future__ import annotations

import json
import threading

from companion.viewer.earlier_track import MOST
from companion.viewer.live_board import LiveBoard
from companion.viewer.past import NEWS_KEPT
from companion.viewer.retelling import Retelling
from tests.companion.viewer.test_live_board import SCENE, frame, heard

FIGURES = {f"figure {number}": 0.123 * number for number in range(12)}


class Board:
    """A receiver that is a live board at once."""

    def __init__(self) -> None:
        self.begins_anew = threading.Event()
        self.is_full = False
        self.board = LiveBoard(False)
        self.longest = 0

    def put(self, kind: bytes, payload: bytes) -> bool:
        if self.is_full:
            return False
        self.longest = max(self.longest, len(payload))
        self.board.take(json.loads(payload))
        return True


def driven(seconds: int) -> Retelling:
    """After so long a drive with a text a second."""
    retelling = Retelling(Board())
    drive(retelling, 0, seconds)
    return retelling


def drive(retelling: Retelling, begin: int, end: int) -> None:
    for second in range(begin, end):
        one = {**frame(float(second), f"at {second}"), "figures": FIGURES}
        retelling.past.take(one)
        retelling.past.news.extend(one["news"])


def told(retelling: Retelling) -> Board:
    """A new process that has been told everything."""
    fresh = retelling._receiver = Board()  # as after a start
    assert not retelling.begins()
    fresh.begins_anew.set()
    assert retelling.begins() and not retelling.begins()
    fresh.is_full = True
    assert not retelling.tell(), "nothing is lost while it takes nothing"
    fresh.is_full = False
    for _ in range(100):
        if retelling.tell():
            return fresh
    raise AssertionError("it takes too many ticks")


def past_of(board: LiveBoard) -> dict:
    texts, _ = heard(board.join(False, lambda: None))
    return next(one for one in texts if one["kind"] == "past")


def test_a_new_process_knows_news_track_and_figures_of_before_and_goes_on() -> None:
    retelling = driven(9000)
    fresh = told(retelling)
    assert heard(fresh.board.join(False, lambda: None))[0] == [], "nobody is told half of it: the scene is not there"
    fresh.board.take(SCENE)
    past = past_of(fresh.board)
    assert past == json.loads(json.dumps(retelling.past.message)) and len(past["news"]) == NEWS_KEPT
    assert past["track"][0][0] == 0.0 and past["track"][-1][0] + 1.0 == past["frames"][0]["t"]
    assert past["news"][-1]["text"] == "at 8999" and past["frames"][-1]["figures"] == FIGURES
    assert fresh.longest < 15_000, "each piece is soon written down"
    drive(retelling, 9000, 9002)
    for second in (9000, 9001):
        fresh.board.take({**frame(float(second), f"at {second}"), "figures": FIGURES})
    past, kept = past_of(fresh.board), json.loads(json.dumps(retelling.past.message))
    assert past["track"][-1][0] + 1.0 == past["frames"][0]["t"]
    assert (past["news"], past["frames"]) == (kept["news"], kept["frames"])


def test_what_came_in_time_from_the_process_before_is_told_once() -> None:
    retelling = driven(3)
    fresh = Board()
    fresh.board.take(frame(2.0, "at 2"))  # queued between the start and its notice
    retelling._receiver = fresh
    fresh.begins_anew.set()
    assert retelling.begins()
    while not retelling.tell():
        pass
    fresh.board.take(SCENE)
    assert [one["text"] for one in past_of(fresh.board)["news"]] == ["at 0", "at 1", "at 2"]


def test_the_longest_track_stays_bounded() -> None:
    retelling = driven(30_000)
    for _ in range(3):
        fresh = told(retelling)
    fresh.board.take(SCENE)
    assert len(past_of(fresh.board)["track"]) <= MOST + 1
