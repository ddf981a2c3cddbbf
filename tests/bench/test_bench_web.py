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
import pytest
from PIL import Image

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.viewer.live_viewer import LiveViewer
from companion.viewer.web_process import WebPlace
from sitl.experiments.intervals import ratio_with_interval
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
DRIVEN_S, REPETITIONS = 10.0, 8
READERS = 50
BLOCK_S, BLOCKS = 1.5, 8
"""Parts of one drive, in turn with a page and without."""
RATIO_LIMIT = 1.25
"""Of the 99th percentiles, with a page and without: single drives without a page differ by so much."""
TOLD_LIMIT_MS = 5.0
"""What telling the page may take of the time between two ticks: a tenth."""
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
    """In real time, shape (3, ticks): how late each tick ends, how long it works, how long the page is told of it.

    How late: since the moment at which the tick was due, so that whatever holds it up counts, the page of the tick
    before as well. Work is the processor's time of this thread, with the simulator's part.
    """
    took_s, count = [], round(seconds / TICK_S)
    began_s = time.perf_counter()
    for number in range(count):
        due_s = began_s + number * TICK_S
        time.sleep(max(0.0, due_s - time.perf_counter()))
        if number == count // 2:
            half_way()
            due_s = max(due_s, time.perf_counter())
        worked_s = time.thread_time()
        run.companion.tick()
        ended_s, worked_s = time.perf_counter(), time.thread_time() - worked_s
        status = run.take_status()
        if viewer is not None:
            viewer.show(status)
        took_s.append((ended_s - due_s, worked_s, time.perf_counter() - ended_s))
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


def settled(run: Drive, viewer: LiveViewer | None, half_way: Callable[[], None] = lambda: None) -> np.ndarray:
    """``ticks_ms`` once all processes have started and every browser knows the map."""
    ticks_ms(run, viewer, SETTLED_S, lambda: None)
    return ticks_ms(run, viewer, DRIVEN_S, half_way)


def undisturbed() -> np.ndarray:
    """Without a page."""
    return settled(begun(), None)


def unseen() -> np.ndarray:
    """With a page, and nobody before it."""
    run = begun()
    with page_of(run, []) as viewer:
        return settled(run, viewer)


def crowded() -> np.ndarray:
    """With a crowd before the page."""
    run = begun()
    with page_of(run, []) as viewer, crowd(viewer.web.place.port, READERS) as people:
        took_ms = settled(run, viewer)
        assert_told(people, viewer, 1)
        return took_ms


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
            return settled(run, viewer, stop)
        finally:
            for one in stopped:
                os.kill(one, signal.SIGCONT)


def killed() -> np.ndarray:
    """With a crowd before the page, whose process is killed half-way; all come again and see everything anew."""
    run, said = begun(), []
    with page_of(run, said) as viewer, crowd(viewer.web.place.port, READERS) as people:

        def kill() -> None:
            assert viewer.web.process_id is not None
            os.kill(viewer.web.process_id, signal.SIGKILL)

        took_ms = settled(run, viewer, kill)
        assert_told(people, viewer, 2)
        assert len(said) == 1
        return took_ms


def assert_told(people: subprocess.Popen[str], viewer: LiveViewer, started: int) -> None:
    """Each browser that reads was told a lot by the last of so many web processes."""
    got = json.loads(people.communicate("", timeout=20.0)[0])
    assert viewer.web.started == started
    told = [connections for connections in got if len(connections) >= started and connections[-1] > 10_000]
    assert len(told) == READERS, got


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
        late_ms, work_ms, _ = p99[seen]
        print(f"\ntick p99 in turn, {name}: {late_ms:.2f} ms after it was due, {work_ms:.2f} ms of work", end="")
    ratio, work_ratio = (p99[True] / p99[False])[:2]
    print(
        f"\nwith over without: {ratio:.2f} times as long ({spread[0] / spread[1]:.2f} and {spread[2] / spread[3]:.2f} "
        f"in halves of the drives), {work_ratio:.2f} times the work; {took_ms[True].shape[1]} ticks each"
    )
    assert ratio < RATIO_LIMIT and work_ratio < RATIO_LIMIT


def p99_ms(setups: dict[str, Callable[[], np.ndarray]], repetitions: int) -> dict[str, np.ndarray]:
    """The 99th percentiles of what ``ticks_ms`` tells, shape (repetitions, 3), of drives in turn; printed.

    The first one is without a page: the others are compared with it, drive by drive.
    """
    begun()
    drives: dict[str, list[np.ndarray]] = {name: [] for name in setups}
    for _ in range(repetitions):
        for name, drive in setups.items():
            drives[name].append(np.percentile(drive(), 99.0, axis=1))
    p99 = {name: np.array(each) for name, each in drives.items()}
    for name, each in p99.items():
        late, work, told = np.median(each, axis=0)
        print(
            f"\ntick p99, {name}: {late:.2f} ms after it was due {np.round(np.sort(each[:, 0]), 1)}, "
            f"{work:.2f} ms of work; then the page is told in {told:.2f} ms (medians of {repetitions})"
        )
    without = next(iter(p99.values()))
    for name, each in list(p99.items())[1:]:
        late, work = (ratio_with_interval(np.column_stack((each[:, row], without[:, row]))) for row in (0, 1))
        print(f"{name} over no page: {late} times as late, {work} times the work")
    return p99


def assert_unchanged(setups: dict[str, Callable[[], np.ndarray]], repetitions: int) -> None:
    """With a page as without: the ticks; and telling it takes little of the time between them."""
    medians = {name: np.median(each, axis=0) for name, each in p99_ms(setups, repetitions).items()}
    without, *others = medians.values()
    for late, work, told in others:
        assert max(late / without[0], work / without[1]) < RATIO_LIMIT
        assert told < TOLD_LIMIT_MS


@pytest.mark.timeout(1500)
def test_ticks_with_nobody_and_with_a_crowd() -> None:
    """With nobody before it, with fifty browsers, a deaf one and a rude one, and with a web process that is killed or
    stands still."""
    setups = {
        "no page": undisturbed, "nobody looks": unseen, "a crowd": crowded, "it stands still": stalled,
        "killed": killed,
    }  # fmt: skip
    assert_unchanged(setups, REPETITIONS)


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
        "no page": lambda: ticks_ms(begun(mission_file), None, 2.0 * DRIVEN_S, lambda: None),
        "one browser": lambda: looked_at(1),
    }
    assert_unchanged(setups, REPETITIONS // 2)


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
