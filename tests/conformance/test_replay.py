"""The sent half of every recording, sent again to the simulator: the same answers, texts, rates, states and motion.

Motion: at every moment of the long drive within 0.25 m and, for 95 % of the moments, 0.1 m/s of the recording; the
figures of single legs to 0.15 s, 0.06 m/s, 0.1 m. The recording with rangefinders was driven by other physics, which
turns otherwise: 1 m.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.conformance.comparison import differences
from tests.conformance.recordings import RECORDINGS, Heard, Replay, replay
from tests.conformance.tolerated import ROWS, TOLERATED
from tests.support.shared_data import needs_shared

pytestmark = needs_shared
NAMES = [recording.name for recording in RECORDINGS]


@pytest.fixture(scope="module")
def replays() -> dict[str, Replay]:
    """Every recording with its replay."""
    return {recording.name: replay(recording) for recording in RECORDINGS}


@pytest.mark.parametrize("name", NAMES)
def test_the_simulator_answers_as_the_firmware_did(replays: dict[str, Replay], name: str) -> None:
    assert differences(replays[name]) - set(TOLERATED) == set()


def test_every_tolerated_difference_is_there(replays: dict[str, Replay]) -> None:
    found = set().union(*(differences(one) for one in replays.values()))
    assert set(TOLERATED) - found == set()


def track(heard: tuple[Heard, ...], early_s: float = 0.0) -> NDArray[np.float64]:
    """Rows of time, north, east, speed as told by LOCAL_POSITION_NED."""
    told = (one.message for one in heard if one.message.get_type() == "LOCAL_POSITION_NED")
    return np.array([(m.time_boot_ms / 1000 - early_s, m.x, m.y, math.hypot(m.vx, m.vy)) for m in told])


def apart(one: Replay, from_s: float, to_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance and difference of speeds at every recorded moment."""
    real, ours = track(one.real), track(one.ours, one.recording.early_s)
    real = real[(real[:, 0] > from_s) & (real[:, 0] < to_s)]
    assert len(real) > 200
    north_m, east_m, speed = (np.interp(real[:, 0], ours[:, 0], ours[:, column]) for column in (1, 2, 3))
    return np.hypot(real[:, 1] - north_m, real[:, 2] - east_m), np.abs(real[:, 3] - speed)


def test_the_long_drive_is_driven_as_recorded(replays: dict[str, Replay]) -> None:
    apart_m, apart_m_s = apart(replays["guided-drive"], 45.3, 152.0)
    assert apart_m.max() < 0.25
    assert math.sqrt(np.mean(apart_m**2)) < 0.15
    assert np.percentile(apart_m_s, 95) < 0.1
    assert math.sqrt(np.mean(apart_m_s**2)) < 0.05


def test_the_drive_to_a_post_is_driven_as_recorded(replays: dict[str, Replay]) -> None:
    apart_m, apart_m_s = apart(replays["rangefinders"], 44.5, 73.0)
    assert apart_m.max() < 1.0
    assert np.percentile(apart_m_s, 95) < 0.4


def arrivals_s(heard: tuple[Heard, ...]) -> list[float]:
    return [one.time_s for one in heard if one.message.get_type() == "MISSION_ITEM_REACHED"]


@pytest.mark.parametrize(("name", "count", "within_s"), [("guided-drive", 4, 0.08), ("rangefinders", 2, 0.3)])
def test_arrivals_are_told_when_they_were(replays: dict[str, Replay], name: str, count: int, within_s: float) -> None:
    """The fifth target of the long drive was replaced 0.2 s after its arrival, too soon to compare."""
    one = replays[name]
    assert len(arrivals_s(one.real)) >= count
    assert arrivals_s(one.ours)[:count] == pytest.approx(arrivals_s(one.real)[:count], abs=within_s)


LEGS = {
    "10 m from rest": (45.25, 59.2, (10.0, 0.0)),
    "a right turn, 8 m": (59.25, 73.3, (10.0, 8.0)),
    "back, global target": (93.45, 103.4, None),
    "guided item": (103.45, 113.4, None),
    "reposition": (113.45, 123.2, None),
    "velocity, then none": (124.5, 137.5, None),
    "HOLD under way": (140.55, 144.5, None),
}
"""Parts of the long drive: from, to (vehicle seconds), and the target where overshoot is to be compared."""


def figures(path: NDArray[np.float64], from_s: float, to_s: float, target_m: tuple[float, float] | None) -> list[float]:
    """Seconds until it moves, reaches 90 % of the top speed, stands; top speed; metres driven, and past the target."""
    leg = path[(path[:, 0] >= from_s) & (path[:, 0] < to_s)]
    times_s, speeds = leg[:, 0] - from_s, leg[:, 3]
    top = speeds.max()

    def first_s(bound: float) -> float:
        at = int(np.argmax(speeds >= bound))
        if at == 0:
            return float(times_s[0])
        return float(np.interp(bound, speeds[at - 1 : at + 1], times_s[at - 1 : at + 1]))

    moving = np.flatnonzero(speeds > 0.1)
    stands_s = float(times_s[min(moving[-1] + 1, len(times_s) - 1)])
    driven_m = float(np.hypot(np.diff(leg[:, 1]), np.diff(leg[:, 2])).sum())
    past_m = 0.0 if target_m is None else math.hypot(leg[-1, 1] - target_m[0], leg[-1, 2] - target_m[1])
    return [first_s(0.3), first_s(0.9 * top), stands_s, float(top), driven_m, past_m]


@pytest.mark.parametrize("name", LEGS)
def test_figures_of_a_leg(replays: dict[str, Replay], name: str) -> None:
    one = replays["guided-drive"]
    real, ours = (figures(track(heard), *LEGS[name]) for heard in (one.real, one.ours))
    assert ours == [
        pytest.approx(value, abs=most) for value, most in zip(real, (0.15, 0.15, 0.15, 0.06, 0.3, 0.1), strict=True)
    ]


def test_a_carrot_at_2_hz_is_followed_as_slowly_as_recorded(replays: dict[str, Replay]) -> None:
    one = replays["guided-drive"]
    real, ours = (np.mean([row[3] for row in track(heard) if 80.0 < row[0] < 85.0]) for heard in (one.real, one.ours))
    assert ours == pytest.approx(real, abs=0.03)


def test_ranges_are_those_recorded(replays: dict[str, Replay]) -> None:
    """Before the post within a centimetre or two, else as far as the motion differs; nothing where nothing was."""
    one = replays["rangefinders"]
    compared = 0
    for number in (0, 1, 2):
        real, ours = (
            [
                (h.time_s, h.message)
                for h in heard
                if h.message.get_type() == "DISTANCE_SENSOR" and h.message.id == number
            ]
            for heard in (one.real, one.ours)
        )
        assert {message.orientation for _, message in real} == {message.orientation for _, message in ours}
        ours_s = [time_s for time_s, _ in ours]
        for time_s, message in real:
            mine = ours[int(np.argmin(np.abs(np.array(ours_s) - time_s)))][1]
            nothing = message.current_distance >= message.max_distance
            if 53.5 < time_s < 58.0 or time_s > 62.0:
                compared += 1
                assert (mine.current_distance >= mine.max_distance) == nothing
                assert nothing or mine.current_distance == pytest.approx(message.current_distance, abs=5)
    assert compared > 300


def test_the_page_on_the_simulator_names_every_tolerated_difference() -> None:
    text = (Path(__file__).parents[2] / "docs" / "sitl.md").read_text()
    listed = text[text.index("## What it does not simulate") :]
    assert all(words in listed for words in (*TOLERATED.values(), *ROWS.values()))
