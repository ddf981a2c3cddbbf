"""What else a person may do where this run will not arm the rover again: options that only ``run`` has.

Nouns: arming advice.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.safety.reasons import Activity, Reason, WaitReason

AGAIN = (WaitReason.PERSON_ARMS_AGAIN, WaitReason.PERSON_SETS_MODE_AND_ARMS)
ADVICE = "This run does not arm again: arm it, or end this run, and start another with --arm, without --resume"


class ArmingAdvice:
    """Says it each time that arming begins to be awaited, data missing or not."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._awaits = False

    def look(self, activity: Activity) -> None:
        """To be called after each tick."""
        awaited: object = activity.awaited
        if isinstance(awaited, Reason) and awaited.kind is WaitReason.GOOD_DATA_AND:
            awaited = awaited.figures[1]
        before, self._awaits = self._awaits, isinstance(awaited, Reason) and awaited.kind in AGAIN
        if self._awaits and not before:
            self._say(ADVICE)
