"""Reads a record back: checks it against its check sums, and yields as many ticks as there are.

Nouns: record.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, NamedTuple

from pydantic import ValidationError

from companion.core.tick_marks import Mark
from companion.mavlink.framing import first_packet
from companion.mission.mission import Mission, MissionError
from companion.mission.serialization import from_json
from companion.recording.record_format import (
    CHECKED_TICK,
    DECISIONS,
    FORMAT,
    LIDAR_HEAD,
    LIDARS,
    META,
    MISSION,
    PACKETS,
    STAMP,
    STATE,
    TICKS,
    WITH_LIDARS,
    InputFile,
    LidarEntry,
    RecordError,
    RecordMeta,
    TickEntry,
    run_sum,
    settings_sum,
    unpacked_ticks,
)
from companion.settings import Settings, SettingsError, parse_settings
from companion.settings.versions import versions
from companion.storage.files import open_file, read_at_most
from companion.storage.validation import first_fault

MAX_META_BYTES = 10_000_000
MAX_BYTES = 200_000_000
"""Of the ticks or the decisions: more than a day of driving."""
MAX_PACKET_BYTES = 280
MAX_LIDAR_BYTES = 1 << 20
CHUNK_BYTES = 1 << 20


class RecordedTick(NamedTuple):
    """A tick with its packets, and with what lidars sent."""

    entry: TickEntry
    heard: list[bytes]
    said: list[bytes]
    lidars: tuple[LidarEntry, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Record:
    """A record that can be replayed. ``complete``: nothing is missing at its end; ``notes``: lines for people."""

    directory: Path
    meta: RecordMeta
    mission: Mission
    settings: Settings
    decisions: list[str]
    complete: bool
    notes: list[str]

    def input(self, kind: str) -> Path | None:
        """The copy of a further file that the run depended on."""
        return next((self.directory / entry.name for entry in self.meta.inputs if entry.kind == kind), None)

    def ticks(self) -> Iterator[RecordedTick]:
        """The ticks in order, as far as both the tick and its packets are there.

        Raises RecordError if packets are damaged. If packets are missing at the end, that is added to ``notes``.
        """
        ticks, _ = unpacked_ticks(read_at_most(self.directory / TICKS, MAX_BYTES))
        lidars = _Lidars(self.directory / LIDARS, given=bool(self.meta.lidars))
        with open_file(self.directory / PACKETS) as file, lidars:
            for number, entry in enumerate(ticks):
                packets = list(_packets(file, entry.heard + entry.said, self.directory / PACKETS))
                sent = lidars.of_tick(number)
                cut = PACKETS if len(packets) < entry.heard + entry.said else ""
                if not sent and entry.marks & Mark.LIDAR:
                    cut = LIDARS
                if cut:
                    after_s = entry.time_s - ticks[0].time_s
                    self.notes.append(
                        f"{self.directory / cut}: ends after {after_s:.2f} s ({number} tick{'s' * (number != 1)})"
                    )
                    return
                yield RecordedTick(entry, packets[: entry.heard], packets[entry.heard :], sent)


def files_of(record: Record) -> list[Path]:
    """The files that make up a record; whoever writes over one has lost it."""
    names = (META, *_logs(record.meta), *(entry.name for entry in record.meta.inputs))
    return [record.directory / name for name in names]


def load_record(directory: Path) -> Record:
    """Read and check a record. Raises RecordError: one line with the place, the reason and the remedy."""
    meta = _meta(directory)
    notes = [f"{directory}: recorded with {line}; differences may come from that" for line in _other_versions(meta)]
    for entry in meta.inputs:
        _check_input(directory, entry)
        # A resumed run goes on writing the state that it began with: that this has changed says nothing.
        if entry.name != MISSION and entry.kind != STATE and _has_changed(Path(entry.source), entry.sha256):
            notes.append(f"{entry.source}: changed since the run; its copy in the record is used")
    mission, settings = _mission_and_settings(directory, meta)
    cut = [line for name in _logs(meta) if (line := _check_length(directory / name, meta))]
    if meta.end is None:
        reason = "killed, power lost, the disk full, or the run still goes on"
        cut = [f"{directory}: the record was not closed ({reason}); what there is of it is replayed"]
    _check_ticks(directory / TICKS)
    decisions = _content(directory / DECISIONS).decode(errors="replace").split("\n")[:-1]
    return Record(directory, meta, mission, settings, decisions, not cut, notes + cut)


def _meta(directory: Path) -> RecordMeta:
    file = directory / META
    try:
        with open_file(file) as opened:
            data = opened.read(MAX_META_BYTES + 1)
    except NotADirectoryError as error:
        raise RecordError(f"{directory}: is no directory; give the directory of a record") from error
    except FileNotFoundError as error:
        what = f"is no record ({META} is missing)" if directory.is_dir() else "no such directory"
        raise RecordError(f"{directory}: {what}; give the directory of a record") from error
    except OSError as error:
        raise RecordError(f"{file}: cannot be read: {error.strerror}; give the directory of a record") from error
    try:
        values = json.loads(data) if len(data) <= MAX_META_BYTES else None
    except (ValueError, RecursionError) as error:
        raise RecordError(
            f"{file}: damaged, not JSON ({' '.join(str(error).split())}); nothing can be replayed"
        ) from error
    if not isinstance(values, dict):
        raise RecordError(f"{file}: damaged, not what a run writes there; take the record from a copy that is whole")
    found = values.get("format", 1)
    if found not in (FORMAT, WITH_LIDARS):
        raise RecordError(
            f"{file}: a record of format {found!r:.20}, this program replays formats {FORMAT} and {WITH_LIDARS}; "
            "use the version it was made with"
        )
    try:
        return RecordMeta.model_validate(values)
    except ValidationError as error:
        place, reason = first_fault(error)
        raise RecordError(f"{file}: damaged: {place}: {reason}; nothing can be replayed") from error


def _mission_and_settings(directory: Path, meta: RecordMeta) -> tuple[Mission, Settings]:
    try:
        mission = from_json(read_at_most(directory / MISSION, MAX_META_BYTES), str(directory / MISSION))
        settings = parse_settings(dict(meta.settings), str(directory / META))
    except OSError as error:
        raise _unreadable(directory / MISSION, error) from error
    except (MissionError, SettingsError) as error:
        raise RecordError(str(error)) from error
    if settings_sum(meta.settings) != meta.settings_sha256:
        raise RecordError(f"{directory / META}: settings changed since the run; a replay needs them as they were")
    if run_sum(meta.seed, meta.settings_sha256, meta.lidars, arm=meta.arm) != meta.run_sha256:
        what = "seed, arm or lidars changed since the run"
        raise RecordError(f"{directory / META}: {what}; a replay needs them as they were")
    if mission.prior_map is not None:
        mission = replace(mission, prior_map=directory / mission.prior_map)
    return mission, settings


def _logs(meta: RecordMeta) -> tuple[str, ...]:
    """The files that grew while the run went on."""
    return (*((LIDARS,) if meta.lidars else ()), PACKETS, TICKS, DECISIONS)


def _check_ticks(file: Path) -> None:
    """Raises RecordError if there are no ticks, or if one before the last is damaged."""
    data = _content(file)
    ticks, length = unpacked_ticks(data)
    if not ticks:
        raise RecordError(f"{file}: holds no ticks; there is nothing to replay")
    if len(data) - length >= CHECKED_TICK.size:
        raise RecordError(f"{file}: damaged at byte {length}; take the record from a copy that is whole")


def _other_versions(meta: RecordMeta) -> list[str]:
    now = versions()
    return [f"{name} {was}, this is {now[name]}" for name, was in meta.versions.items() if now.get(name, was) != was]


def _check_input(directory: Path, entry: InputFile) -> None:
    if not entry.name.isprintable():
        raise RecordError(f"{directory / META}: damaged: {entry.name!r:.100} is no name of a file")
    file = directory / entry.name
    if not file.resolve().is_relative_to(directory.resolve()):
        raise RecordError(f"{directory / META}: damaged: {entry.name!r:.100} lies outside the record")
    try:
        found = _sha256(file)
    except OSError as error:
        raise RecordError(f"{file}: cannot be read: {error.strerror}; the run cannot be replayed without it") from error
    if found != entry.sha256:
        raise RecordError(
            f"{file}: changed since the run; a replay needs it as it was (SHA-256 {entry.sha256[:12]}...)"
        )


def _content(file: Path) -> bytes:
    try:
        return read_at_most(file, MAX_BYTES)
    except OSError as error:
        raise _unreadable(file, error) from error


def _unreadable(file: Path, error: OSError) -> RecordError:
    return RecordError(f"{file}: cannot be read: {error.strerror}; there is nothing to replay")


def _sha256(file: Path) -> str:
    with open_file(file) as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def _has_changed(source: Path, sha256: str) -> bool:
    """Whether the file still exists with another content."""
    try:
        return _sha256(source) != sha256
    except OSError:
        return False


def _check_length(file: Path, meta: RecordMeta) -> str:
    """A line if the file is shorter than it was, else empty. Raises RecordError if it is missing or was changed."""
    expected = (meta.end or {}).get(file.name)
    crc = 0
    try:
        with open_file(file) as opened:
            size = os.fstat(opened.fileno()).st_size
            while expected is not None and size == expected.bytes and (data := opened.read(CHUNK_BYTES)):
                crc = zlib.crc32(data, crc)
    except OSError as error:
        raise _unreadable(file, error) from error
    if expected is None:
        return ""
    if size < expected.bytes:
        return f"{file}: cut, {size} of {expected.bytes} bytes; what there is is replayed"
    if size > expected.bytes or crc != expected.crc32:
        raise RecordError(f"{file}: damaged or changed since the run; take the record from a copy that is whole")
    return ""


def _packets(file: IO[bytes], count: int, name: Path) -> Iterator[bytes]:
    """The next packets; fewer if the file ends before. Raises RecordError if it is damaged."""
    for _ in range(count):
        at = file.tell()
        raw = file.read(STAMP.size + MAX_PACKET_BYTES)[STAMP.size :]
        packet = first_packet(raw)
        if packet is None:
            if len(raw) < MAX_PACKET_BYTES:
                return
            raise RecordError(f"{name}: damaged at byte {at}; take the record from a copy that is whole")
        file.seek(at + STAMP.size + len(packet))
        yield packet


class _Lidars:
    """What lidars sent, tick by tick."""

    def __init__(self, file: Path, *, given: bool) -> None:
        self._name = file
        self._file = open_file(file) if given else None
        self._next = self._read()

    def __enter__(self) -> _Lidars:
        """The file is open already."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def of_tick(self, number: int) -> tuple[LidarEntry, ...]:
        """What was read in this tick. Raises RecordError if it is damaged."""
        found: list[LidarEntry] = []
        while self._next is not None and self._next.tick <= number:
            found.append(self._next)
            self._next = self._read()
        return tuple(found)

    def _read(self) -> LidarEntry | None:
        """The next entry; None at the end. Raises RecordError."""
        if self._file is None:
            return None
        at = self._file.tell()
        head = self._file.read(LIDAR_HEAD.size)
        if len(head) < LIDAR_HEAD.size:
            return None
        tick, time_s, number, count, crc = LIDAR_HEAD.unpack(head)
        data = self._file.read(min(count, MAX_LIDAR_BYTES))
        if zlib.crc32(data) != crc:
            if self._file.read(1) or count > MAX_LIDAR_BYTES:
                raise RecordError(f"{self._name}: damaged at byte {at}; take the record from a copy that is whole")
            return None
        return LidarEntry(tick, time_s, number, data)
