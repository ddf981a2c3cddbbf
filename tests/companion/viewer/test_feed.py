"""What a viewer is told of a whole drive: plain JSON, the map as it is; and the drive is no other for being watched."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from companion.core.grid import empty_grid
from companion.executive.mission_executor import MissionExecutor
from companion.mapping.evidence_map import new_map
from companion.mission.load import load_mission
from companion.mission.mission import HomePoint
from companion.recording.recorder import NullRecorder
from companion.safety.reasons import EndReason
from companion.settings.settings_file import parse_settings
from companion.viewer import feed, wire
from companion.viewer.feed import ViewerFeed
from companion.viewer.frame import frame_of
from companion.viewer.map_tiles import TILE, cell_classes, cells_of
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSION = Path(__file__).resolve().parents[3] / "missions" / "one-obstacle.toml"
NEAR_M = 8.0
"""So far away is the target: a drive of seconds."""
KEYS = {
    "kind", "t", "pose", "speed", "turn", "mode", "armed", "drives", "line", "why", "state", "statuses", "goal", "path",
    "motion", "setpoint", "rays", "movers", "figures", "battery", "gps", "decision", "guard", "news", "rates",
    "contacts", "touched", "paused",
}  # fmt: skip


class Heard:
    """A receiver that takes everything, or nothing, or loses some ``tiles``: every so many messages."""

    def __init__(self, loses: int = 0) -> None:
        self.begins_anew = threading.Event()
        self.is_full = False
        self.loses = loses
        self.messages = 0
        self.scenes: list[dict] = []
        self.frames: list[dict] = []
        self.tiles: dict[tuple[int, int], bytes] = {}

    def put(self, kind: bytes, payload: bytes, *, last: bool = False) -> bool:
        self.messages += 1
        if (self.is_full and not last) or (
            kind == wire.TILES and self.loses and self.messages % self.loses and not last
        ):
            return False
        if kind == wire.TILES:
            self.tiles.update(wire.tiles_in(payload))
        else:
            message = json.loads(payload)
            (self.scenes if message["kind"] == "scene" else self.frames).append(message)
        return True


def new_drive(controller: str = "motion-ga") -> Drive:
    whole = load_mission(MISSION)
    near = replace(whole.targets[0], place=HomePoint(0.0, NEAR_M))
    mission = replace(whole, targets=(near,))
    settings = parse_settings({"guidance": {"controller": controller}}, "test")
    return Drive(mission, scenario_from_mission(mission), settings, 3, NullRecorder(), 300.0)


def assert_whole(heard: Heard, run: Drive) -> None:
    """What was told is the map as it is."""
    evidence = run.companion.evidence
    assert evidence is not None
    rows, columns = evidence.log_odds.shape
    seen = np.zeros((-(-rows // TILE) * TILE, -(-columns // TILE) * TILE), np.uint8)
    for (column, row), runs in heard.tiles.items():
        seen[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE] = cells_of(runs).reshape(TILE, TILE)
    assert np.array_equal(seen[:rows, :columns], cell_classes(evidence, 0, 0, columns, rows))


@pytest.fixture
def every_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Real time is too slow for a test: at every look."""
    for name in ("FRAME_S", "TILES_S", "SCENE_S", "LATE_S"):
        monkeypatch.setattr(feed, name, -1.0)


