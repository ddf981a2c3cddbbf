"""Lines that lose, delay and garble, and what else goes wrong beside the road without stopping the rover."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.mission.load import load_mission
from companion.safety.reasons import Doubt, WaitReason
from tests.support.quick import first_of
from tests.support.rig import GUIDED, HOLD, Rig, yard


def assert_reached(rig: Rig) -> None:
    rig.finish()
    assert rig.companion.outcome.complete, rig.texts()
    assert rig.simulator.collisions == ()
    assert all(one.mode == GUIDED and one.armed for one in rig.sent if one.is_setpoint)


@first_of(1, "seed", range(3))
def test_a_line_that_loses_a_fifth_of_all_packets(tmp_path: Path, seed: int) -> None:
    rig, rng = Rig(yard(tmp_path), seed=seed), np.random.default_rng(seed)
    rig.change = lambda message: None if rng.random() < 0.2 else message
    rig.lose = lambda: bool(rng.random() < 0.2)
    assert_reached(rig)


@pytest.mark.thorough
def test_a_line_that_is_a_fifth_of_a_second_late(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path))
    waiting: deque[bytes] = deque([b""] * 4)

    def late(data: bytes) -> bytes:
        waiting.append(data)
        return waiting.popleft()

    rig.garble = late
    assert_reached(rig)


@first_of(1, "seed", range(3))
def test_a_line_that_garbles(tmp_path: Path, seed: int) -> None:
    """One bit in five hundred bytes is wrong, and now and then there is noise between the packets."""
    rig, rng = Rig(yard(tmp_path), seed=seed), np.random.default_rng(seed)

    def garbled(data: bytes) -> bytes:
        wrong = bytearray(data)
        for at in np.flatnonzero(rng.random(len(wrong)) < 0.002):
            wrong[at] ^= 1 << int(rng.integers(8))
        return bytes(wrong) + (rng.bytes(30) if rng.random() < 0.05 else b"")

    rig.garble = garbled
    assert_reached(rig)
    assert rig.link.codec.counters.bad_bytes > 100


def test_a_record_that_ends_is_said_once_and_the_rover_drives_on(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path))
    rig.until_driven(1.0)
    rig.recorder.problem = "record: the record has ended: No space left on device"
    assert_reached(rig)
    assert rig.texts().count(rig.recorder.problem) == 1


def test_a_message_that_comes_too_seldom_is_said_once(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path))
    count = 0

    def seldom(message: Any) -> Any:
        nonlocal count
        if message.get_type() == "ATTITUDE":
            count += 1
            return message if count % 4 == 0 else None
        return message

    rig.change = seldom
    assert_reached(rig)
    slow = [text for text in rig.texts() if text.startswith("ATTITUDE: ")]
    assert len(slow) == 1 and "instead of 20" in slow[0]


def test_a_rover_beside_the_grid_is_not_driven(tmp_path: Path) -> None:
    """Home lies on the grid, and the rover has been driven away from it."""
    rig = Rig(yard(tmp_path))

    def elsewhere(message: Any) -> Any:
        if message.get_type() == "LOCAL_POSITION_NED":
            message.x += 50.0
        return message

    rig.change = elsewhere
    rig.until(lambda: rig.awaits(WaitReason.ON_THE_GRID), 60.0)
    rig.run_for(10.0)
    assert not [one for one in rig.sent if one.is_setpoint]
    rig.change = None
    assert_reached(rig)


def test_a_companion_started_again_on_the_way_finds_its_target(tmp_path: Path) -> None:
    """The first one dies at speed; the second meets a rover that is armed, in GUIDED, and drives to an old target."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(5.0)
    rig.restart_companion(load_mission(tmp_path / "yard.toml"))
    assert rig.mode == GUIDED
    assert_reached(rig)
    rig.simulator.advance_to_s(rig.now_s() + 3.0)
    assert [one.message.param2 for one in rig.sent if one.command == 176][-1] == HOLD


@first_of(1, "stall_s", [1.5, 6.0, 30.0])
def test_a_computer_that_stands_still_for_a_while(tmp_path: Path, stall_s: float) -> None:
    """What has piled up is old, though it comes in now: the rover is stopped before it is driven on."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(3.0)
    rig.stall_s = stall_s
    rig.companion.tick()
    since_s = rig.now_s()
    assert rig.gave(Doubt.LOOP_STOOD_STILL)
    rig.run_for(0.3)
    setpoints = [one for one in rig.sent_since(since_s) if one.is_setpoint]
    assert setpoints and all(one.is_standstill for one in setpoints)
    assert_reached(rig)


def test_names_of_any_length_and_alphabet_are_said(tmp_path: Path) -> None:
    name = "Łąka za domem 🚜 " * 6
    rig = Rig(yard(tmp_path, f'[[target]]\nname = "{name}"\nfield = [15, 7]\n'))
    assert_reached(rig)
    assert f"Reached {name.strip()}" in [text.strip() for text in rig.texts()]
