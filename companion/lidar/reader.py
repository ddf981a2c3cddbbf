"""Reads one lidar or several: what their ports have heard becomes scans, and is logged as it came.

It runs in the tick and reads no clock: the same bytes at the same times give the same scans.

Nouns: lidar reader.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from companion.core.scan import RangeScan
from companion.lidar.device_clock import DeviceClock
from companion.lidar.mounted import believed, cut_deg, scan_of
from companion.lidar.spec import LidarSpec
from companion.lidar.turns import TurnJoiner
from companion.vehicle.events import RangeSeen

WAKE_S = 2.0
"""A lidar that gives no points is told to start this often."""
SAMPLE_BYTES = 2048
"""So much is kept before there is a scan, to tell what it is if none comes."""
BURST_S = 0.03
"""Bytes that come sooner after others may have waited with them: only the last of them are known to be new."""


class Chunk(NamedTuple):
    """Bytes, and when they came by the companion's clock. No bytes: the line was opened anew or bytes were dropped."""

    time_s: float
    data: bytes


class LidarPort(Protocol):
    """Where the bytes of a lidar come from. It never waits; a broken one opens again by itself."""

    def read(self) -> list[Chunk]:
        """What has come since the last call."""
        ...

    def write(self, data: bytes) -> None:
        """Send a command, some time after the one before; dropped while the port is not there."""
        ...

    def close(self) -> None:
        """Stop the lidar and close the port. May be called again."""
        ...


class LidarLog(Protocol):
    """Receives what lidars send, as it came."""

    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """Bytes of the lidar with this number, from 1."""
        ...


class _NoLog:
    def lidar_heard(self, number: int, time_s: float, data: bytes) -> None:
        """Nothing to log."""


@dataclass(frozen=True, slots=True)
class LidarCounters:
    """What was heard of a lidar so far."""

    bytes: int
    bad_bytes: int
    points: int
    echoes: int
    scans: int
    incomplete: int


class LidarReader:
    """Reads one lidar."""

    def __init__(self, spec: LidarSpec, port: LidarPort, number: int) -> None:
        """``number``: from 1, for its name and its record."""
        self.spec = spec
        self.number = number
        self.name = f"lidar {number} ({spec.model.name})"
        self._port = port
        self._bytes = self._bad_bytes = self._points = self._echoes = self._scans = self._incomplete = 0
        self._woken_s: float | None = None
        self.sample = b""
        """The newest bytes, until there is a first scan."""
        self.saw = False
        """Whether a scan had more than a stray reading that is not unknown."""
        self._begin()

    def _begin(self) -> None:
        self._decoder = self.spec.model.decoder()
        self._clock = DeviceClock()
        self._joiner = TurnJoiner(cut_deg(self.spec.mounting), 1.0 / self.spec.model.turns_hz)

    @property
    def counters(self) -> LidarCounters:
        """What was heard so far."""
        return LidarCounters(
            self._bytes, self._bad_bytes + self._decoder.bad_bytes, self._points, self._echoes, self._scans,
            self._incomplete + self._joiner.incomplete,
        )  # fmt: skip

    def poll(self, now_s: float, log: LidarLog) -> list[RangeScan]:
        """The newest scan since the last call, if there is one."""
        chunks = self._port.read()
        for chunk in chunks:
            log.lidar_heard(self.number, chunk.time_s, chunk.data)
        scans = [scan for chunk in in_bursts(chunks) for scan in self._decoded(chunk, now_s)][-1:]
        if self.spec.model.start and now_s - (-math.inf if self._woken_s is None else self._woken_s) >= WAKE_S:
            self._woken_s = now_s
            for command in self.spec.model.start:
                self._port.write(command)
        return scans

    def drop(self) -> None:
        """Forget what has piled up; points begin anew with what comes next."""
        self._port.read()
        self._begin()

    def close(self) -> None:
        """Stop the lidar and close its port."""
        self._port.close()

    def _decoded(self, chunk: Chunk, now_s: float) -> list[RangeScan]:
        if not chunk.data:
            self._bad_bytes += self._decoder.bad_bytes
            self._incomplete += self._joiner.incomplete
            self._woken_s = None
            self._begin()
            return []
        self._bytes += len(chunk.data)
        points = self._decoder.feed(chunk.data)
        self.sample = b"" if self._scans else (self.sample + chunk.data)[-SAMPLE_BYTES:]
        if len(points):
            self._woken_s = now_s
            self._points += len(points)
            self._echoes += int((points.range_m > 0.0).sum())
        late_s = self._clock.late_s(self._decoder.clock_ms, chunk.time_s)
        turns = self._joiner.feed(points, chunk.time_s)
        self._scans += len(turns)
        mounting = self.spec.mounting
        scans = [scan_of(turn, believed(mounting, turn), self.name) for turn in turns]
        self.saw = self.saw or any(scan.tells for scan in scans)
        return [replace(scan, late_s=late_s) for scan in scans]


def in_bursts(chunks: Sequence[Chunk]) -> list[Chunk]:
    """The same bytes, those joined that came at once. The time of a burst is that of its last bytes."""
    bursts: list[Chunk] = []
    for chunk in chunks:
        last = bursts[-1] if bursts else None
        if last is not None and last.data and chunk.data and chunk.time_s - last.time_s <= BURST_S:
            bursts[-1] = Chunk(chunk.time_s, last.data + chunk.data)
        else:
            bursts.append(chunk)
    return bursts


class Lidars:
    """All lidars of a rover that are wired to the companion; there may be none."""

    def __init__(self, readers: Sequence[LidarReader] = (), log: LidarLog | None = None) -> None:
        self.readers = tuple(readers)
        self._log = log or _NoLog()

    @property
    def names(self) -> tuple[str, ...]:
        """Of each, as its scans bear it."""
        return tuple(one.name for one in self.readers)

    def poll(self, now_s: float) -> list[RangeSeen]:
        """The scans since the last call."""
        return [RangeSeen(scan.time_s, scan) for one in self.readers for scan in one.poll(now_s, self._log)]

    def drop(self) -> None:
        """Forget what has piled up."""
        for one in self.readers:
            one.drop()

    def close(self) -> None:
        """Stop all."""
        for one in self.readers:
            one.close()


def lidars_on(specs: Sequence[LidarSpec], ports: Sequence[LidarPort], log: LidarLog | None = None) -> Lidars:
    """Readers of these lidars, numbered from 1."""
    pairs = zip(specs, ports, strict=True)
    return Lidars([LidarReader(spec, port, number) for number, (spec, port) in enumerate(pairs, 1)], log)