@pytest.mark.thorough
@pytest.mark.usefixtures("every_tick")
def test_a_whole_drive_is_told_and_is_no_other_for_it() -> None:
    alone, run, heard = new_drive(), new_drive(), Heard()
    watched = ViewerFeed(run.companion, heard, {"live": True})
    report = run.run(watched.show, 0.2)
    watched.show(run.take_status())
    assert [(p.north_m, p.east_m) for p in alone.run().track] == [(p.north_m, p.east_m) for p in report.track]

    assert all(set(frame) == KEYS | {"held_up", "makes_way"} for frame in heard.frames)
    states = list(dict.fromkeys(frame["state"] for frame in heard.frames))
    assert states == ["waiting", "driving", "ended"]
    last, driving = heard.frames[-1], [frame for frame in heard.frames if frame["state"] == "driving"]
    assert last["statuses"] == ["reached"] and last["contacts"] is None, "as on a real rover"
    middle = driving[len(driving) // 2]
    assert middle["drives"] == "companion" and middle["mode"] == "GUIDED" and middle["armed"] is True
    assert middle["line"].startswith("driving to ") and middle["goal"]["name"] in middle["line"]
    assert len(middle["path"]) > 2 and middle["rays"]["m"] and middle["figures"]["latency_ms"] >= 0.0
    assert any(frame["motion"] for frame in driving) and any(frame["setpoint"] for frame in driving)
    assert 5.0 < middle["rates"]["position"] < 25.0 and middle["gps"]["fix"] == "RTK fixed"
    said = [one["text"] for frame in heard.frames for one in frame["news"]]
    assert len(said) == len(set(said)) and any(text.startswith("Reached") for text in said)

    assert run.companion.evidence is not None
    assert_whole(heard, run)
    columns = run.companion.evidence.log_odds.shape[1]
    assert heard.scenes[-1]["map"]["columns"] == columns and heard.scenes[-1]["targets"]


@pytest.mark.usefixtures("every_tick")
def test_a_run_that_is_broken_off_says_by_what() -> None:
    run, heard = new_drive("points"), Heard()
    watched = ViewerFeed(run.companion, heard, {})
    run.companion.tick()
    watched.end(run.ended_by(EndReason.TIME_LIMIT))
    last = heard.frames[-1]
    assert (last["state"], last["line"]) == ("ended", "ended, time limit reached: 0 of 1 targets reached")
    assert last["why"].endswith(": not reached")
    assert last["drives"] == "nobody" and last["path"] == [] and last["setpoint"] is None


@pytest.mark.usefixtures("every_tick")
def test_a_run_that_an_error_has_ended_says_so_after_the_rover_was_stopped() -> None:
    run, heard = new_drive("points"), Heard()
    watched = ViewerFeed(run.companion, heard, {})
    run.companion.tick()
    watched.show(run.take_status())
    run.companion.close()
    watched.warn("what it was")
    watched.end(EndReason.ERROR)
    last = heard.frames[-1]
    assert (last["state"], last["line"]) == ("ended", "ended, an error in the program: 0 of 1 targets reached")
    assert last["news"][-1]["text"] == "what it was"


@pytest.mark.thorough
@pytest.mark.usefixtures("every_tick")
def test_a_receiver_that_takes_nothing_for_a_while_is_told_all_news_later_and_a_new_one_everything() -> None:
    run, heard = new_drive("points"), Heard()
    watched = ViewerFeed(run.companion, heard, {})
    heard.is_full = True

    def look(status) -> None:
        if 47.0 < status.time_s < 47.25:
            heard.is_full = False
        if 49.0 < status.time_s < 49.25:
            heard.scenes.clear()
            heard.tiles.clear()
            heard.frames.clear()
            heard.begins_anew.set()
            watched.warn("collision 1")
            watched.touched = [(1.0, 2.0)]
        watched.show(status)

    run.run(look, 0.2)
    watched.show(run.take_status())
    said = [one["text"] for frame in heard.frames for one in frame["news"]]
    assert any(text.startswith("Companion:") for text in said), "it was said to the process before"
    assert said.count("Heading for far end") == 1
    tracked_s = [one["t"] for told in heard.frames if told["kind"] == "past" for one in told["frames"]]
    assert tracked_s[0] < 1.0 and max(later - one for one, later in pairwise(tracked_s)) < 1.5
    assert "collision 1" in said and (heard.frames[-1]["contacts"], heard.frames[-1]["touched"]) == (
        1,
        [[1.0, 2.0]],
    )
    assert len(heard.scenes) >= 1
    assert_whole(heard, run)
    again = Heard()
    ViewerFeed(run.companion, again, {}).show(run.take_status())
    assert again.scenes[0]["run"] != heard.scenes[0]["run"] and len({one["run"] for one in heard.scenes}) == 1


@pytest.mark.parametrize(
    ("loses", "full_until_s", "begins_s"),
    [(0, 0.0, 0.0), (3, 0.0, 0.0), (0, 1e9, 0.0), (0, 0.0, 48.5), (2, 47.0, 48.5)],
)
def test_at_the_end_the_map_is_whole_and_the_end_is_told(
    loses: int, full_until_s: float, begins_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever was lost before, or asked for anew; as the clock goes looks are few."""
    run, heard, now_s = new_drive("points"), Heard(loses), [0.0]
    watched = ViewerFeed(run.companion, heard, {})
    monkeypatch.setattr(feed, "stopwatch_s", lambda: now_s[0])

    def look(status) -> None:
        now_s[0] += 0.01
        heard.is_full = status.time_s < full_until_s
        if begins_s and status.time_s >= begins_s and not heard.begins_anew.is_set() and now_s[0] < 1e6:
            now_s[0] += 1e6  # once
            heard.tiles.clear()
            heard.scenes.clear()
            heard.begins_anew.set()
        watched.show(status)

    run.run(look, 0.2)
    watched.show(run.take_status())
    assert run.companion.done and heard.frames[-1]["state"] == "ended"
    assert_whole(heard, run)


def driven(watched: ViewerFeed, run: Drive, now_s: list[float]) -> None:
    """Some metres, with a look at each tick."""
    while run.simulator.driven_m < 3.0:
        run.companion.tick()
        now_s[0] += 0.05
        watched.show(run.take_status())


def test_what_was_lost_or_known_to_the_process_before_is_told_again_though_nothing_changes_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run, heard, now_s = new_drive("points"), Heard(), [0.0]
    monkeypatch.setattr(feed, "stopwatch_s", lambda: now_s[0])
    watched = ViewerFeed(run.companion, heard, {})
    heard.loses = 10**9
    driven(watched, run, now_s)
    assert not heard.tiles and heard.scenes

    def stand() -> None:
        for _ in range(200):
            now_s[0] += 0.05
            watched.show(run.companion.status())

    heard.loses = 0
    stand()
    assert_whole(heard, run)
    heard.tiles.clear()
    heard.scenes.clear()
    heard.frames.clear()
    heard.begins_anew.set()
    stand()
    assert_whole(heard, run)
    kinds = [frame["kind"] for frame in heard.frames]
    assert heard.scenes and kinds[0] == "past" and "past" not in kinds[kinds.index("frame") :]


@pytest.mark.parametrize("phase", range(4))
def test_another_map_is_not_told_as_the_one_before(phase: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its tiles come after its scene, whether it is another one just before a frame or between two."""
    run, now_s, told = new_drive("points"), [0.0], []
    monkeypatch.setattr(feed, "stopwatch_s", lambda: now_s[0])

    class Ordered(Heard):
        def put(self, kind: bytes, payload: bytes, *, last: bool = False) -> bool:
            told.append("tiles" if kind == wire.TILES else json.loads(payload).get("map_epoch", ""))
            return super().put(kind, payload, last=last)

    watched = ViewerFeed(run.companion, Ordered(), {})
    driven(watched, run, now_s)
    for _ in range(phase):
        now_s[0] += 0.05
        watched.show(run.companion.status())
    executor = run.companion.executor
    assert executor is not None and 2 not in told
    turned = np.where(executor.evidence.log_odds == 0.0, -1.0, 0.0).astype(np.float32)
    other = replace(executor.evidence, log_odds=turned)
    monkeypatch.setattr(MissionExecutor, "evidence", property(lambda self: other))
    told.clear()
    for _ in range(20):
        now_s[0] += 0.05
        watched.show(run.companion.status())
    assert told.index(2) < told.index("tiles")


@pytest.mark.parametrize("tick_s", [0.01, 0.05, 0.1, 0.2])
def test_a_large_map_is_told_as_soon_however_long_a_tick_is(tick_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    run, heard, now_s = new_drive("points"), Heard(), [0.0]
    watched = ViewerFeed(run.companion, heard, {})
    while run.companion.executor is None:
        run.companion.tick()
    monkeypatch.setattr(feed, "stopwatch_s", lambda: now_s[0])
    other = new_map(empty_grid(600, 600), 0.35, run.settings.mapping)
    other.base.weights[:] = 1.0
    monkeypatch.setattr(MissionExecutor, "evidence", property(lambda self: other))
    tiles = (-(-other.log_odds.shape[0] // TILE)) ** 2
    while len(heard.tiles) < tiles:
        now_s[0] += tick_s
        watched.show(run.companion.status())
    assert 0.8 * tiles / 240.0 <= now_s[0] <= 2.0 * tiles / 240.0 and tiles > 500


def test_frames_and_tiles_are_told_in_ticks_of_their_own_and_tiles_in_any_if_they_are_late(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The next tick may be due soon."""
    run, heard, now_s, told = new_drive("points"), Heard(), [0.0], []
    watched = ViewerFeed(run.companion, heard, {})
    monkeypatch.setattr(feed, "stopwatch_s", lambda: now_s[0])

    def look(status, tick_s: float) -> str:
        now_s[0] += tick_s
        frames = len(heard.frames)
        heard.tiles.clear()
        watched.show(status)
        return "frame" * (len(heard.frames) > frames) + "tiles" * bool(heard.tiles)

    while run.simulator.driven_m < 3.0:
        run.companion.tick()
        told.append(look(run.take_status(), 0.05))
    assert {"frame", "tiles"} <= set(told[-20:]) <= {"frame", "tiles", ""}
    for _ in range(10):
        run.companion.tick()
        told.append(look(run.take_status(), 0.2))
    assert "frametiles" in told[-10:]


def test_a_speed_that_nobody_has_told_is_none() -> None:
    companion = new_drive().companion
    frame = frame_of(companion, companion.status())
    assert frame["pose"] is None and frame["speed"] is None
