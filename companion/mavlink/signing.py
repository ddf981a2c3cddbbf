"""Message signing (MAVLink guide, "Message Signing"): signs packets with a key and a timestamp, and verifies them.

Nouns: message signing.
"""

from __future__ import annotations

import hashlib
import hmac
import math
import stat
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.clock import unix_time_us
from companion.core.tick_marks import Mark
from companion.mavlink.framing import CHECKSUM, MAGIC_V2, SIGNATURE, SIGNED, Packet
from companion.storage.files import open_file

TICKS_PER_S = 100_000
"""Signing timestamps count units of 10 microseconds since the beginning of 2015 (UTC)."""
EPOCH_UNIX_S = 1_420_070_400
MINUTE = 60 * TICKS_PER_S
"""The first packet of a sender may be this late."""
LAST_TICK = (1 << 48) - 1
AHEAD = 60 * TICKS_PER_S
"""The saved timestamp is this far ahead of the used one,"""
AGAIN = 30 * TICKS_PER_S
"""and is saved again when less than this is left: every half minute."""
MOST_STREAMS = 64
HEX_DIGITS = 64
LONGEST_KEY = 1024
ACCEPTED_UNSIGNED = frozenset({mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_RADIO})
"""Status of radios, which have no key; as in ArduPilot. The companion does not use them."""


class SigningKeyError(Exception):
    """A key file that cannot be used; the text is one line with file, reason and remedy."""


