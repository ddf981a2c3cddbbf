"""What ``run`` advises where it will not arm the rover again."""

from __future__ import annotations

from companion.cli.arming_advice import ADVICE, ArmingAdvice
from companion.safety.reasons import Activity, Doubt, Reason, RunPhase, WaitReason


def test_it_is_said_once_each_time_that_arming_is_awaited() -> None:
    arms = Reason(WaitReason.PERSON_SETS_MODE_AND_ARMS, ("GUIDED",))
    data = Reason(WaitReason.GOOD_DATA_AND, (Reason(Doubt.CLOCK_JUMPED), arms))
    mode, silent = Reason(WaitReason.PERSON_SETS_MODE, ("GUIDED",)), Reason(WaitReason.AUTOPILOT_HEARD)
    said: list[str] = []
    advice, counts = ArmingAdvice(said.append), []
    for awaited in (None, mode, silent, data, arms, arms, mode, Reason(WaitReason.PERSON_ARMS_AGAIN)):
        advice.look(Activity(RunPhase.STOPPED_AND_WAITING, awaited=awaited))
        counts.append(len(said))
    assert counts == [0, 0, 0, 1, 1, 1, 1, 2] and set(said) == {ADVICE}
