"""Link faults: loss, delay, reordering, duplication, damage and outage of packets between a link and the autopilot.

They act on whole packets, in simulated time. Bytes between packets count as a packet of their own.

Nouns: LinkQueue.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sitl.autopilot.framing import BEGINNING, packet_size
from sitl.faults.plan import Direction, LinkEffect, LinkFault

WORST_BYTES = 3
"""Largest number of wrong bytes in a damaged packet."""

Active = tuple[LinkFault, np.random.Generator]


class Packets:
    """Splits a stream of bytes into packets; an incomplete packet is kept for the next call."""

    def __init__(self) -> None:
        """Begin with an empty stream."""
        self._rest = b""

    def cut(self, data: bytes) -> list[bytes]:
        """The complete packets, and the bytes between them, in order."""
        data, at, pieces = self._rest + data, 0, []
        while at < len(data):
            found = BEGINNING.search(data, at)
            begin = found.start() if found else len(data)
            if begin > at:
                pieces.append(data[at:begin])
            at = begin
            size = packet_size(data, at) if found else None
            if size is None or at + size > len(data):
                break
            pieces.append(data[at : at + size])
            at += size
        self._rest = data[at:]
        return pieces


@dataclass
class LinkQueue:
    """Packets under way in one direction of one link."""

    link: int
    direction: Direction
    packets: Packets = field(default_factory=Packets)
    under_way: list[tuple[float, int, bytes]] = field(default_factory=list)
    sent: int = 0
    last_due_s: float = -math.inf

    def pass_on(self, data: bytes, now_s: float, active: Callable[[LinkFault], bool], faults: list[Active]) -> None:
        """Queue what is sent now, with the effects of the active faults."""
        if not data:
            return
        mine = [(fault, rng) for fault, rng in faults if active(fault) and fault.concerns(self.link, self.direction)]
        for packet in self.packets.cut(data):
            self._send(packet, now_s, mine)

    def _send(self, packet: bytes, now_s: float, faults: list[Active]) -> None:
        copies, lateness_s, overtaken_s = 1, 0.0, 0.0
        for fault, rng in faults:
            hit = bool(rng.random() < fault.probability)
            if fault.effect is LinkEffect.DELAY:
                jitter_s = fault.jitter_s * float(rng.random())
                lateness_s += fault.delay_s + jitter_s if hit else 0.0
            elif not hit:
                continue
            elif fault.effect in (LinkEffect.LOSS, LinkEffect.OUTAGE):
                return
            elif fault.effect is LinkEffect.DUPLICATE:
                copies += 1
            elif fault.effect is LinkEffect.REORDER:
                overtaken_s += fault.delay_s
            else:
                packet = damaged(packet, rng)
        # A slow link keeps the order of packets; only a reordered packet is overtaken by others.
        due_s = self.last_due_s = max(now_s + lateness_s, self.last_due_s)
        for _ in range(copies):
            heapq.heappush(self.under_way, (due_s + overtaken_s, self.sent, packet))
            self.sent += 1

    def arrived(self, now_s: float) -> bytes:
        """The bytes that have arrived by now."""
        pieces = []
        while self.under_way and self.under_way[0][0] <= now_s + 1e-9:
            pieces.append(heapq.heappop(self.under_way)[2])
        return b"".join(pieces)

    def next_due_s(self) -> float:
        """When the next packet arrives; infinity if none is under way."""
        return self.under_way[0][0] if self.under_way else math.inf


def damaged(packet: bytes, rng: np.random.Generator) -> bytes:
    """The packet with some bytes changed."""
    data = bytearray(packet)
    for at in rng.integers(0, len(data), size=int(rng.integers(1, WORST_BYTES + 1))):
        data[at] ^= int(rng.integers(1, 256))
    return bytes(data)
