"""What each browser is told of what a run has told, however slowly it reads."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

from companion.viewer.earlier_track import MOST
from companion.viewer.live_board import TILES_AT_ONCE, LiveBoard, Spectator
from companion.viewer.map_tiles import run_lengths
from companion.viewer.past import NEWS_KEPT, PAST_S
from companion.viewer.wire import tile_message, tiles_in

RUNS = run_lengths(np.ones((64, 64), np.uint8))
SCENE = {"kind": "scene", "map_epoch": 1, "mission": "yard"}


def frame(t: float, *news: str) -> dict[str, object]:
    told = [{"t": t, "level": "info", "text": text, "own": True} for text in news]
    return {"kind": "frame", "t": t, "pose": [t, 0.0, 0.0], "speed": 1.0, "state": "driving", "figures": {},
            "statuses": ["pending"], "path": [[0, 0]] * 50, "news": told}  # fmt: skip


def heard(spectator: Spectator) -> tuple[list[dict], list[tuple[int, int]]]:
    """Everything that it is told: messages, and places of tiles."""
    texts, places = [], []
    while messages := spectator.messages():
        for message in messages:
            if isinstance(message, bytes):
                places += [place for place, _ in tiles_in(message)]
            else:
                texts.append(json.loads(message))
    return texts, places


def board(takes_actions: bool = False) -> LiveBoard:
    made = LiveBoard(takes_actions)
    made.take(SCENE)
    return made


def test_who_comes_late_is_told_scene_past_map_and_the_newest_frame() -> None:
    live = board()
    for step in range(50):
        live.take(frame(0.2 * step, f"news {step}"))
    live.take_tiles(tile_message([((column, 0), RUNS) for column in range(TILES_AT_ONCE + 50)]))
    texts, places = heard(live.join(False, lambda: None))
    assert [text["kind"] for text in texts] == ["scene", "past", "frame"] and texts[0]["may_act"] is False
    past = texts[1]["frames"]
    assert [one["t"] for one in past] == [float(second) for second in range(10)] and "path" not in past[0]
    told = [one["text"] for one in texts[1]["news"]]
    assert told == [f"news {step}" for step in range(50)] and texts[2]["t"] == 9.8 and texts[2]["news"] == []
    assert sorted(places) == [(column, 0) for column in range(TILES_AT_ONCE + 50)]


def test_tiles_wake_nobody_and_are_told_before_the_next_frame() -> None:
    live, woken = board(), []
    looks_on = live.join(False, lambda: woken.append(1))
    live.take(frame(0.0))
    heard(looks_on)
    woken.clear()
    live.take_tiles(tile_message([((3, 4), RUNS)]))
    assert not woken
    live.take(frame(0.2))
    tiles, told = looks_on.messages()
    assert woken == [1] and json.loads(told)["t"] == 0.2
    assert [place for place, _ in tiles_in(tiles)] == [(3, 4)]


def test_the_end_is_told_before_a_map_that_may_take_long() -> None:
    live = board()
    live.take_tiles(tile_message([((3, 4), RUNS)]))
    live.take({**frame(1.0), "state": "ended"})
    looks_on = live.join(False, lambda: None)
    *_, told, tiles = looks_on.messages()
    assert json.loads(told)["state"] == "ended" and [place for place, _ in tiles_in(tiles)] == [(3, 4)]


def test_a_process_that_begins_anew_forgets_the_map_that_came_in_time() -> None:
    live = board()
    live.take_tiles(tile_message([((0, 0), RUNS)]))
    live.take({"kind": "past", "anew": True, "frames": [], "news": [], "track": []})
    live.take({**SCENE, "map_epoch": 2})
    live.take_tiles(tile_message([((7, 7), RUNS)]))
    assert heard(live.join(False, lambda: None))[1] == [(7, 7)]


@pytest.mark.parametrize("state", ["driving", "ended"])
def test_a_run_that_never_said_that_it_ended_is_told_as_gone(state: str) -> None:
    live = board()
    looks_on = live.join(False, lambda: None)
    live.take({**frame(1.0, "news"), "state": state})
    heard(looks_on)
    live.end()
    told, _ = heard(looks_on)
    assert [(one["state"], one["drives"], one["news"]) for one in told] == [("ended", "nobody", [])][: state != "ended"]
    board().end()  # nothing was told yet


@pytest.mark.parametrize("simulated", [False, True])
def test_only_a_real_rover_may_still_move_when_its_program_is_gone(simulated: bool) -> None:
    live = board()
    live.take({**SCENE, "simulated": simulated})
    live.take(frame(1.0, "news"))
    live.end()
    assert live.frame is not None and ("take the rover over" in live.frame["why"]) is not simulated


def test_a_slow_browser_misses_frames_but_no_news_and_no_tile() -> None:
    live = board()
    spectator = live.join(False, lambda: None)
    heard(spectator)
    for step in range(30):
        live.take(frame(0.2 * step, f"news {step}"))
        live.take_tiles(tile_message([((step, 1), RUNS)]))
    texts, places = heard(spectator)
    assert [text["kind"] for text in texts] == ["frame"] and texts[0]["t"] == pytest.approx(5.8)
    assert [one["text"] for one in texts[0]["news"]] == [f"news {step}" for step in range(30)]
    assert sorted(places) == [(step, 1) for step in range(30)]
    assert heard(spectator) == ([], [])


def test_a_scene_that_changes_costs_no_news() -> None:
    live = board()
    spectator = live.join(False, lambda: None)
    live.take(frame(0.0, "one"))
    heard(spectator)
    live.take(frame(0.4, "two"))
    live.take({**SCENE, "targets": ["gate"]})
    live.take(frame(0.6, "three"))
    texts, _ = heard(spectator)
    assert [text["kind"] for text in texts] == ["scene", "frame"]
    assert [one["text"] for one in texts[1]["news"]] == ["two", "three"]
    live.take({**SCENE, "map_epoch": 2})
    live.take(frame(0.8, "four"))
    texts, _ = heard(spectator)
    assert [one["text"] for one in texts[1]["news"]] == ["one", "two", "three", "four"]


def test_another_map_begins_with_its_scene() -> None:
    live = board()
    spectator = live.join(False, lambda: None)
    live.take_tiles(tile_message([((0, 0), RUNS)]))
    heard(spectator)
    live.take({**SCENE, "map_epoch": 2})
    live.take_tiles(tile_message([((7, 7), RUNS)]))
    texts, places = heard(spectator)
    assert texts[0]["map_epoch"] == 2 and places == [(7, 7)]


def test_another_run_is_told_from_its_beginning() -> None:
    live = board()
    spectator = live.join(False, lambda: None)
    live.take(frame(0.0, "one"))
    heard(spectator)
    live.take({**SCENE, "run": "another"})
    assert [text["kind"] for text in heard(spectator)[0]][:2] == ["scene", "past"]


def test_who_comes_after_hours_is_told_the_whole_track() -> None:
    live = board()
    for second in range(20_000):
        lost = {"pose": None} if second in (5001, 9502) else {}
        jumped = {"pose": [second + 100.0, 0.0, 0.0]} if second >= 12_345 else {}
        live.take({**frame(float(second)), **lost, **jumped})
    texts, _ = heard(live.join(False, lambda: None))
    track, frames = texts[1]["track"], texts[1]["frames"]
    assert len(track) <= MOST + 1 and track[0] == [0.0, 0.0, 0.0, 1.0, 1]
    times_s = [one[0] for one in track]
    assert times_s == sorted(times_s) and max(later - one for one, later in pairwise(times_s)) <= 5.0
    assert times_s[-1] + 1.0 == frames[0]["t"], "they join on"
    assert all(one[1] == one[0] + (100.0 if one[0] >= 12_345 else 0.0) for one in track)
    begun_s = [one[0] for one in track if one[4]]
    assert len(begun_s) == 4, "where the place was not known for a second, and where it jumped, a new line begins"
    assert all(0.0 <= begun - break_s <= 5.0 for begun, break_s in zip(begun_s, (0, 5002, 9503, 12_345), strict=True))


def test_after_a_clock_that_went_back_only_what_has_been_since_is_told() -> None:
    live = board()
    for second in (*range(1000), *range(700)):
        live.take(frame(float(second), f"at {second}"))
    texts, _ = heard(live.join(False, lambda: None))
    past = texts[1]
    assert past["track"][0][0] == 0.0 and past["track"][-1][0] == 99.0
    assert [one["t"] for one in past["frames"]] == [float(second) for second in range(100, 700)]
    live = board()
    for second in (*range(1000), *range(60)):
        live.take(frame(float(second), f"at {second}"))
    past = heard(live.join(False, lambda: None))[0][1]
    assert (past["track"], len(past["frames"]), len(past["news"])) == ([], 60, 60)


def test_nothing_grows_without_bound() -> None:
    live = board()
    spectator = live.join(False, lambda: None)
    for step in range(5000):
        live.take(frame(0.5 * step, "text"))
    assert len(live.past.frames) == PAST_S and len(live.news_since(0)) == NEWS_KEPT
    for _ in range(100):
        spectator.answer({"kind": "answer"})
    texts, _ = heard(spectator)
    assert sum(text["kind"] == "answer" for text in texts) == 20


def test_only_who_may_act_is_offered_to_and_only_where_anybody_may() -> None:
    for takes, may, offered in ((True, True, True), (True, False, False), (False, True, False)):
        texts, _ = heard(board(takes).join(may, lambda: None))
        assert texts[0]["may_act"] is offered


def test_each_is_woken_until_it_leaves() -> None:
    live, woken = board(), []
    spectator = live.join(False, lambda: woken.append(1))
    live.take(frame(1.0))
    assert len(woken) == 1 and len(live) == 1
    live.leave(spectator)
    live.take(frame(2.0))
    assert len(woken) == 1 and len(live) == 0
