"""Order of the mission's commands: one navigation command at a time, others alongside, jumps (behaviour of AP_Mission).

What a command does is up to the ``Runner`` (see ``mode_auto``).

Nouns: AP_Mission.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

from sitl.autopilot.mission_items import JUMP, JUMP_TAG, JUMP_TO_TAG, Item

FOREVER = -1

MOST_SEARCHED = 255
"""Items visited at most between two navigation commands, so that jumps cannot loop endlessly."""

MOST_JUMPS = 64

MOST_COUNTED_JUMPS = 100
"""Number of jumps that can be counted; further ones are not taken."""


class State(IntEnum):
    """State of the whole mission; the values are those of MISSION_STATE."""

    STOPPED = 2
    RUNNING = 3
    COMPLETE = 5


class Runner(Protocol):
    """Begins commands and checks whether they are done."""

    def start(self, index: int, item: Item) -> bool:
        """Begin a command; False if the vehicle does not know it."""
        ...

    def verify(self, index: int, item: Item) -> bool:
        """Whether a command that has begun is done."""
        ...

    def completed(self) -> None:
        """The mission has ended."""
        ...

    def jumped(self, index: int, times: int, of: int) -> None:
        """A jump was taken."""
        ...


@dataclass
class Mission:
    """The items (0 is home) and the vehicle's place in them."""

    items: list[Item] = field(default_factory=list)
    state: State = State.STOPPED
    nav_index: int | None = None
    nav_item: Item | None = None
    nav_running: bool = False
    do_index: int | None = None
    do_item: Item | None = None
    do_running: bool = False
    do_done: bool = False
    jumps: dict[int, int] = field(default_factory=dict)
    changes: int = 0
    """Number of items written so far."""

    @property
    def present(self) -> bool:
        """Whether there is any item besides home."""
        return len(self.items) > 1

    @property
    def current(self) -> int:
        """Index of the present navigation command; 0 if none."""
        return self.nav_index or 0

    def reset(self) -> None:
        """Forget the place in the mission."""
        self.nav_running = self.do_running = self.do_done = False
        self.nav_index = self.do_index = None
        self.jumps.clear()

    def start(self, runner: Runner) -> None:
        """Start from the first command."""
        self.state = State.RUNNING
        self.reset()
        if not self._advance(runner):
            self._complete(runner)

    def stop(self) -> None:
        """Pause until ``resume``."""
        if self.state == State.RUNNING:
            self.state = State.STOPPED

    def resume(self, runner: Runner) -> None:
        """Continue with the interrupted command; start over if there is none."""
        if self.state == State.COMPLETE or self.nav_index is None or self.nav_index >= len(self.items):
            self.start(runner)
            return
        self.state = State.RUNNING
        self.nav_item = self.items[self.nav_index]
        if self.do_running and self.do_index is not None:
            self.set_current(self.do_index, runner)
        elif self.nav_running:
            self.set_current(self.nav_index, runner)

    def clear(self) -> bool:
        """Remove all items; False while the mission is running."""
        if self.state == State.RUNNING:
            return False
        self.items.clear()
        self.nav_index = self.do_index = None
        self.nav_running = self.do_running = False
        self.changes += 1
        return True

    def write(self, index: int, item: Item) -> None:
        """Replace an item, or append one."""
        if index < len(self.items):
            self.items[index] = item
        else:
            self.items.append(item)
        self.changes += 1

    def update(self, runner: Runner) -> None:
        """Check what is done and begin what comes next; to be called often."""
        if self.state != State.RUNNING or not self.items:
            return
        done = False
        if self.nav_running and self.nav_index is not None and self.nav_item is not None:
            done = runner.verify(self.nav_index, self.nav_item)
            if done:
                self.nav_running = False
        if not self.nav_running and not self._advance(runner):
            self._complete(runner)
            return
        if not self.do_running:
            self._advance_do(runner)
        elif self.do_index is not None and self.do_item is not None and runner.verify(self.do_index, self.do_item):
            self.do_running = False

    def set_current(self, index: int, runner: Runner) -> bool:
        """Continue at a command; while stopped, only remember it. False if there is no such command."""
        if index >= len(self.items) or len(self.items) == 1:
            return False
        self.do_index, self.do_running, self.do_done = None, False, False
        self.nav_running = False
        if index == 0 or self.state == State.COMPLETE:
            self.jumps.clear()
        index = max(index, 1)
        if self.state != State.RUNNING:
            return self._remember(index)
        if self._advance(runner, index):
            return True
        self._complete(runner)
        return False

    def _remember(self, index: int) -> bool:
        while not self.nav_running:
            found = self.next_item(index, self.jumps)
            if found is None:
                self.nav_index = None
                return False
            if self.items[found].navigates:
                self.nav_index, self.nav_item, self.nav_running = found, self.items[found], True
            elif not self.do_running:
                self.do_index, self.do_item, self.do_running = found, self.items[found], True
            index = found + 1
        self.do_done = not self.do_running
        self.state = State.STOPPED
        return True

    def restart_current(self, runner: Runner) -> bool:
        """Begin the present navigation command again, with its present content."""
        if self.nav_index is None or self.nav_index >= len(self.items):
            return False
        self.nav_item = self.items[self.nav_index]
        return runner.start(self.nav_index, self.nav_item)

    def _complete(self, runner: Runner) -> None:
        self.state = State.COMPLETE
        runner.completed()

    def _advance(self, runner: Runner, start_at: int | None = None) -> bool:
        """Begin the next navigation command and the first other command before it; False at the end."""
        self.do_index, self.do_running, self.do_done = None, False, False
        if start_at is None:
            start_at = 1 if self.nav_index is None else self.nav_index + 1
        index = start_at
        for _ in range(MOST_SEARCHED):
            found = self.next_item(index, self.jumps, runner)
            if found is None:
                return False
            item = self.items[found]
            if item.navigates:
                self.nav_index, self.nav_item = found, item
                if runner.start(found, item):
                    self.nav_running = True
                    self.do_done = not self.do_running
                    return True
            elif not self.do_running:
                self.do_index, self.do_item, self.do_running = found, item, True
                runner.start(found, item)
            index = found + 1
        return False

    def _advance_do(self, runner: Runner) -> None:
        """Begin the next command that runs alongside the present navigation command."""
        if self.do_done:
            return
        found = self.next_item(1 if self.do_index is None else self.do_index + 1, dict(self.jumps))
        if found is None or self.items[found].navigates:
            self.do_done = True
            return
        self.do_index, self.do_item, self.do_running = found, self.items[found], True
        runner.start(found, self.items[found])

    def next_item(self, index: int, jumps: dict[int, int], runner: Runner | None = None) -> int | None:
        """Index of the first item from ``index`` on that is not a jump; jumps are followed and counted in ``jumps``."""
        for _ in range(len(self.items) + MOST_JUMPS):
            if index >= len(self.items):
                return None
            item = self.items[index]
            if item.command not in (JUMP, JUMP_TO_TAG):
                return index
            target, times = self._jump_target(item), int(item.params[1])
            if not 0 < target < len(self.items):
                return None
            if times == FOREVER:
                index = target
                continue
            if index not in jumps and len(jumps) >= MOST_COUNTED_JUMPS:
                index += 1
            elif jumps.get(index, 0) < times:
                jumps[index] = jumps.get(index, 0) + 1
                if runner is not None:
                    runner.jumped(index, jumps[index], times)
                index = target
            else:
                if runner is not None:
                    jumps[index] = 0  # it counts anew when the mission comes back
                index += 1
        return None

    def _jump_target(self, item: Item) -> int:
        """Index to which a jump leads, or 0; tags are searched from the beginning."""
        if item.command == JUMP:
            return int(item.params[0])
        tagged = (n for n, one in enumerate(self.items) if one.command == JUMP_TAG and one.params[0] == item.params[0])
        return next(tagged, 0)

    def next_nav(self, index: int) -> int | None:
        """Index of the next navigation command from ``index`` on; jumps are not counted."""
        jumps = dict(self.jumps)
        for _ in range(len(self.items)):
            found = self.next_item(index, jumps)
            if found is None or self.items[found].navigates:
                return found
            index = found + 1
        return None

    def ahead(self) -> Sequence[Item]:
        """The present command and the next two, by which a change of the mission is detected."""
        found: list[Item] = []
        index = self.nav_index
        while index is not None and index < len(self.items) and len(found) < 3:
            found.append(self.items[index])
            index = self.next_nav(index + 1)
        return found
