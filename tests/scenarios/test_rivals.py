"""Two who steer one rover, each on a link of his own, in lock-step: neither hears the other, both hear the autopilot's target."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.app import Companion
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.mission.mission import Mission
from companion.recorder import NullRecorder
from companion.stepping import InlineRunner
from tests.rig import GATE, GUIDED, HOLD, Rig, yard

ELSEWHERE = '[[target]]\nname = "corner"\nfield = [4, 1]\n[[target]]\nname = "edge"\nfield = [20, 2]\n'
COMMANDED = "another companion or ground station commands this rover"


class SameClock:
    """Somebody else's: time passes by the rig alone."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    def now_s(self) -> float:
        return self._rig.now_s()

    def sleep_until_s(self, time_s: float) -> None:
        pass


class Two(Rig):
    """A rig with a second companion, from ``second`` on."""

    other: Companion | None = None

    def second(self, mission: Mission, *, arm: bool = True) -> None:
        near, self._other_far = MemoryLink.pair()
        self._other_link = self.simulator.connect()
        link = AutopilotLink(near, Codec(self.settings.link), self.settings.link, NullRecorder())
        runner, log = InlineRunner(), NullRecorder()
        self.other = Companion(link, SameClock(self), mission, self.settings, runner, log, seed=1, arm=arm)

    def sleep_until_s(self, time_s: float) -> None:
        super().sleep_until_s(time_s)
        if self.other is not None:
            self._other_far.write(self._other_link.take())
            self.other.tick()
            self._other_link.receive(self._other_far.read())


def missions(folder: Path) -> tuple[Mission, Mission]:
    (folder / "other").mkdir()
    return yard(folder, GATE), yard(folder / "other", ELSEWHERE)


def test_a_rover_that_somebody_drives_is_left_to_him(tmp_path: Path) -> None:
    first, second = missions(tmp_path)
    rig = Two(first, late_s=45.0)
    rig.until_driven(1.0)
    rig.second(second)
    other, said = rig.other, set()
    assert other is not None
    while not rig.companion.done:
        rig.run_for(0.2)
        said.add(other.status().doing)
        assert other.driver is None or rig.companion.done
    assert "waiting for another companion or ground station to leave the rover alone (its target changes)" in said
    assert rig.companion.outcome.complete and COMMANDED not in " ".join(rig.texts())


def test_a_rover_found_armed_in_guided_is_listened_to_first(tmp_path: Path) -> None:
    first, second = missions(tmp_path)
    rig = Two(first, late_s=45.0)
    rig.until(lambda: rig.armed and rig.mode == GUIDED)
    rig.lose = lambda: True
    rig.second(second)
    rig.run_for(2.5)
    other = rig.other
    assert other is not None and other.driver is None
    assert other.status().doing == "waiting for signs of somebody else who drives it (it is armed in GUIDED)"
    rig.until(lambda: other.driver is not None, 12.0)


def test_two_companions_on_links_of_their_own_end_in_hold(tmp_path: Path) -> None:
    first, second = missions(tmp_path)
    rig = Two(first, late_s=45.0)
    rig.second(second)
    rig.until(lambda: rig.mode == HOLD, 60.0)
    other = rig.other
    assert other is not None and other.driver is not None, "both had begun at the same time"
    said = [*rig.texts(), *other.outcome.said]
    assert f"Stopping: {COMMANDED}" in said and f"HOLD: {COMMANDED}" in said
    rig.run_for(10.0)
    assert rig.mode == HOLD and rig.speed_m_s < 0.05, "nobody takes it again"
    assert rig.simulator.collisions == ()


@pytest.mark.parametrize(("times", "stops"), [(1, False), (3, True)])
def test_places_that_somebody_else_sends_stop_the_rover(tmp_path: Path, times: int, stops: bool) -> None:
    rig = Rig(yard(tmp_path), late_s=45.0)
    rig.until_driven(1.0)
    rng = np.random.default_rng(0)
    for i in range(times):
        place = (float(rng.uniform(3.0, 4.0)), 3.0 + i, 0.0)
        rest = (0.0,) * 8
        rig.station(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 3580, *place, *rest))
        rig.run_for(1.5)
    assert (f"Stopping: {COMMANDED}" in rig.texts()) is stops, rig.texts()
    if not stops:
        rig.finish()
        assert rig.companion.outcome.complete, "a single click of a person is answered by our own place, sent again"
    else:
        rig.until(lambda: rig.mode != GUIDED, 4.0)
