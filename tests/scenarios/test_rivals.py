"""Two companions for one rover, each on its own link: neither hears the other's heartbeat, both its figures."""

from __future__ import annotations

from pathlib import Path

from companion.app import Companion
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import InlineRunner
from companion.recording.recorder import NullRecorder
from companion.safety.reasons import Doubt, WaitReason
from tests.support.rig import GATE, HOLD, Rig, yard

ELSEWHERE = '[[target]]\nname = "corner"\nfield = [4, 1]\n[[target]]\nname = "edge"\nfield = [20, 2]\n'


def is_waiting_for_silence(companion: Companion) -> bool:
    awaited = companion.status().activity.awaited
    return awaited is not None and awaited.kind is WaitReason.OTHER_COMPANION_SILENT


def is_stopped_by_the_other(companion: Companion) -> bool:
    reason = companion.status().activity.reason
    return reason is not None and reason.kind is Doubt.OTHER_COMPANION


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
            if not self.other.done:
                self.other.tick()
            self._other_link.receive(self._other_far.read())


def missions(folder: Path) -> tuple[Mission, Mission]:
    (folder / "other").mkdir()
    return yard(folder, GATE), yard(folder / "other", ELSEWHERE)


def test_a_rover_that_another_companion_drives_is_left_to_it(tmp_path: Path) -> None:
    first, second = missions(tmp_path)
    rig = Two(first, late_s=45.0)
    rig.until_driven(1.0)
    rig.second(second)
    other, waited = rig.other, False
    assert other is not None
    while not rig.companion.done:
        rig.run_for(0.2)
        waited = waited or is_waiting_for_silence(other)
        assert other.driver is None or rig.companion.done
    assert waited
    assert rig.companion.outcome.complete and not rig.was_stopped


def test_one_that_waits_for_another_companion_leaves_without_touching_the_rover(tmp_path: Path) -> None:
    first, second = missions(tmp_path)
    rig = Two(first, late_s=45.0)
    rig.until_driven(1.0)
    rig.second(second)
    other = rig.other
    assert other is not None
    rig.until(lambda: is_waiting_for_silence(other), 5.0)
    other.stop()
    rig.until(lambda: other.done, 2.0)
    rig.finish()
    assert rig.companion.outcome.complete and not rig.was_stopped


def test_two_companions_that_begin_together_both_stop_and_leave_it_to_a_person(tmp_path: Path) -> None:
    first, second = missions(tmp_path)
    rig = Two(first, late_s=45.0)
    rig.second(second)
    other = rig.other
    assert other is not None
    rig.until(lambda: rig.companion.driver is not None and other.driver is not None, 60.0)
    both_s = rig.now_s()
    for one in (rig.companion, other):
        rig.until(lambda one=one: is_stopped_by_the_other(one), 2.0)
    assert rig.now_s() - both_s <= 1.1, "figures are told every second"
    rig.until(lambda: rig.mode == HOLD, 3.0)
    rig.run_for(10.0)
    assert rig.mode == HOLD and rig.speed_m_s < 0.05, "nobody takes it again"
    assert rig.simulator.collisions == ()
