"""Runs a companion again on what a record says that it heard, and compares what it decides and says with what was recorded.

It reads files and nothing else: no link, no clock, no thread. The moment at which a thread's answer arrived is recorded, and so is
everything else that did not follow from bytes and files (docs/record.md).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from companion.app import Companion
from companion.checkpoint.checkpointer import Memory
from companion.checkpoint.format import MAX_FILE_BYTES, StateError, decoded
from companion.checkpoint.resume import Kept
from companion.checkpoint.writer import Update
from companion.core.round_marks import Mark
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.naming import compared, named
from companion.mavlink.signing import Recorded, without_signature
from companion.mission.mission import MissionError
from companion.navigation.field_step import Decision, NavState
from companion.navigation.step_runner import StepCall
from companion.recording.reader import Heard, Record
from companion.recording.recorded_files import RecordError
from companion.recording.recorder import STATE, decision_line
from companion.recording.rounds import Round
from companion.storage.reading import read_at_most

Answer = tuple[NavState, Decision]


class EndOfRecordError(Exception):
    """The companion wants to go on, and the record does not."""


@dataclass
class Replayed:
    """What came of it."""

    rounds: int = 0
    seconds: float = 0.0
    heard: int = 0
    said: int = 0
    decisions: int = 0
    differences: list[str] = field(default_factory=list)
    targets: list[tuple[str, str]] = field(default_factory=list)
    companion: Companion | None = None


class Tape:
    """The record as link, clock and log of a companion: it stands at one round after the other."""

    description = "record"
    problem = ""

    def __init__(self, record: Record, on_decision: Callable[[int, float, str, Decision], None]) -> None:
        self.result = Replayed()
        self.signatures = Recorded()
        self._record = record
        self._rounds: Iterator[Heard] = record.rounds()
        self._next = next(self._rounds, None)
        self._at = Heard(Round(0.0), [], [])
        self._began_s: float | None = None
        self._unread: list[bytes] = []
        self._said: list[bytes] = []
        self._on_decision = on_decision

    @property
    def round(self) -> Round:
        """The present round."""
        return self._at.round

    @property
    def next_marks(self) -> Mark | None:
        """What comes from outside in the next round; None when there is none left."""
        return None if self._next is None else Mark(self._next.round.marks)

    def advance(self) -> None:
        """To the next round. Raises EndOfRecordError."""
        self._compare_said(last=self._next is None)
        if self._next is None:
            raise EndOfRecordError
        self._at, self._next = self._next, next(self._rounds, None)
        self.signatures.take(self.round.marks)
        self._unread, self._said = list(self._at.heard), []
        self._began_s = self.round.time_s if self._began_s is None else self._began_s
        self.result.rounds += 1
        self.result.seconds = self.round.time_s - self._began_s

    def differs(self, what: str) -> None:
        """Note a difference."""
        self.result.differences.append(f"{self.result.seconds:.2f} s: {what}")

    def end(self) -> None:
        """Nothing more is replayed: look at the last round, and at what was not asked for again."""
        self._compare_said(last=True)
        if self._next is not None:
            self.differs("the replay has ended, and the run went on")
        missing = [line for line in self._record.decisions[self.result.decisions :] if self._is_due(line)]
        if missing:
            self.differs(f"{len(missing)} recorded decisions are missing in the replay")

    # The companion's clock and link ------------------------------------------------------------------------------

    def now_s(self) -> float:
        """The time of the present round."""
        return self.round.time_s

    def sleep_until_s(self, time_s: float) -> None:
        """The companion's sleep takes it to the next round, however long the real one slept."""
        self.advance()

    def read(self) -> bytes:
        """What was heard in this round."""
        data, self._unread = b"".join(self._unread), []
        return data

    def write(self, data: bytes) -> None:
        """Goes nowhere; ``said`` has it packet by packet."""

    def close(self) -> None:
        """Nothing to let go of."""

    # The companion's log -----------------------------------------------------------------------------------------

    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """Counted."""
        self.result.heard += len(packets)

    def said(self, time_s: float, raw: bytes) -> None:
        """To be compared when the round is over."""
        self._said.append(raw)

    def begin(self, time_s: float, mark: Mark) -> None:
        """The record has it."""

    def mark(self, mark: Mark) -> None:
        """What the replay makes of it must be what was recorded."""
        if not self.round.marks & mark:
            self.differs(f"{mark.name} in this round, not so in the run")

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """Compared with the recorded one of the same number."""
        number, self.result.decisions = self.result.decisions, self.result.decisions + 1
        self._on_decision(self.result.decisions, self.result.seconds, target, decision)
        if number >= len(self._record.decisions):
            if self._record.whole:
                self.differs(f"decision {number + 1} ({decision.reason}) was not made in the run")
        elif self._record.decisions[number] != decision_line(time_s, target, decision):
            self.differs(f"decision {number + 1}: {decision.reason}, recorded: {self._record.decisions[number]:.200}")

    def _is_due(self, line: str) -> bool:
        """Whether a recorded decision should have been made by now; of a record that was cut the last rounds may be missing."""
        time_s = json.loads(line)["time_s"]
        return self._record.whole or time_s < self.round.time_s

    def _compare_said(self, *, last: bool) -> None:
        """A run may have been broken off in the middle of its last round."""
        recorded, now = self._at.said, self._said
        self._said = []
        self.result.said += len(now)
        for was, is_now in zip(recorded, now, strict=False):
            if without_signature(was) != without_signature(is_now):
                self.differs(f"said {compared(was, is_now)}")
        for raw in recorded[len(now) :]:
            self.differs(f"{named(raw)} was said in the run, not in the replay")
        for raw in () if last else now[len(recorded) :]:
            self.differs(f"{named(raw)} is said in the replay, not in the run")


