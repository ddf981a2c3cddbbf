"""Runs the companion again on the bytes of a record, and compares its decisions and packets with the recorded ones.

It reads files and nothing else: no link, no clock, no thread. The record contains everything that did not follow from
bytes and files, such as the tick in which the answer of a thread arrived (docs/record.md).

Nouns: replay.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from companion.app import Companion
from companion.checkpoint.checkpointer import Checkpointer, StateUpdate
from companion.checkpoint.resume import PreviousRun
from companion.checkpoint.state_format import MAX_FILE_BYTES, StateError, decode_state
from companion.core.tick_marks import Mark
from companion.executive.mission_progress import MissionProgress
from companion.lidar.reader import Chunk, Lidars, lidars_on
from companion.lidar.spec import LidarError, parsed
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.describe import packet_difference, packet_name
from companion.mavlink.signing import Recorded, without_signature
from companion.mission.mission import MissionError
from companion.navigation.field_step import Decision, NavState
from companion.navigation.step_runner import StepCall
from companion.recording.reader import Record, RecordedTick
from companion.recording.record_format import STATE, LidarEntry, RecordError, TickEntry, decision_line
from companion.safety.reasons import EndReason
from companion.storage.files import read_at_most

Answer = tuple[NavState, Decision]


class EndOfRecordError(Exception):
    """The companion continues after the end of the record."""


@dataclass
class ReplayResult:
    """Counts, differences (a line each) and what became of the targets. ``companion``: the one that was run."""

    ticks: int = 0
    seconds: float = 0.0
    heard: int = 0
    said: int = 0
    decisions: int = 0
    differences: list[str] = field(default_factory=list)
    targets: list[tuple[str, str]] = field(default_factory=list)
    companion: Companion | None = None


class RecordPlayer:
    """Plays a record tick by tick: it is the link, the clock and the log of the companion that is run again."""

    description = "the recorded link"
    connected = True
    problem = ""

    def __init__(
        self,
        record: Record,
        on_decision: Callable[[int, float, str, Decision], None],
        on_said: Callable[[bytes], None] = lambda raw: None,
    ) -> None:
        self.result = ReplayResult()
        self.signatures = Recorded()
        self._record = record
        self._ticks: Iterator[RecordedTick] = record.ticks()
        self._next = next(self._ticks, None)
        self._current = RecordedTick(TickEntry(0.0), [], [])
        self._began_s: float | None = None
        self._unread: list[bytes] = []
        self._lidar_ports = [_RecordedPort(number) for number, _ in enumerate(record.meta.lidars, 1)]
        self._said: list[bytes] = []
        self._on_decision = on_decision
        self._on_said = on_said

    @property
    def entry(self) -> TickEntry:
        """The present tick."""
        return self._current.entry

    @property
    def next_marks(self) -> Mark | None:
        """Marks of the next tick; None if there is none left."""
        return None if self._next is None else Mark(self._next.entry.marks)

    @property
    def stopped_by(self) -> EndReason:
        """What asked the run to stop, where the next tick says that something did."""
        by_signal = self._next is not None and bool(self._next.entry.marks & Mark.TERMINATED)
        return self._record.meta.end_reason or (EndReason.TERMINATED if by_signal else EndReason.STOPPED_BY_USER)

    def advance(self) -> None:
        """Go to the next tick. Raises EndOfRecordError."""
        self._compare_said(last=self._next is None)
        if self._next is None:
            raise EndOfRecordError
        self._current, self._next = self._next, next(self._ticks, None)
        self.signatures.set_marks(self.entry.marks)
        self._unread, self._said = list(self._current.heard), []
        for port in self._lidar_ports:
            port.advance(self._current.lidars)
        self._began_s = self.entry.time_s if self._began_s is None else self._began_s
        self.result.ticks += 1
        self.result.seconds = self.entry.time_s - self._began_s

    def lidars(self) -> Lidars:
        """The lidars of the run, which read what was recorded. Raises RecordError."""
        try:
            return lidars_on([parsed(text) for text in self._record.meta.lidars], self._lidar_ports)
        except LidarError as error:
            raise RecordError(f"{self._record.directory}: {error}") from error

    def differs(self, what: str) -> None:
        """Note a difference."""
        self.result.differences.append(f"{self.result.seconds:.2f} s: {what}")

    def end(self) -> None:
        """The replay is over: compare the last tick, and note what it left out."""
        self._compare_said(last=True)
        if self._next is not None:
            self.differs("the replay has ended, and the run went on")
        missing = [line for line in self._record.decisions[self.result.decisions :] if self._is_due(line)]
        if missing:
            self.differs(f"{len(missing)} recorded decisions are missing in the replay")

    # The companion's clock and link ------------------------------------------------------------------------------

    def now_s(self) -> float:
        """The time of the present tick."""
        return self.entry.time_s

    def sleep_until_s(self, time_s: float) -> None:
        """The companion's sleep goes to the next tick, however long the recorded one slept."""
        self.advance()

    def read(self) -> bytes:
        """What was heard in this tick."""
        data, self._unread = b"".join(self._unread), []
        return data

    def write(self, data: bytes) -> None:
        """Ignored; ``said`` gets it packet by packet."""

    def close(self) -> None:
        """Nothing to close."""

    # The companion's log -----------------------------------------------------------------------------------------

    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """Counted."""
        self.result.heard += len(packets)

    def said(self, time_s: float, raw: bytes) -> None:
        """Compared when the tick is over."""
        self._said.append(raw)
        self._on_said(raw)

    def begin(self, time_s: float, mark: Mark) -> None:
        """It is in the record."""

    def mark(self, mark: Mark) -> None:
        """The recorded tick must have this mark, but for one that older records lack."""
        if not self.entry.marks & mark and mark is not Mark.TERMINATED:
            self.differs(f"{mark.name} in this tick, not so in the run")

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """Compared with the recorded one of the same number."""
        number, self.result.decisions = self.result.decisions, self.result.decisions + 1
        self._on_decision(self.result.decisions, self.result.seconds, target, decision)
        if number >= len(self._record.decisions):
            if self._record.complete:
                self.differs(f"decision {number + 1} ({decision.reason}) was not made in the run")
        elif self._record.decisions[number] != decision_line(time_s, target, decision):
            self.differs(f"decision {number + 1}: {decision.reason}, recorded: {self._record.decisions[number]:.200}")

    def _is_due(self, line: str) -> bool:
        """Whether a recorded decision should have been made by now: the last ticks of a record may be missing."""
        time_s = json.loads(line)["time_s"]
        return self._record.complete or time_s < self.entry.time_s

    def _compare_said(self, *, last: bool) -> None:
        """Compare packets. In the ``last`` tick more are no difference: the run may have ended in the middle of it."""
        recorded, now = self._current.said, self._said
        self._said = []
        self.result.said += len(now)
        for was, is_now in zip(recorded, now, strict=False):
            if without_signature(was) != without_signature(is_now):
                self.differs(f"said {packet_difference(was, is_now)}")
        for raw in recorded[len(now) :]:
            self.differs(f"{packet_name(raw)} was said in the run, not in the replay")
        for raw in () if last else now[len(recorded) :]:
            self.differs(f"{packet_name(raw)} is said in the replay, not in the run")


