"""The record of a run: every packet, every decision, and what it was run with."""

from __future__ import annotations

import hashlib
import json
import shutil
import struct
from pathlib import Path
from typing import IO, Protocol

from companion.clock import unix_time_us
from companion.navigator import Decision
from companion.provenance import versions
from companion.settings import Settings

FLUSH_S = 1.0


class RecordError(Exception):
    """A record that cannot be begun; the text is one line with the place, the reason and the remedy."""


class DecisionLog(Protocol):
    """Takes the navigator's decisions."""

    problem: str
    """Why the record has ended early; empty while all is well."""

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One decision on the way to a target; ``time_s`` is the companion's clock."""
        ...


class NullRecorder:
    """Records nothing."""

    problem = ""

    def packet(self, time_s: float, raw: bytes) -> None:
        """Ignored."""

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """Ignored."""

    def close(self) -> None:
        """Nothing to close."""


class Recorder:
    """Writes a directory: ``link.tlog`` (both directions, as ground stations write it), ``decisions.jsonl``, ``meta.json`` and a
    copy of the mission file.

    A directory that has a record keeps it: the new one goes to the same name with a number, see ``directory``. Raises
    RecordError if the directory cannot be written. Later a full disk ends the record, never the run: see ``problem``.
    """

    def __init__(self, directory: Path, mission_file: Path | None, settings: Settings, seed: int) -> None:
        self.directory = unused(directory)
        self._files: list[IO[bytes]] = []
        self._clock_at_start_s: float | None = None
        self._flushed_s = 0.0
        self._start_us = unix_time_us()
        self._meta = _meta(mission_file, settings, seed, self._start_us)
        self.problem = ""
        """Why the record ends early; empty while all is well."""
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            if mission_file is not None:
                shutil.copyfile(mission_file, self.directory / f"mission{mission_file.suffix}")
            self._write_meta()
            self._packets = self._open("link.tlog")
            self._decisions = self._open("decisions.jsonl")
        except OSError as error:
            self.close()
            raise RecordError(
                f"{self.directory}: cannot record here: {error.strerror or error}; choose a directory that can be written"
            ) from error

    def packet(self, time_s: float, raw: bytes) -> None:
        """One packet of either direction: microseconds since 1970, big-endian, then the bytes."""
        self._write(self._packets, struct.pack(">Q", self._unix_us(time_s)) + raw, time_s)

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One line of JSON."""
        entry = {
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
        self._write(self._decisions, json.dumps(entry).encode() + b"\n", time_s)

    def close(self) -> None:
        """Write what is left; more than once is fine."""
        for file in self._files:
            try:
                file.close()
            except OSError as error:
                self.problem = self.problem or self._ended(error)
        self._files = []

    def _open(self, name: str) -> IO[bytes]:
        file = (self.directory / name).open("wb")
        self._files.append(file)
        return file

    def _write(self, file: IO[bytes], data: bytes, time_s: float) -> None:
        if not self._files:
            return
        try:
            if self._clock_at_start_s is None:
                self._clock_at_start_s = self._flushed_s = time_s
                self._write_meta()
            file.write(data)
            if time_s - self._flushed_s >= FLUSH_S:
                self._flushed_s = time_s
                for each in self._files:
                    each.flush()
        except OSError as error:
            self.problem = self._ended(error)
            self.close()

    def _ended(self, error: OSError) -> str:
        return f"{self.directory}: the record has ended: {error.strerror or error}"

    def _unix_us(self, time_s: float) -> int:
        first_s = time_s if self._clock_at_start_s is None else self._clock_at_start_s
        return max(0, self._start_us + round((time_s - first_s) * 1e6))

    def _write_meta(self) -> None:
        meta = {**self._meta, "clock_at_start_s": self._clock_at_start_s}
        (self.directory / "meta.json").write_text(json.dumps(meta, indent=2) + "\n", encoding="utf-8")


def unused(directory: Path) -> Path:
    """The directory itself, or with the first number from 2 on that has no record in it yet."""
    candidate, number = directory, 2
    while (candidate / "meta.json").exists():
        candidate = directory.with_name(f"{directory.name}-{number}")
        number += 1
    return candidate


def _meta(mission_file: Path | None, settings: Settings, seed: int, start_us: int) -> dict[str, object]:
    values = settings.model_dump(mode="json")
    canonical = json.dumps(values, sort_keys=True).encode()
    return {
        "mission": None if mission_file is None else str(mission_file),
        "seed": seed,
        "settings": values,
        "settings_sha256": hashlib.sha256(canonical).hexdigest(),
        "start_unix_us": start_us,
        "versions": versions(),
    }
