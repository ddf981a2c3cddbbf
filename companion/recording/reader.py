"""A record read back: checked against what was meant to be in it, and as much of it as there is."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError

from companion.mavlink.framing import first_packet
from companion.mission.as_json import from_json
from companion.mission.mission import Mission, MissionError
from companion.recording.recorded_files import RecordError
from companion.recording.recorder import DECISIONS, FORMAT, META, MISSION, PACKETS, ROUNDS, STATE, run_sum, settings_sum
from companion.recording.rounds import Round, unpacked
from companion.settings import Settings, SettingsError, parse_settings
from companion.settings.versions import versions
from companion.storage.reading import open_file, read_at_most

MAX_META_BYTES = 10_000_000
MAX_BYTES = 200_000_000
"""Of the rounds or the decisions: more than a day of driving."""
STAMP_BYTES = 8
LONGEST_PACKET = 280
CHUNK = 1 << 20


class Length(BaseModel):
    """What a file had come to when the record was closed."""

    bytes: int
    crc32: int


class Entry(BaseModel):
    """A file that was copied."""

    kind: str
    name: str
    source: str
    sha256: str


class Meta(BaseModel):
    """``meta.json`` as far as a replay needs it."""

    model_config = ConfigDict(extra="ignore")

    format: int
    seed: int
    arm: bool
    settings: dict[str, object]
    settings_sha256: str
    run_sha256: str
    versions: dict[str, str]
    inputs: list[Entry]
    end: dict[str, Length] | None


class Heard(NamedTuple):
    """A round with its bytes."""

    round: Round
    heard: list[bytes]
    said: list[bytes]


@dataclass(frozen=True, eq=False, slots=True)
class Record:
    """A record that can be replayed. ``notes``: what people should know of it, a line each; ``whole``: it was closed in good order."""

    directory: Path
    meta: Meta
    mission: Mission
    settings: Settings
    decisions: list[str]
    whole: bool
    notes: list[str]

    def input(self, kind: str) -> Path | None:
        """The copy of a further file that the run followed from."""
        return next((self.directory / entry.name for entry in self.meta.inputs if entry.kind == kind), None)

    def rounds(self) -> Iterator[Heard]:
        """Round by round, as far as there are both the round and its packets. Raises RecordError when packets are damaged."""
        rounds, _ = unpacked(read_at_most(self.directory / ROUNDS, MAX_BYTES))
        with open_file(self.directory / PACKETS) as file:
            for number, entry in enumerate(rounds):
                packets = list(_packets(file, entry.heard + entry.said, self.directory / PACKETS))
                if len(packets) < entry.heard + entry.said:
                    self.notes.append(_cut(self.directory / PACKETS, entry.time_s - rounds[0].time_s, number))
                    return
                yield Heard(entry, packets[: entry.heard], packets[entry.heard :])


def load_record(directory: Path) -> Record:
    """Read and check a record. Raises RecordError: one line with the place, the reason and the remedy."""
    meta = _meta(directory)
    notes = [f"{directory}: recorded with {line}; differences may come from that" for line in _other_versions(meta)]
    for entry in meta.inputs:
        _check_input(directory, entry)
        if entry.name not in (MISSION, STATE) and _is_other(Path(entry.source), entry.sha256):
            notes.append(f"{entry.source}: changed since the run; its copy in the record is used")
    try:
        mission = from_json(read_at_most(directory / MISSION, MAX_META_BYTES), str(directory / MISSION))
        settings = parse_settings(dict(meta.settings), str(directory / META))
        if settings_sum(settings) != meta.settings_sha256:
            raise RecordError(f"{directory / META}: settings changed since the run; a replay needs them as they were")
        if run_sum(meta.seed, meta.settings_sha256, arm=meta.arm) != meta.run_sha256:
            raise RecordError(
                f"{directory / META}: seed or arm changed since the run; a replay needs them as they were"
            )
    except OSError as error:
        raise RecordError(
            f"{directory / MISSION}: cannot be read: {error.strerror}; there is nothing to replay"
        ) from error
    except (MissionError, SettingsError) as error:
        raise RecordError(str(error)) from error
    if mission.prior_map is not None:
        mission = replace(mission, prior_map=directory / mission.prior_map)
    cut = [line for name in (PACKETS, ROUNDS, DECISIONS) if (line := _check_length(directory / name, meta))]
    if meta.end is None:
        cut = [
            f"{directory}: the record was not closed (killed, power lost or the disk full); what there is of it is replayed"
        ]
    rounds_file = directory / ROUNDS
    data = _whole(rounds_file)
    rounds, length = unpacked(data)
    if not rounds:
        raise RecordError(f"{rounds_file}: holds no rounds; there is nothing to replay")
    if len(data) - length >= len(rounds[0].packed()):
        raise RecordError(f"{rounds_file}: damaged at byte {length}; take the record from a copy that is whole")
    decisions = _whole(directory / DECISIONS).decode(errors="replace").split("\n")[:-1]
    return Record(directory, meta, mission, settings, decisions, not cut, notes + cut)


def _meta(directory: Path) -> Meta:
    file = directory / META
    try:
        with open_file(file) as opened:
            data = opened.read(MAX_META_BYTES + 1)
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
    if found != FORMAT:
        raise RecordError(
            f"{file}: a record of format {found!r:.20}, this program replays format {FORMAT}; use the version it was made with"
        )
    try:
        return Meta.model_validate(values)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in fault["loc"])
        raise RecordError(f"{file}: damaged: {place}: {fault['msg'].lower()}; nothing can be replayed") from error


def _other_versions(meta: Meta) -> list[str]:
    now = versions()
    return [f"{name} {was}, this is {now[name]}" for name, was in meta.versions.items() if now.get(name, was) != was]


def _check_input(directory: Path, entry: Entry) -> None:
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


def _whole(file: Path) -> bytes:
    try:
        return read_at_most(file, MAX_BYTES)
    except OSError as error:
        raise RecordError(f"{file}: cannot be read: {error.strerror}; there is nothing to replay") from error


def _sha256(file: Path) -> str:
    with open_file(file) as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def _is_other(source: Path, sha256: str) -> bool:
    """Whether the file is still where it was, with another content."""
    try:
        return _sha256(source) != sha256
    except OSError:
        return False


def _check_length(file: Path, meta: Meta) -> str:
    """A line if the file is shorter than it was. Raises RecordError if it is missing or what there is has been changed."""
    meant = (meta.end or {}).get(file.name)
    crc = 0
    try:
        with open_file(file) as opened:
            size = os.fstat(opened.fileno()).st_size
            while meant is not None and size == meant.bytes and (data := opened.read(CHUNK)):
                crc = zlib.crc32(data, crc)
    except OSError as error:
        raise RecordError(f"{file}: cannot be read: {error.strerror}; there is nothing to replay") from error
    if meant is None:
        return ""
    if size < meant.bytes:
        return f"{file}: cut, {size} of {meant.bytes} bytes; what there is is replayed"
    if size > meant.bytes or crc != meant.crc32:
        raise RecordError(f"{file}: damaged or changed since the run; take the record from a copy that is whole")
    return ""


def _packets(file: IO[bytes], count: int, name: Path) -> Iterator[bytes]:
    """The next packets; fewer where the file ends."""
    for _ in range(count):
        at = file.tell()
        raw = file.read(STAMP_BYTES + LONGEST_PACKET)[STAMP_BYTES:]
        packet = first_packet(raw)
        if packet is None:
            if len(raw) < LONGEST_PACKET:
                return
            raise RecordError(f"{name}: damaged at byte {at}; take the record from a copy that is whole")
        file.seek(at + STAMP_BYTES + len(packet))
        yield packet


def _cut(file: Path, after_s: float, rounds: int) -> str:
    return f"{file}: ends after {after_s:.2f} s ({rounds} rounds)"