class _RecordedPort:
    """The port of a lidar in a record."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._chunks: list[Chunk] = []

    def advance(self, entries: tuple[LidarEntry, ...]) -> None:
        """A new tick, and what was heard in it."""
        self._chunks = [Chunk(one.time_s, one.data) for one in entries if one.number == self._number]

    def read(self) -> list[Chunk]:
        """What was heard in this tick."""
        chunks, self._chunks = self._chunks, []
        return chunks

    def write(self, data: bytes) -> None:
        """Nobody is there."""

    def close(self) -> None:
        """Nothing to close."""


class ReplayStepRunner:
    """Computes a step at once, and returns the answer in the tick in which the recorded run got it."""

    def __init__(self, player: RecordPlayer, on_start: Callable[[], None]) -> None:
        self._player = player
        self._on_start = on_start
        self._answer: Answer | Exception | None = None

    @property
    def busy(self) -> bool:
        """Whether an answer has not been taken."""
        return self._answer is not None

    @property
    def working(self) -> bool:
        """Whether the thread of the recorded run was computing in this tick."""
        return bool(self._player.entry.marks & Mark.WORKING)

    def start(self, call: StepCall) -> None:
        """Compute now. An error is kept and raised by ``take``."""
        self._on_start()
        try:
            self._answer = call()
        except Exception as error:
            self._answer = error

    def take(self) -> Answer | None:
        """The answer, once, and not before the recorded run had it."""
        if self._answer is None or not self._player.entry.marks & Mark.ANSWER:
            return None
        answer, self._answer = self._answer, None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def close(self) -> None:
        """Nothing to end."""


class ReplayObserver:
    """Is called during a replay. This one does nothing."""

    def step_begins(self, companion: Companion) -> None:
        """A step of the navigator is about to be computed."""

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """A decision was made. ``number`` counts from 1, ``time_s`` from the beginning of the run."""

    def said(self, companion: Companion, time_s: float, raw: bytes) -> None:
        """The companion sends a packet. ``time_s``: since the beginning of the run."""

    def ticked(self, companion: Companion, time_s: float) -> None:
        """A tick is over. ``time_s``: since the beginning of the run."""


class Observers(ReplayObserver):
    """Several observers of one replay, told in their order."""

    def __init__(self, observers: Iterable[ReplayObserver]) -> None:
        self._observers = tuple(observers)

    def step_begins(self, companion: Companion) -> None:
        """See ``ReplayObserver``."""
        for one in self._observers:
            one.step_begins(companion)

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """See ``ReplayObserver``."""
        for one in self._observers:
            one.decided(companion, number, time_s, target, decision)

    def said(self, companion: Companion, time_s: float, raw: bytes) -> None:
        """See ``ReplayObserver``."""
        for one in self._observers:
            one.said(companion, time_s, raw)

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        for one in self._observers:
            one.ticked(companion, time_s)


def replay(record: Record, observer: ReplayObserver | None = None) -> ReplayResult:
    """Run the companion of a record again. Raises RecordError if the record is damaged."""
    notified = observer or ReplayObserver()

    def said(raw: bytes) -> None:
        if player.result.companion is not None:
            notified.said(player.result.companion, player.result.seconds, raw)

    player = RecordPlayer(record, lambda *decided: notified.decided(companion, *decided), said)
    runner = ReplayStepRunner(player, lambda: notified.step_begins(companion))
    player.advance()
    link = record.settings.link
    autopilot = AutopilotLink(player, Codec(link, recorded=player.signatures), link, player)
    companion = Companion(
        autopilot,
        player,
        record.mission,
        record.settings,
        runner,
        player,
        seed=record.meta.seed,
        arm=record.meta.arm,
        checkpointer=_checkpointer(record, player),
        lidars=player.lidars(),
    )
    player.result.companion = companion
    try:
        while not companion.done and _tick(companion, player):
            notified.ticked(companion, player.result.seconds)
    except EndOfRecordError:
        pass
    player.end()
    player.result.targets = [(name, str(status)) for name, status in companion.statuses()]
    return player.result


def _checkpointer(record: Record, player: RecordPlayer) -> Checkpointer:
    """Writes nothing; has the interrupted run that the recorded one resumed. Raises RecordError."""
    writer, file = _NoStateWriter(player), record.input(STATE)
    if file is None:
        return Checkpointer(record.mission, writer)
    try:
        previous = PreviousRun(*decode_state(read_at_most(file, MAX_FILE_BYTES)))
    except OSError as error:
        raise RecordError(f"{file}: cannot be read: {error.strerror}; the run cannot be replayed without it") from error
    except StateError as error:
        raise RecordError(f"{file}: {error}") from error
    return Checkpointer(record.mission, writer, previous)


class _NoStateWriter:
    """Writes nothing, but fails where the recorded run failed to write."""

    busy = False

    def __init__(self, player: RecordPlayer) -> None:
        self._player = player

    @property
    def problem(self) -> str:
        """Whether the recorded run could not save its state."""
        return "not saved" if self._player.entry.marks & Mark.UNSAVED else ""

    def holds(self, progress: MissionProgress) -> bool:
        """Whether the recorded run knew in this tick that its state was saved."""
        return bool(self._player.entry.marks & Mark.SAVED)

    def put(self, update: StateUpdate) -> None:
        """Ignored."""

    def close(self) -> None:
        """Nothing to write."""


def _tick(companion: Companion, player: RecordPlayer) -> bool:
    """Run one tick of any kind. False if there is none left."""
    marks = player.next_marks
    if marks is None:
        return False
    if marks & Mark.CLOSE:
        player.differs("the run was broken off by an error that the replay does not have")
        player.advance()
        companion.close()
        return True
    if marks & Mark.STOP:
        companion.stop(player.stopped_by)
    try:
        companion.tick()
    except EndOfRecordError:
        raise
    except Exception as error:
        _broken_off(companion, player, error)
    return True


def _broken_off(companion: Companion, player: RecordPlayer, error: Exception) -> None:
    """An error broke the replay off: the recorded run must have had it, too. Raises an unexpected error."""
    if player.next_marks is None or not player.next_marks & Mark.CLOSE:
        if not isinstance(error, MissionError):
            raise error
        player.differs(f"the replay is broken off by an error that the run did not have: {error}")
        return
    player.advance()
    companion.close()
