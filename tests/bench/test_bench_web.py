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
DRIVEN_S, REPETITIONS, MORE_REPETITIONS = 10.0, 8, 12
READERS = 50
TURN_S = 1.0
"""The page is told for so long, and then not told for as long: what else holds the machine up meets both alike."""
LATE, WORK, TOLD, SEARCHED, SHOWN = range(5)
"""What is measured of a tick: see ``ticks_of``."""
DRAWS = 1000
SETTLED_S, MEASURED_S = 3.0, 20.0
FIRST, HALF, AFTER = (round(seconds / TICK_S) for seconds in (SETTLED_S, SETTLED_S + 0.5 * DRIVEN_S, 3.0))
PARTS = (
    ("from then on", slice(FIRST, None), 1.15, 0.75),
    ("the 3 s from half-way on", slice(HALF, HALF + AFTER), 1.5, 0.75),
    ("while browsers start", slice(0, FIRST), 1.5, 1.0),
)
"""Parts of a drive; how many times as late the 99th percentile of ticks may be; and how long the page may be told, as a
share of how late a tick ends without one (99 % of both). The browsers start on the same processors, which is not what a
page costs; and the short parts have few ticks."""
WITHOUT_LIMIT = 1.5
"""The same limit against other drives, without a page: from one drive to the next such a machine changes more than a
page does."""
MEMORY_LIMIT_MB = 60.0
CPU_LIMIT, SLOW_DAY_LIMIT = 0.5, 0.05
"""Of the work of the drive's ticks, so that it is the same on a day on which the machine is slow. They take 0.05 of a
core here: a fifth of one that is four times as slow, as on a small computer. The page may take a tenth of that one. And
of a core of this machine, twice as much as that would be: on some days it is half as fast."""


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


def ticks_of(
    run: Drive, viewer: LiveViewer | None, seconds: float, half_way: Callable[[], None], shown: Callable[[int], bool]
) -> np.ndarray:
    """Ticks in real time, shape (5, ticks).

    How late each ends, in ms since the moment at which it was due: whatever holds it up counts, the page of the tick
    before as well, and the simulator's step does. How long it works, in ms of the processor's time of this thread. How
    long the page is told of it then, in ms. Whether it searched for a path. Whether the page is told (``shown``: by the
    number of the tick).
    """
    ticks, count = [], round(seconds / TICK_S)
    searched = run.companion.driver.searcher.seconds if run.companion.driver is not None else []
    began_s = time.perf_counter()
    for number in range(count):
        due_s = began_s + number * TICK_S
        time.sleep(max(0.0, due_s - time.perf_counter()))
        if number == count // 2:
            half_way()
            due_s = max(due_s, time.perf_counter())
        worked_s, searches = time.thread_time(), len(searched)
        run.companion.tick()
        ended_s, worked_s = time.perf_counter(), time.thread_time() - worked_s
        status, tells = run.take_status(), viewer is not None and shown(number)
        if viewer is not None and tells:
            viewer.show(status)
        told_s = time.perf_counter() - ended_s
        ticks.append((1e3 * (ended_s - due_s), 1e3 * worked_s, 1e3 * told_s, len(searched) > searches, tells))
    return np.array(ticks).T


def always(number: int) -> bool:
    """Told of each tick."""
    return True


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


