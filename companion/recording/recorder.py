"""Writes the record of a run: packets, ticks, decisions, and copies of the input files (docs/record.md).

Nouns: recorder.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import IO, Protocol

from companion.core.clock import unix_time_us
from companion.core.tick_marks import Mark
from companion.mission.mission import Mission
from companion.mission.serialization import to_json
from companion.mission.source_files import source_files
from companion.navigation.field_step import Decision
from companion.recording.record_format import (
    DECISIONS,
    FORMAT,
    INPUTS,
    LIDARS,
    META,
    MISSION,
    PACKETS,
    STAMP,
    TICKS,
    WITH_LIDARS,
    FileLength,
    InputFile,
    LidarEntry,
    RecordError,
    RecordMeta,
    TickEntry,
    decision_line,
    packed_lidar,
    packed_tick,
    run_sum,
    settings_sum,
)
from companion.safety.reasons import EndReason
from companion.settings import Settings
from companion.settings.versions import versions
from companion.storage.background_writer import BackgroundWorker, Job
from companion.storage.files import open_file, refuse_pipe, write_whole

FLUSH_INTERVAL_S = 1.0
MAX_UNWRITTEN_BYTES = 20_000_000
"""The limit for a disk that does not answer: an hour of driving."""
NO_ANSWER = "the disk does not answer"


class RunLog(Protocol):
    """What the companion records beside packets: decisions, and marks of ticks."""

    problem: str
    """Why the record has ended early; empty while it is complete."""

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """A decision of the navigator on the way to a target; ``time_s`` is the companion's clock."""
        ...

    def begin(self, time_s: float, mark: Mark) -> None:
        """A tick in which nothing is heard: the companion was made, or shuts down after an error."""
        ...

    def mark(self, mark: Mark) -> None:
        """Something happened in this tick that does not follow from bytes."""
        ...


class NullRecorder:
    """Records nothing."""

    problem = ""

    def heard(self, time_s: float, packets: list[bytes], mark: Mark = Mark(0)) -> None:  # noqa: B008 - frozen
        """Ignored."""

    def said(self, time_s: float, raw: bytes) -> None:
        """Ignored."""

    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """Ignored."""

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """Ignored."""

    def begin(self, time_s: float, mark: Mark) -> None:
        """Ignored."""

    def mark(self, mark: Mark) -> None:
        """Ignored."""

    def close(self, *, ended_by: EndReason | None = None) -> None:
        """Nothing to close."""