class TapeRunner:
    """Computes at once, and hands the answer over in the round in which the run got it."""

    def __init__(self, tape: Tape, on_start: Callable[[], None]) -> None:
        self._tape = tape
        self._on_start = on_start
        self._answer: Answer | Exception | None = None

    @property
    def busy(self) -> bool:
        """Whether the answer has not been taken."""
        return self._answer is not None

    @property
    def working(self) -> bool:
        """Whether the run's thread was computing in this round."""
        return bool(self._tape.round.marks & Mark.WORKING)

    def start(self, call: StepCall) -> None:
        """Compute now."""
        self._on_start()
        try:
            self._answer = call()
        except Exception as error:
            self._answer = error

    def take(self) -> Answer | None:
        """The answer, once, and not before the run had it."""
        if self._answer is None or not self._tape.round.marks & Mark.ANSWER:
            return None
        answer, self._answer = self._answer, None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def close(self) -> None:
        """Nothing to end."""


class Observer:
    """Looks on; this one at nothing."""

    def step_begins(self, companion: Companion) -> None:
        """The navigator's step is about to be computed."""

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """A decision was made; they count from 1, and the seconds from the beginning of the run."""


def replay(record: Record, observer: Observer | None = None) -> Replayed:
    """Run the companion of a record again. Raises RecordError when the record turns out to be damaged."""
    look = observer or Observer()
    tape = Tape(record, lambda *decided: look.decided(companion, *decided))
    runner = TapeRunner(tape, lambda: look.step_begins(companion))
    tape.advance()
    link = record.settings.link
    autopilot = AutopilotLink(tape, Codec(link, recorded=tape.signatures), link, tape)
    companion = Companion(
        autopilot,
        tape,
        record.mission,
        record.settings,
        runner,
        tape,
        seed=record.meta.seed,
        arm=record.meta.arm,
        memory=_memory(record, tape),
    )
    tape.result.companion = companion
    try:
        while not companion.done and _round(companion, tape):
            pass
    except EndOfRecordError:
        pass
    tape.end()
    tape.result.targets = [(name, str(status)) for name, status in companion.statuses()]
    return tape.result


def _memory(record: Record, tape: Tape) -> Memory:
    """With what an earlier run has left, if this one took it up. Raises RecordError."""
    file = record.input(STATE)
    if file is None:
        return Memory(record.mission, _NoWriter(tape))
    try:
        return Memory(record.mission, _NoWriter(tape), Kept(*decoded(read_at_most(file, MAX_FILE_BYTES))))
    except OSError as error:
        raise RecordError(f"{file}: cannot be read: {error.strerror}; the run cannot be replayed without it") from error
    except StateError as error:
        raise RecordError(f"{file}: {error}") from error


class _NoWriter:
    """A replay keeps nothing, but fails when the run did."""

    busy = False

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    @property
    def problem(self) -> str:
        """Whether the run could not save its state."""
        return "not saved" if self._tape.round.marks & Mark.UNSAVED else ""

    def put(self, update: Update) -> None:
        """Not kept."""

    def close(self) -> None:
        """Nothing to write."""


def _round(companion: Companion, tape: Tape) -> bool:
    """One round, whatever kind it was; False when there is none left."""
    marks = tape.next_marks
    if marks is None:
        return False
    if marks & Mark.CLOSE:
        tape.differs("the run was broken off by an error that the replay does not have")
        tape.advance()
        companion.close()
        return True
    if marks & Mark.STOP:
        companion.stop()
    try:
        companion.tick()
    except EndOfRecordError:
        raise
    except Exception as error:
        _broken_off(companion, tape, error)
    return True


def _broken_off(companion: Companion, tape: Tape, error: Exception) -> None:
    """The replay has run into an error: the run must have, too."""
    if tape.next_marks is None or not tape.next_marks & Mark.CLOSE:
        if not isinstance(error, MissionError):
            raise error
        tape.differs(f"the replay is broken off by an error that the run did not have: {error}")
        return
    tape.advance()
    companion.close()
