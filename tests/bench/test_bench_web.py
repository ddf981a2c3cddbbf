"""The live page cannot hurt the drive (``make bench``): ticks with nobody and with a crowd before it, and its own cost.

Every figure is compared within one run: the machine may be busy, and is so for all alike.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import psutil
from PIL import Image

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.viewer.live_viewer import LiveViewer
from companion.viewer.web_process import WebPlace
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSION = Path(__file__).resolve().parents[2] / "missions" / "rooms.toml"
LARGE = """
name = "Large"
prior_map = "large.png"
[grid]
size = [2000, 2000]
resolution_m = 1.0
home = [1000, 1000]
[rover]
cruise_speed_m_s = 2.0
[sitl]
world = "large.png"
sensors = "lidar-360"
[[target]]
field = [1060, 1040]
"""
TICK_S = 0.05
DRIVEN_S, REPETITIONS = 12.0, 8
READERS = 50
BLOCK_S, BLOCKS = 1.5, 8
"""Parts of one drive, in turn with a page and without."""
RATIO_LIMIT = 1.5
"""Of the 99th percentiles, with a crowd and without anybody. On a busy machine both are several times what they are on
a quiet one."""
LOOK_MS = 5.0
"""What telling the page of a large map may take of a tick."""
SETTLED_S, MEASURED_S = 3.0, 20.0
MEMORY_LIMIT_MB = 60.0
CPU_LIMIT = 0.025
"""Of a core of this machine: a tenth of one that is four times as slow, as on a small computer."""


def large_mission(folder: Path) -> Path:
    """Four million fields with 9000 known obstacles, none near home."""
    rng, fields = np.random.default_rng(0), np.full((2000, 2000), 255, np.uint8)
    for (y, x), (height, width) in zip(rng.integers(0, 1990, (9000, 2)), rng.integers(2, 9, (9000, 2)), strict=True):
        if max(abs(y - 1000), abs(x - 1000)) > 30:
            fields[y : y + height, x : x + width] = 0
    Image.fromarray(fields).save(folder / "large.png")
    path = folder / "large.toml"
    path.write_text(LARGE)
    return path


def begun(mission_file: Path = MISSION) -> Drive:
    """A drive that has just begun: the rover moves."""
    mission = load_mission(mission_file)
    run = Drive(mission, scenario_from_mission(mission), Settings(), 0, NullRecorder())
    while run.simulator.driven_m < 1.0:
        run.companion.tick()
    return run


def ticks_ms(run: Drive, viewer: LiveViewer | None, seconds: float, half_way: Callable[[], None]) -> np.ndarray:
    """In real time: how long each tick takes, with what the page takes of it, and how long it works, shape (2, ticks).

    Work is the processor's time of this thread, with the simulator's part; what else the machine does is not in it.
    """
    took_s, count = [], round(seconds / TICK_S)
    began_s = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, began_s + number * TICK_S - time.monotonic()))
        if number == count // 2:
            half_way()
        worked_s = time.thread_time()
        run.companion.tick()
        shown_s = time.perf_counter()
        status = run.take_status()
        if viewer is not None:
            viewer.show(status)
        shown_s = time.perf_counter() - shown_s
        took_s.append((run.companion.outcome.tick_seconds[-1] + shown_s, time.thread_time() - worked_s))
    return 1e3 * np.array(took_s).T


@contextmanager
def page_of(run: Drive, said: list[str]) -> Iterator[LiveViewer]:
    viewer = LiveViewer(WebPlace("127.0.0.1", 0), said.append)
    try:
        viewer.follow(run.companion, run.settings, simulated=True)
        yield viewer
    finally:
        viewer.close()


@contextmanager
def crowd(port: int, readers: int) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "tests.support.crowd", str(port), str(readers)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        try:
            yield child
        finally:
            child.kill()


def undisturbed() -> np.ndarray:
    """Without a page."""
    return ticks_ms(begun(), None, DRIVEN_S, lambda: None)


def unseen() -> np.ndarray:
    """With a page, and nobody before it."""
    run = begun()
    with page_of(run, []) as viewer:
        return ticks_ms(run, viewer, DRIVEN_S, lambda: None)


def stalled() -> np.ndarray:
    """With a crowd before the page, whose process stands still half-way and takes nothing more."""
    run = begun()
    with page_of(run, []) as viewer, crowd(viewer.web.place.port, READERS):
        stopped: list[int] = []

        def stop() -> None:
            assert viewer.web.process_id is not None
            stopped.append(viewer.web.process_id)
            os.kill(stopped[0], signal.SIGSTOP)

        try:
            return ticks_ms(run, viewer, DRIVEN_S, stop)
        finally:
            os.kill(stopped[0], signal.SIGCONT)


def crowded() -> np.ndarray:
    """With a crowd before the page, whose process is killed half-way; all come again and see everything anew."""
    run, said = begun(), []
    with page_of(run, said) as viewer, crowd(viewer.web.place.port, READERS) as people:

        def kill() -> None:
            assert viewer.web.process_id is not None
            os.kill(viewer.web.process_id, signal.SIGKILL)

        took_ms = ticks_ms(run, viewer, DRIVEN_S, kill)
        got = json.loads(people.communicate("", timeout=20.0)[0])
        assert viewer.web.started == 2 and len(said) == 1
    again = [connections for connections in got if len(connections) >= 2 and connections[-1] > 10_000]
    assert len(again) == READERS, got
    return took_ms


def in_turn_ms(first: bool) -> dict[bool, np.ndarray]:
    """Of one drive in blocks: ticks with a crowd before the page, and without a page. ``first``: which comes first.

    Without one nothing is told, and neither the web process nor the crowd runs.
    """
    run, took_ms = begun(), {True: [], False: []}
    with page_of(run, []) as viewer, crowd(viewer.web.place.port, READERS) as people:
        ticks_ms(run, viewer, SETTLED_S, lambda: None)
        assert viewer.web.process_id is not None
        others = (viewer.web.process_id, people.pid)
        try:
            for number in range(BLOCKS):
                seen = first == (number % 2 == 0)
                for one in others:
                    os.kill(one, signal.SIGCONT if seen else signal.SIGSTOP)
                took_ms[seen].append(ticks_ms(run, viewer if seen else None, BLOCK_S, lambda: None))
        finally:
            for one in others:
                os.kill(one, signal.SIGCONT)
        got = json.loads(people.communicate("", timeout=20.0)[0])
        assert viewer.web.started == 1 and len([one for one in got if sum(one) > 10_000]) == READERS
    return {seen: np.hstack(blocks) for seen, blocks in took_ms.items()}


def test_ticks_in_turn_with_a_crowd_and_without_a_page() -> None:
    """Within one run, block by block; what one drive does with a page, the next one does without."""
    begun()
    drives = [in_turn_ms(first=number % 2 == 0) for number in range(REPETITIONS)]
    took_ms = {seen: np.hstack([one[seen] for one in drives]) for seen in (True, False)}
    p99 = {seen: np.percentile(took_ms[seen], 99.0, axis=1) for seen in took_ms}
    halves = [np.hstack([one[seen] for one in drives[part::2]]) for part in (0, 1) for seen in (True, False)]
    spread = [np.percentile(half[0], 99.0) for half in halves]
    for seen, name in ((False, "without a page"), (True, "fifty browsers")):
        time_ms, work_ms = p99[seen]
        print(f"\ntick p99 in turn, {name}: {time_ms:.2f} ms of time, {work_ms:.2f} ms of work", end="")
    ratio, work_ratio = p99[True] / p99[False]
    print(
        f"\nwith over without: {ratio:.2f} times as long ({spread[0] / spread[1]:.2f} and {spread[2] / spread[3]:.2f} "
        f"in halves of the drives), {work_ratio:.2f} times the work; {took_ms[True].shape[1]} ticks each"
    )
    assert ratio < RATIO_LIMIT and work_ratio < RATIO_LIMIT


def medians_ms(setups: dict[str, Callable[[], np.ndarray]], repetitions: int) -> dict[str, np.ndarray]:
    """Of the 99th percentiles of time and work, of drives in turn; printed."""
    begun()
    p99: dict[str, list[np.ndarray]] = {name: [] for name in setups}
    for _ in range(repetitions):
        for name, drives in setups.items():
            p99[name].append(np.percentile(drives(), 99.0, axis=1))
    medians = {name: np.median(each, axis=0) for name, each in p99.items()}
    for name, each in p99.items():
        took_ms = np.round(np.sort([one[0] for one in each]), 1)
        print(
            f"\ntick p99, {name}: {medians[name][0]:.2f} ms of time, {medians[name][1]:.2f} ms of work "
            f"(medians of {repetitions}; time {took_ms})"
        )
    return medians


def test_ticks_with_nobody_and_with_a_crowd() -> None:
    """The 99th percentile is about the same with fifty browsers, a deaf one, a rude one and a web process that is
    killed or stands still."""
    setups = {"without a page": undisturbed, "nobody looks": unseen, "a crowd": crowded, "it stands still": stalled}
    medians = medians_ms(setups, REPETITIONS)
    for name in ("a crowd", "it stands still"):
        ratio, work_ratio = medians[name] / medians["nobody looks"]
        print(f"{name} over nobody: {ratio:.2f} times as long, {work_ratio:.2f} times the work")
        assert work_ratio < RATIO_LIMIT
        assert ratio < RATIO_LIMIT


def test_ticks_on_a_map_of_four_million_fields(tmp_path: Path) -> None:
    """A browser that is told the whole of it costs the drive no more than nobody does."""
    mission_file = large_mission(tmp_path)

    def looked_at(readers: int) -> np.ndarray:
        run = begun(mission_file)
        with page_of(run, []) as viewer, crowd(viewer.web.place.port, readers) as people:
            took_ms = ticks_ms(run, viewer, 2.0 * DRIVEN_S, lambda: None)
            print(f"told {sum(map(sum, json.loads(people.communicate('', timeout=20.0)[0]))) / 1e6:.1f} MB")
            return took_ms

    setups = {
        "without a page": lambda: ticks_ms(begun(mission_file), None, 2.0 * DRIVEN_S, lambda: None),
        "one browser": lambda: looked_at(1),
    }
    medians = medians_ms(setups, REPETITIONS // 2)
    assert medians["one browser"][1] < RATIO_LIMIT * medians["without a page"][1] + LOOK_MS


def test_memory_and_processor_of_the_web_process() -> None:
    """With one viewer, in real time."""
    run = begun()
    with ExitStack() as ends:
        viewer = ends.enter_context(page_of(run, []))
        people = ends.enter_context(crowd(viewer.web.place.port, 1))
        ticks_ms(run, viewer, SETTLED_S, lambda: None)
        served = psutil.Process(viewer.web.process_id)
        began_s, before = time.monotonic(), served.cpu_times()
        ticks_ms(run, viewer, MEASURED_S, lambda: None)
        after, memory = served.cpu_times(), served.memory_full_info()
        share = (after.user + after.system - before.user - before.system) / (time.monotonic() - began_s)
        (got,) = json.loads(people.communicate("", timeout=20.0)[0])
        assert sum(got) > 10_000
    print(
        f"\nweb process with one viewer: RSS {memory.rss / 1e6:.0f} MB, PSS {memory.pss / 1e6:.0f} MB, "
        f"{100.0 * share:.1f} % of a core, {sum(got) / (SETTLED_S + MEASURED_S) / 1e3:.0f} kB a second"
    )
    assert memory.rss / 1e6 < MEMORY_LIMIT_MB
    assert share < CPU_LIMIT