class Recorder:
    """Writes the directory that docs/record.md describes.

    A directory that already has a record keeps it: the new one goes to the same name with a number, see ``directory``.
    Data is written once a second; with ``worker`` by a thread, which ``close`` ends, so that no tick waits for the
    disk. A full disk ends the record, never the run: see ``problem``.
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
        worker: BackgroundWorker | None = None,
        lidars: Sequence[str] = (),
    ) -> None:
        """``files``: further input files by kind; they are copied. None: there is no file of that kind.

        ``start_us``: the start in microseconds since 1970, by default when the first tick begins. ``lidars``: those on
        the companion's own ports, as they were given. Raises RecordError if the directory cannot be written.
        """
        self.directory = unused(directory)
        self.problem = ""
        """Why the record ends early; empty while it is complete."""
        self._files: dict[str, IO[bytes]] = {}
        self._waiting: dict[str, bytearray] = {}
        self._sums: dict[str, tuple[int, int]] = {}
        self._given_bytes = self._written_bytes = 0
        self._closed = False
        self._worker = worker
        self._clock_at_start_s: float | None = None
        self._start_given = start_us is not None
        self._flushed_s = 0.0
        self._tick: TickEntry | None = None
        self._ticks = 0
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            inputs = _copied_inputs(self.directory, mission, files or {})
            if mission is not None:
                inputs.append(_written_mission(self.directory, mission, inputs))
            values = settings.model_dump(mode="json")
            self._meta = RecordMeta(
                format=WITH_LIDARS if lidars else FORMAT,
                mission=None if mission is None else mission.name,
                seed=seed,
                arm=arm,
                settings=values,
                settings_sha256=settings_sum(values),
                run_sha256=run_sum(seed, settings_sum(values), lidars, arm=arm),
                lidars=list(lidars),
                start_unix_us=unix_time_us() if start_us is None else start_us,
                versions=versions(),
                inputs=inputs,
                end=None,
            )
            self._write_meta()
            for name in (*([LIDARS] if lidars else []), PACKETS, TICKS, DECISIONS):  # before the ticks that need them
                refuse_pipe(self.directory / name)
                self._files[name] = (self.directory / name).open("wb", buffering=0)
                self._waiting[name], self._sums[name] = bytearray(), (0, 0)
        except OSError as error:
            self._close_files()
            remedy = "choose a directory that can be written"
            if isinstance(error, FileExistsError):
                raise RecordError(f"{error.filename}: is a file, no directory; {remedy}") from error
            place, reason = error.filename or self.directory, error.strerror or error
            raise RecordError(f"{place}: cannot record here: {reason}; {remedy}") from error

    def begin(self, time_s: float, mark: Mark) -> None:
        """A tick in which nothing is heard."""
        self.heard(time_s, [], mark)

    def heard(self, time_s: float, packets: list[bytes], mark: Mark = Mark(0)) -> None:  # noqa: B008 - frozen
        """A new tick, and the packets that were heard in it."""
        self._end_tick()
        if self._clock_at_start_s is None and not self._start_given:
            # Time of day and the companion's clock at one moment: the planner may have been loaded since it was made.
            self._clock_at_start_s, self._meta.start_unix_us = time_s, unix_time_us()
        self._tick = TickEntry(time_s, len(packets), 0, mark)
        for raw in packets:
            self._packet(time_s, raw)
        if time_s - self._flushed_s >= FLUSH_INTERVAL_S:
            self._flushed_s = time_s
            self._hand_over()

    def said(self, time_s: float, raw: bytes) -> None:
        """One packet that the companion sent."""
        if self._tick is not None:
            self._tick = self._tick._replace(said=self._tick.said + 1)
        self._packet(time_s, raw)

    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """Bytes of a lidar on a port of the companion's own, in this tick; no bytes: its line was opened anew."""
        self.mark(Mark.LIDAR)
        self._write(LIDARS, packed_lidar(LidarEntry(self._ticks, time_s, number, data)))

    def mark(self, mark: Mark) -> None:
        """Something happened in this tick that does not follow from bytes."""
        if self._tick is not None:
            self._tick = self._tick._replace(marks=self._tick.marks | mark)

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One line of JSON."""
        self._write(DECISIONS, decision_line(time_s, target, decision).encode() + b"\n")

    def close(self, *, ended_by: EndReason | None = None) -> None:
        """Write what is left, and mark the record complete. Gives up on a disk that hangs. May be called again.

        ``ended_by``: why, of a simulated drive, which may be broken off before the companion can end it, and of a run
        that a signal has stopped.
        """
        if self._closed:
            return
        self._meta.ended_by = "" if ended_by is None else ended_by.name
        self._end_tick()
        self._hand_over()
        self._closed = True
        self._do(self._finish)
        if self._worker is not None and not self._worker.close():
            self.problem = self.problem or self._ended(NO_ANSWER)

    def _packet(self, time_s: float, raw: bytes) -> None:
        """A time stamp and the bytes."""
        if self._clock_at_start_s is None:
            self._clock_at_start_s = time_s
        stamp_us = max(0, self._meta.start_unix_us + round((time_s - self._clock_at_start_s) * 1e6))
        self._write(PACKETS, STAMP.pack(stamp_us) + raw)

    def _end_tick(self) -> None:
        ended, self._tick = self._tick, None
        if ended is not None:
            self._write(TICKS, packed_tick(ended))
            self._ticks += 1

    def _write(self, name: str, data: bytes) -> None:
        if self._closed or self.problem:
            return
        self._waiting[name] += data
        size, crc = self._sums[name]
        self._sums[name] = (size + len(data), zlib.crc32(data, crc))

    def _hand_over(self) -> None:
        """Give the waiting data to the disk, or end the record if too much is unwritten: memory is limited."""
        batch = {name: bytes(data) for name, data in self._waiting.items() if data}
        for data in self._waiting.values():
            data.clear()
        size = sum(len(data) for data in batch.values())
        if self._given_bytes + size - self._written_bytes > MAX_UNWRITTEN_BYTES:
            self.problem = self.problem or self._ended(NO_ANSWER)
        if batch and not self.problem:
            self._given_bytes += size
            self._do(partial(self._write_batch, batch))

    def _do(self, job: Job) -> None:
        job() if self._worker is None else self._worker.put(job)

    def _write_batch(self, batch: Mapping[str, bytes]) -> None:
        """Write, unless there has been a problem. Must not raise."""
        try:
            for name, data in batch.items():
                view = memoryview(data)
                while view and not self.problem:
                    view = view[self._files[name].write(view) :]
        except OSError as error:
            self.problem = self._ended(error.strerror or str(error))
        self._written_bytes += sum(len(data) for data in batch.values())

    def _finish(self) -> None:
        """Close the files, and note their lengths if they are complete. Must not raise."""
        self._close_files()
        if not self.problem:
            try:
                self._meta.end = {name: FileLength(bytes=size, crc32=crc) for name, (size, crc) in self._sums.items()}
                self._write_meta()
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

    def _write_meta(self) -> None:
        write_whole(self.directory / META, json.dumps(self._meta.model_dump(), indent=2).encode() + b"\n")


def unused(directory: Path) -> Path:
    """The directory itself, or its name with the first number from 2 on that has no record yet."""
    candidate, number = directory, 2
    while os.path.exists(candidate / META):  # a folder that may not be entered is told when it is written
        candidate = directory.with_name(f"{directory.name}-{number}")
        number += 1
    return candidate


def _written_mission(directory: Path, mission: Mission, inputs: list[InputFile]) -> InputFile:
    """Write the mission as it was understood, with the known map's name in the record."""
    prior_map = mission.prior_map
    if prior_map is not None:
        copy = next((entry.name for entry in inputs if entry.source == str(prior_map)), str(prior_map))
        mission = replace(mission, prior_map=Path(copy))
    text = to_json(mission).encode()
    write_whole(directory / MISSION, text)
    return InputFile(
        kind="mission", name=MISSION, source=str(mission.source or ""), sha256=hashlib.sha256(text).hexdigest()
    )


def _copied_inputs(directory: Path, mission: Mission | None, files: Mapping[str, Path | None]) -> list[InputFile]:
    """Copy the files of a mission in their folders, and the others by their kind. Raises OSError."""
    entries: list[InputFile] = []
    mission_files = () if mission is None else source_files(mission)
    folders = [os.path.dirname(os.path.abspath(path)) for path in mission_files]
    common = os.path.commonpath(folders) if folders else ""
    for path in mission_files:
        place = Path(INPUTS, "mission", os.path.relpath(path, common))
        entries.append(_copy(directory, "mission file", place, path))
    for kind, given in files.items():
        if given is not None:
            entries.append(_copy(directory, kind, Path(INPUTS, kind, given.name), given))
    return entries


def _copy(directory: Path, kind: str, place: Path, path: Path) -> InputFile:
    with open_file(path) as file:
        data = file.read()
    (directory / place).parent.mkdir(parents=True, exist_ok=True)
    refuse_pipe(directory / place)
    (directory / place).write_bytes(data)
    return InputFile(kind=kind, name=place.as_posix(), source=str(path), sha256=hashlib.sha256(data).hexdigest())
