"""The record of a run: what went in, what was decided, what was said, and what it was run with (docs/record.md)."""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import IO, Protocol

from companion.core.clock import unix_time_us
from companion.core.round_marks import Mark
from companion.mission.as_json import to_json
from companion.mission.mission import Mission
from companion.navigation.field_step import Decision
from companion.recording.recorded_files import Copied, RecordError, copied, in_record
from companion.recording.rounds import Round
from companion.settings import Settings
from companion.settings.versions import versions
from companion.storage.beside import Beside, Job
from companion.storage.disk import write_whole
from companion.storage.reading import refuse_pipe

__all__ = ["DecisionLog", "NullRecorder", "RecordError", "Recorder", "decision_line", "unused"]

FORMAT = 3
"""Of the whole directory; a reader refuses others."""
META, MISSION, PACKETS, ROUNDS, DECISIONS = "meta.json", "mission.json", "link.tlog", "rounds.bin", "decisions.jsonl"
STATE = "state"
"""The kind of input file that an earlier run has left."""
FLUSH_S = 1.0
MOST_WAITING_BYTES = 20_000_000
"""An hour of driving, for a disk that does not answer."""
NO_ANSWER = "the disk does not answer"


class DecisionLog(Protocol):
    """Takes the navigator's decisions, and what came to the companion other than in bytes."""

    problem: str
    """Why the record has ended early; empty while all is well."""

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One decision on the way to a target; ``time_s`` is the companion's clock."""
        ...

    def begin(self, time_s: float, mark: Mark) -> None:
        """A round in which nothing is heard: the companion was made, or goes its way out."""
        ...

    def mark(self, mark: Mark) -> None:
        """Something has come from outside in this round."""
        ...


class NullRecorder:
    """Records nothing."""

    problem = ""

    def heard(self, time_s: float, packets: list[bytes], mark: Mark = Mark(0)) -> None:  # noqa: B008 - frozen
        """Ignored."""

    def said(self, time_s: float, raw: bytes) -> None:
        """Ignored."""

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """Ignored."""

    def begin(self, time_s: float, mark: Mark) -> None:
        """Ignored."""

    def mark(self, mark: Mark) -> None:
        """Ignored."""

    def close(self) -> None:
        """Nothing to close."""