def driven(
    run: Drive, viewer: LiveViewer | None, drive: int, half_way: Callable[[], None] = lambda: None
) -> np.ndarray:
    """The ticks while all processes start and every browser is told the map, and from then on, in turn told and not.

    ``drive``: its number. The drives are the same, so each tick is told in every second one.
    """
    first = ticks_of(run, viewer, SETTLED_S, lambda: None, always)
    turn = round(TURN_S / TICK_S)
    return np.hstack((first, ticks_of(run, viewer, DRIVEN_S, half_way, lambda tick: (tick // turn + drive) % 2 == 0)))


def undisturbed(drive: int) -> np.ndarray:
    """Without a page."""
    return driven(begun(), None, drive)


def unseen(drive: int) -> np.ndarray:
    """With a page, and nobody before it."""
    run = begun()
    with page_of(run, []) as viewer:
        return driven(run, viewer, drive)


def crowded(drive: int) -> np.ndarray:
    """With a crowd before the page."""
    run = begun()
    with page_of(run, []) as viewer, crowd(viewer.web.place.port, READERS) as people:
        ticks = driven(run, viewer, drive)
        assert_told(people, viewer, 1)
        return ticks


def stalled(drive: int) -> np.ndarray:
    """With a crowd before the page, whose process stands still half-way and takes nothing more."""
    run = begun()
    with page_of(run, []) as viewer, crowd(viewer.web.place.port, READERS):
        stopped: list[int] = []

        def stop() -> None:
            assert viewer.web.process_id is not None
            stopped.append(viewer.web.process_id)
            os.kill(stopped[0], signal.SIGSTOP)

        try:
            return driven(run, viewer, drive, stop)
        finally:
            for one in stopped:
                os.kill(one, signal.SIGCONT)


def killed(drive: int) -> np.ndarray:
    """With a crowd before the page, whose process is killed half-way; all come again and see everything anew."""
    run, said = begun(), []
    with page_of(run, said) as viewer, crowd(viewer.web.place.port, READERS) as people:

        def kill() -> None:
            assert viewer.web.process_id is not None
            os.kill(viewer.web.process_id, signal.SIGKILL)

        ticks = driven(run, viewer, drive, kill)
        assert_told(people, viewer, 2)
        assert len(said) == 1
        return ticks


def assert_told(people: subprocess.Popen[str], viewer: LiveViewer, started: int) -> None:
    """Each browser that reads was told a lot by the last of so many web processes."""
    got = json.loads(people.communicate("", timeout=20.0)[0])
    assert viewer.web.started == started
    told = [connections for connections in got if len(connections) >= started and connections[-1] > 10_000]
    assert len(told) == READERS, got


def p99_ms(ticks: np.ndarray, row: int, which: np.ndarray) -> float:
    """Of drives' ticks, shape (drives, 5, ticks): the 99th percentile of a row, of those that are meant."""
    return float(np.percentile(ticks[:, row][which], 99.0))


def ratio(ticks: np.ndarray, which: np.ndarray, others: np.ndarray, than: np.ndarray) -> tuple[float, float, float]:
    """How many times as late ticks end as others (``p99_ms``), and its 95 % interval by resampling pairs of drives."""
    draws = np.random.default_rng(0).integers(len(ticks) // 2, size=(DRAWS, len(ticks) // 2, 1))
    ratios = []
    for one in (2 * draws + (0, 1)).reshape(DRAWS, -1):
        ratios.append(p99_ms(ticks[one], LATE, which[one]) / p99_ms(others[one], LATE, than[one]))
    low, high = np.percentile(ratios, (2.5, 97.5))
    return p99_ms(ticks, LATE, which) / p99_ms(others, LATE, than), float(low), float(high)


def assert_unchanged(setups: dict[str, Callable[[int], np.ndarray]], repetitions: int) -> None:
    """Drives in turn, the first one without a page. Ticks end as soon where a page is told as where it is not, and
    about as soon as without one; to tell it takes less than a tick. Printed."""
    begun()
    drives: dict[str, list[np.ndarray]] = {name: [] for name in setups}
    for number in range(repetitions):
        for name, drive in setups.items():
            drives[name].append(drive(number))
    without, *paged = (np.array(each) for each in drives.values())
    faults = []
    for part_name, part, limit, told_limit in PARTS:
        for searches in (True, False):
            every = _meant(without, part, searches)
            late = p99_ms(without, LATE, every)
            which = "all ticks" if searches else "without a search"
            print(f"\n{part_name}, {which} ({every.sum()} a row), without a page {late:.2f} ms:", end="")
            for name, ticks in zip(list(setups)[1:], paged, strict=True):
                meant = _meant(ticks, part, searches)
                shown, silent = meant & (ticks[:, SHOWN] > 0.0), meant & (ticks[:, SHOWN] == 0.0)
                told, outside = p99_ms(ticks, TOLD, shown), ratio(ticks, meant, without, every)
                inside = ratio(ticks, shown, ticks, silent) if silent.any() else outside
                print(
                    f"\n  {name:16} late {p99_ms(ticks, LATE, meant):6.2f}, told {told:5.2f} ms; told : not told "
                    f"{_interval(inside)}; : without a page {_interval(outside)}",
                    end="",
                )
                if inside[0] > limit or outside[0] > WITHOUT_LIMIT or told > told_limit * late:
                    faults.append((part_name, which, name, inside[0], outside[0], told))
    assert not faults


def _meant(ticks: np.ndarray, part: slice, searches: bool) -> np.ndarray:
    """Which ticks of drives, shape (drives, ticks): of this part; without ``searches`` only those in which no path is
    searched for: the others are few, and the slowest."""
    within = np.zeros(ticks.shape[2], bool)
    within[part] = True
    return within & (searches | (ticks[:, SEARCHED] == 0.0))


def _interval(figure: tuple[float, float, float]) -> str:
    value, low, high = figure
    return f"{value:.2f} ({low:.2f} to {high:.2f})"


@pytest.mark.timeout(1500)
def test_ticks_with_nobody_and_with_a_crowd() -> None:
    """With nobody before it, with fifty browsers, a deaf one and a rude one, and with a web process that is killed."""
    setups = {"no page": undisturbed, "nobody looks": unseen, "a crowd": crowded, "killed": killed}
    assert_unchanged(setups, REPETITIONS)


@pytest.mark.timeout(1500)
def test_ticks_with_a_web_process_that_stands_still() -> None:
    """More drives, as it stands in half of each only."""
    assert_unchanged({"no page": undisturbed, "it stands still": stalled}, MORE_REPETITIONS)


def test_ticks_on_a_map_of_four_million_fields(tmp_path: Path) -> None:
    """A browser that is told the whole of it costs the drive no more than nobody does."""
    mission_file = large_mission(tmp_path)

    def looked_at(drive: int) -> np.ndarray:
        run = begun(mission_file)
        with page_of(run, []) as viewer, crowd(viewer.web.place.port, 1) as people:
            ticks = driven(run, viewer, drive)
            print(f"told {sum(map(sum, json.loads(people.communicate('', timeout=20.0)[0]))) / 1e6:.1f} MB")
            return ticks

    setups = {"no page": lambda drive: driven(begun(mission_file), None, drive), "one browser": looked_at}
    assert_unchanged(setups, REPETITIONS // 2)


def test_memory_and_processor_of_the_web_process() -> None:
    """With one viewer, in real time."""
    run = begun()
    with ExitStack() as ends:
        viewer = ends.enter_context(page_of(run, []))
        people = ends.enter_context(crowd(viewer.web.place.port, 1))
        ticks_of(run, viewer, SETTLED_S, lambda: None, always)
        served = psutil.Process(viewer.web.process_id)
        began_s, before = time.monotonic(), served.cpu_times()
        ticks = ticks_of(run, viewer, MEASURED_S, lambda: None, always)
        after, memory = served.cpu_times(), served.memory_full_info()
        served_s = after.user + after.system - before.user - before.system
        share, of_ticks = served_s / (time.monotonic() - began_s), 1e3 * served_s / ticks[WORK].sum()
        (got,) = json.loads(people.communicate("", timeout=20.0)[0])
        assert sum(got) > 10_000
    print(
        f"\nweb process with one viewer: RSS {memory.rss / 1e6:.0f} MB, PSS {memory.pss / 1e6:.0f} MB, "
        f"{100.0 * share:.1f} % of a core, {of_ticks:.2f} of the ticks' work, "
        f"{sum(got) / (SETTLED_S + MEASURED_S) / 1e3:.0f} kB a second"
    )
    assert memory.rss / 1e6 < MEMORY_LIMIT_MB
    assert of_ticks < CPU_LIMIT and share < SLOW_DAY_LIMIT