def load_key(path: Path) -> bytes:
    """The 32 bytes of a key file: 64 hexadecimal digits, or else the SHA-256 of a passphrase.

    MAVProxy and Mission Planner derive the key of a passphrase likewise. Raises SigningKeyError, also if others may
    read the file.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise SigningKeyError(f"{path}: not a file; name a file with the passphrase or 64 hexadecimal digits")
        if mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise SigningKeyError(f"{path}: others may use this file (mode {stat.S_IMODE(mode):04o}); chmod 600 {path}")
        with open_file(path) as file:
            data = file.read(LONGEST_KEY + 1)
    except OSError as error:
        raise SigningKeyError(
            f"{path}: cannot be read: {error.strerror or error}; "
            "name a file with the passphrase or 64 hexadecimal digits"
        ) from error
    try:
        text = data.decode().removesuffix("\n").removesuffix("\r")
    except UnicodeDecodeError as error:
        raise SigningKeyError(f"{path}: not text; 32 bytes are written as 64 hexadecimal digits") from error
    if not text or "\n" in text or len(data) > LONGEST_KEY:
        raise SigningKeyError(f"{path}: one line is wanted: a passphrase, or 64 hexadecimal digits")
    if len(text) != HEX_DIGITS or any(digit not in "0123456789abcdefABCDEF" for digit in text):
        return hashlib.sha256(text.encode()).digest()
    key = bytes.fromhex(text)
    if not any(key):
        raise SigningKeyError(f"{path}: a key of zeros means no signing; choose another one")
    return key


def without_signature(raw: bytes) -> bytes:
    """Header and payload of a packet as if it were not signed (its checksum includes the header's flag)."""
    if raw[0] != MAGIC_V2:
        return raw
    end = len(raw) - CHECKSUM - (SIGNATURE if raw[2] & SIGNED else 0)
    return raw[:2] + bytes([raw[2] & ~SIGNED]) + raw[3:end]


def ticks_now() -> int:
    """The computer's clock as a signing timestamp; it may be wrong."""
    return max(0, unix_time_us() - EPOCH_UNIX_S * 1_000_000) // 10


class SavedTime(Protocol):
    """Keeps a timestamp beyond the program's end."""

    @property
    def saved(self) -> float:
        """The newest timestamp that is on disk; inf if none is to be kept."""
        ...

    def save(self, timestamp: int) -> None:
        """Save this one; returns at once, ``saved`` follows."""
        ...


class NotSaved:
    """Keeps nothing: for callers that rely on the computer's clock."""

    saved = math.inf

    def save(self, timestamp: int) -> None:
        """Nothing to do."""


class PacketRefusal(StrEnum):
    """Why a packet is refused."""

    UNSIGNED = "unsigned"
    WRONG = "signed with another key"
    OLD = "signed too long ago"


@dataclass(slots=True)
class Refused:
    """The number of refused packets, by reason."""

    unsigned: int = 0
    wrong: int = 0
    old: int = 0

    def __str__(self) -> str:
        """In words; empty for none."""
        named = (
            (self.unsigned, "unsigned"),
            (self.wrong, "signed with another key"),
            (self.old, "signed too long ago"),
        )
        counts = [f"{count} {what}" for count, what in named if count]
        return f"packets refused: {', '.join(counts)}" if counts else ""

    def count(self, why: PacketRefusal) -> None:
        """Count one more."""
        self.unsigned += why is PacketRefusal.UNSIGNED
        self.wrong += why is PacketRefusal.WRONG
        self.old += why is PacketRefusal.OLD

    @property
    def marks(self) -> Mark:
        """The reasons as marks for a record, without counts."""
        return (
            (Mark.UNSIGNED if self.unsigned else Mark(0))
            | (Mark.WRONG if self.wrong else Mark(0))
            | (Mark.OLD if self.old else Mark(0))
        )


class Recorded:
    """What a record says about signatures; a replay has no key to verify them."""

    def __init__(self) -> None:
        self.signed = False
        self.refused = Refused()

    def set_marks(self, marks: int) -> None:
        """The marks of the next tick."""
        self.signed |= bool(marks & Mark.SIGNED)
        self.refused = Refused(bool(marks & Mark.UNSIGNED), bool(marks & Mark.WRONG), bool(marks & Mark.OLD))


class Signer:
    """Signs and verifies packets with one key.

    ``clock``: the time in ticks, right or wrong; ``saved``: keeps timestamps over restarts.

    Its own timestamps always rise, whatever the clock does, also over restarts: none is used above the saved one,
    except one tick above the last.
    """

    def __init__(self, key: bytes, clock: Callable[[], int] = ticks_now, saved: SavedTime | None = None) -> None:
        self.key = key
        self.refused = Refused()
        self._clock = clock
        self._saved = saved or NotSaved()
        self._sent = 0 if self._saved.saved == math.inf else int(self._saved.saved)
        self._asked = self._sent
        self._heard = 0
        self._streams: dict[tuple[int, int, int], int] = {}

    def next_timestamp(self) -> int:
        """The timestamp of the next packet: the time, but later than all before."""
        now = max(self._clock(), self._heard)
        if now + AGAIN > self._asked:
            self._asked = min(now + AHEAD, LAST_TICK)
            self._saved.save(self._asked)
        self._sent = min(max(self._sent + 1, int(min(now, self._saved.saved))), LAST_TICK)
        return self._sent

    def accepts(self, packet: Packet) -> bool:
        """Whether to accept a packet; a refused one is counted."""
        why = self._refusal(packet)
        if why is not None:
            self.refused.count(why)
        return why is None

    def _refusal(self, packet: Packet) -> PacketRefusal | None:
        """Why to refuse a packet; None to accept it.

        pymavlink's own check stores a packet's timestamp before it verifies the signature: a forger could silence a
        sender.
        """
        raw = packet.raw
        if raw[0] != MAGIC_V2 or not raw[2] & SIGNED:
            return None if packet.message_id in ACCEPTED_UNSIGNED else PacketRefusal.UNSIGNED
        if not hmac.compare_digest(hashlib.sha256(self.key + raw[:-6]).digest()[:6], raw[-6:]):
            return PacketRefusal.WRONG
        stream = (raw[-SIGNATURE], packet.system_id, packet.component_id)
        timestamp = int.from_bytes(raw[-12:-6], "little")
        newest = self._streams.get(stream)
        if newest is None:
            if len(self._streams) >= MOST_STREAMS or timestamp + MINUTE < max(self._sent, self._heard):
                return PacketRefusal.OLD
        elif timestamp <= newest:
            return PacketRefusal.OLD
        self._streams[stream] = timestamp
        self._heard = max(self._heard, timestamp)
        return None


def trouble(refused: Refused, vehicle_known: bool) -> str:
    """A warning about refused packets, by their gravest reason; empty for none."""
    if not vehicle_known:
        if refused.wrong:
            return "Heard only packets that are signed with another key: is it the key that the autopilot was given?"
        if refused.old:
            return "Heard only packets that were signed too long ago: is this computer's clock ahead?"
        return "Heard only unsigned packets: has the autopilot been given the key?" if refused.unsigned else ""
    if refused.wrong:
        return "Ignoring packets that are signed with another key"
    if refused.old:
        return "Ignoring packets that were signed too long ago, or are heard again"
    return "Ignoring unsigned packets" if refused.unsigned else ""


def remedy(refused: Refused) -> str:
    """What to do when packets are refused; empty for none."""
    if refused.wrong:
        return "name with --signing-key the key that the autopilot was given, or give it this one (docs/signing.md)"
    if refused.old:
        return "set this computer's clock"
    return (
        "give the autopilot the key (docs/signing.md says how), or leave --signing-key out" if refused.unsigned else ""
    )