class Recorder:
    """Writes the directory that docs/record.md describes.

    A directory that has a record keeps it: the new one goes to the same name with a number, see ``directory``. ``files`` are further files that
    the run follows from, by what they are (None: there is none); they are copied.
    What comes is written once a second; with ``beside`` by a thread, which ``close`` ends, and no round waits for the disk.
    ``start_us`` is the beginning in microseconds since 1970, by default now. Raises RecordError if the directory cannot be written. Later a full
    disk ends the record, never the run: see ``problem``.
    """

    def __init__(
        self,
        directory: Path,
        mission: Mission | None,
        settings: Settings,
        seed: int,
        *,
        arm: bool = False,
        files: Mapping[str, Path | None] | None = None,
        start_us: int | None = None,
        beside: Beside | None = None,
    ) -> None:
        self.directory = unused(directory)
        self.problem = ""
        """Why the record ends early; empty while all is well."""
        self._files: dict[str, IO[bytes]] = {}
        self._waiting: dict[str, bytearray] = {}
        self._sums: dict[str, tuple[int, int]] = {}
        self._given = self._taken = 0
        self._closed = False
        self._beside = beside
        self._clock_at_start_s: float | None = None
        self._flushed_s = 0.0
        self._start_us = unix_time_us() if start_us is None else start_us
        self._round: Round | None = None
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            inputs = copied(self.directory, mission, files or {})
            if mission is not None:
                known = None if mission.prior_map is None else Path(in_record(inputs, mission.prior_map))
                text = to_json(replace(mission, prior_map=known)).encode()
                write_whole(self.directory / MISSION, text)
                inputs.append(Copied("mission", MISSION, str(mission.source or ""), hashlib.sha256(text).hexdigest()))
            self._meta = _meta(mission, settings, seed, arm, self._start_us, inputs)
            self._write_meta(None)
            for name in (PACKETS, ROUNDS, DECISIONS):
                refuse_pipe(self.directory / name)
                self._files[name] = (self.directory / name).open("wb", buffering=0)
                self._waiting[name], self._sums[name] = bytearray(), (0, 0)
        except OSError as error:
            self._close_files()
            remedy = "choose a directory that can be written"
            if isinstance(error, FileExistsError):
                raise RecordError(f"{error.filename}: is a file, no directory; {remedy}") from error
            raise RecordError(
                f"{error.filename or self.directory}: cannot record here: {error.strerror or error}; {remedy}"
            ) from error

    def begin(self, time_s: float, mark: Mark) -> None:
        """A round in which nothing is heard."""
        self.heard(time_s, [], mark)

    def heard(self, time_s: float, packets: list[bytes], mark: Mark = Mark(0)) -> None:  # noqa: B008 - frozen
        """A new round, and the packets that came in it."""
        self._end_round()
        self._round = Round(time_s, len(packets), 0, mark)
        for raw in packets:
            self._packet(time_s, raw)
        if time_s - self._flushed_s >= FLUSH_S:
            self._flushed_s = time_s
            self._hand_over()

    def said(self, time_s: float, raw: bytes) -> None:
        """One packet of ours."""
        if self._round is not None:
            self._round = self._round._replace(said=self._round.said + 1)
        self._packet(time_s, raw)

    def mark(self, mark: Mark) -> None:
        """Something has come from outside in this round."""
        if self._round is not None:
            self._round = self._round._replace(marks=self._round.marks | mark)

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One line of JSON."""
        self._write(DECISIONS, decision_line(time_s, target, decision).encode() + b"\n")

    def close(self) -> None:
        """Write what is left, and that it is all, but give up on a disk that hangs; more than once is fine."""
        if self._closed:
            return
        self._end_round()
        self._hand_over()
        self._closed = True
        self._do(self._finish)
        if self._beside is not None and not self._beside.close():
            self.problem = self.problem or self._ended(NO_ANSWER)

    def _packet(self, time_s: float, raw: bytes) -> None:
        """Microseconds since 1970, big-endian, then the bytes, as ground stations write it."""
        if self._clock_at_start_s is None:
            self._clock_at_start_s = time_s
        stamp_us = max(0, self._start_us + round((time_s - self._clock_at_start_s) * 1e6))
        self._write(PACKETS, struct.pack(">Q", stamp_us) + raw)

    def _end_round(self) -> None:
        ended, self._round = self._round, None
        if ended is not None:
            self._write(ROUNDS, ended.packed())

    def _write(self, name: str, data: bytes) -> None:
        if self._closed or self.problem:
            return
        self._waiting[name] += data
        size, crc = self._sums[name]
        self._sums[name] = (size + len(data), zlib.crc32(data, crc))

    def _hand_over(self) -> None:
        """What waits goes to the disk; unless too much is on its way already: memory has an end as well."""
        batch = {name: bytes(data) for name, data in self._waiting.items() if data}
        for data in self._waiting.values():
            data.clear()
        size = sum(len(data) for data in batch.values())
        if self._given + size - self._taken > MOST_WAITING_BYTES:
            self.problem = self.problem or self._ended(NO_ANSWER)
        if batch and not self.problem:
            self._given += size
            self._do(partial(self._take, batch))

    def _do(self, job: Job) -> None:
        job() if self._beside is None else self._beside.put(job)

    def _take(self, batch: Mapping[str, bytes]) -> None:
        """Write; after a problem nothing more. Must not raise."""
        try:
            for name, data in batch.items():
                view = memoryview(data)
                while view and not self.problem:
                    view = view[self._files[name].write(view) :]
        except OSError as error:
            self.problem = self._ended(error.strerror or str(error))
        self._taken += sum(len(data) for data in batch.values())

    def _finish(self) -> None:
        """Close the files; say that they are whole, if they are. Must not raise."""
        self._close_files()
        if not self.problem:
            try:
                self._write_meta({name: {"bytes": size, "crc32": crc} for name, (size, crc) in self._sums.items()})
            except OSError as error:
                self.problem = self._ended(error.strerror or str(error))

    def _close_files(self) -> None:
        for file in self._files.values():
            try:
                file.close()
            except OSError as error:
                self.problem = self.problem or self._ended(error.strerror or str(error))

    def _ended(self, reason: str) -> str:
        return f"{self.directory}: the record has ended: {reason}"

    def _write_meta(self, end: dict[str, dict[str, int]] | None) -> None:
        meta = {**self._meta, "end": end}
        write_whole(self.directory / META, json.dumps(meta, indent=2).encode() + b"\n")


def decision_line(time_s: float, target: str, decision: Decision) -> str:
    """A decision as one line of JSON."""
    return json.dumps(
        {
            "time_s": time_s,
            "target": target,
            "action": decision.action.value,
            "part": decision.part.value,
            "reason": decision.reason,
            "searches": [kind.value for kind in decision.searches],
            "proved": decision.proved,
            "new_path": decision.new_path is not None,
            "path": [[cell.x, cell.y] for cell in decision.path],
        }
    )


def settings_sum(settings: Settings) -> str:
    """SHA-256 of all settings."""
    return hashlib.sha256(json.dumps(settings.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()


def run_sum(seed: int, settings_sha256: str, *, arm: bool) -> str:
    """SHA-256 of what a run follows from beside its files."""
    return hashlib.sha256(f"{seed} {arm} {settings_sha256}".encode()).hexdigest()


def unused(directory: Path) -> Path:
    """The directory itself, or with the first number from 2 on that has no record in it yet."""
    candidate, number = directory, 2
    while (candidate / META).exists():
        candidate = directory.with_name(f"{directory.name}-{number}")
        number += 1
    return candidate


def _meta(
    mission: Mission | None, settings: Settings, seed: int, arm: bool, start_us: int, inputs: list[Copied]
) -> dict[str, object]:
    return {
        "format": FORMAT,
        "mission": None if mission is None else mission.name,
        "seed": seed,
        "arm": arm,
        "settings": settings.model_dump(mode="json"),
        "settings_sha256": settings_sum(settings),
        "run_sha256": run_sum(seed, settings_sum(settings), arm=arm),
        "start_unix_us": start_us,
        "versions": versions(),
        "inputs": [entry._asdict() for entry in inputs],
    }
