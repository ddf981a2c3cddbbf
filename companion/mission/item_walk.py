"""The order in which ArduPilot takes the items of a mission: one after the other, with jumps and endless loops.

As AP_Mission does it (``get_next_cmd``): a jump item counts its jumps, and counts anew once it has let the mission
pass; -1 jumps for ever.

Nouns: item walk.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.mission import mav_commands as mav
from companion.mission.items import Item, ItemError

FOR_EVER = -1.0
ROUNDS = 3
"""An endless loop is known once its jump is met for the third time: its last place has then what follows the jump."""

Moment = tuple[int, tuple[tuple[int, int], ...], float | None]
"""Where the mission is at an endless jump: the jump, the counts of the others, and the speed."""


@dataclass
class ItemWalk:
    """Where the walk is. ``places``: positions by item number; ``rounds``: how many targets there were at a moment."""

    items: Sequence[Item]
    here: int = 0
    jumps: Counter[int] = field(default_factory=Counter)
    jumped: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Jumps that count: the item that they lead to, and how often."""
    rounds: dict[Moment, list[int]] = field(default_factory=dict)
    loop: tuple[Item, int, int] | None = None
    """The endless jump, and the targets (from, to) that it goes through again and again."""

    def __post_init__(self) -> None:
        self._places = {item.index: i for i, item in enumerate(self.items)}
        self._tags: dict[float, int] = {}
        for i, item in enumerate(self.items):
            if item.command == mav.JUMP_TAG:
                self._tags.setdefault(item.param(1), i)

    @property
    def over(self) -> bool:
        """Whether there is nothing more to come."""
        return self.loop is not None or self.here >= len(self.items)

    def jump(self, item: Item, targets: int, speed_m_s: float | None) -> None:
        """Take this jump, or pass it. ``targets``: how many there are so far. Raises ItemError."""
        to, repeats = self._target_of(item), item.param(2)
        if repeats == FOR_EVER:
            self._jump_for_ever(item, to, targets, speed_m_s)
            return
        if not (math.isfinite(repeats) and repeats >= 0.0 and repeats == int(repeats)):
            raise ItemError(f"{item.label}: {repeats:g} repeats")
        if self.jumps[item.index] >= repeats:
            self.jumps[item.index] = 0
            self.here += 1
            return
        self.jumps[item.index] += 1
        self.jumped[item.index] = (self.items[to].index, int(repeats))
        self.here = to

    def _jump_for_ever(self, item: Item, to: int, targets: int, speed_m_s: float | None) -> None:
        moment = (item.index, tuple(sorted((number, n) for number, n in self.jumps.items() if n)), speed_m_s)
        rounds = self.rounds.setdefault(moment, [])
        rounds.append(targets)
        if len(rounds) > 1 and rounds[-1] == rounds[-2]:
            raise ItemError(f"{item.label}: repeats for ever without a place to go to")
        self.here = to
        if len(rounds) == ROUNDS:
            self.loop = (item, rounds[0], rounds[1])

    def _target_of(self, item: Item) -> int:
        """The position that a jump leads to. Raises ItemError."""
        to = item.param(1)
        if item.command == mav.DO_JUMP_TAG:
            if to not in self._tags:
                raise ItemError(f"{item.label}: there is no tag {to:g} to jump to")
            return self._tags[to]
        if to == item.index:
            raise ItemError(f"{item.label}: jumps to itself; name the item that it should go back to")
        if not math.isfinite(to) or to != int(to) or int(to) not in self._places:
            raise ItemError(f"{item.label}: there is no item {to:g} to jump to")
        return self._places[int(to)]
