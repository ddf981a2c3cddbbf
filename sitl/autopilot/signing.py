"""Signed packets (MAVLink 2 message signing) as ArduPilot handles them.

A key set with SETUP_SIGNING survives reboots. From then on everything sent in MAVLink 2 is signed, and packets that
are unsigned, wrongly signed or replayed are refused. Exceptions: the first serial port, which counts as a cable that
only the owner can reach, and the status messages of radios.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

from sitl.autopilot.framing import SIGNATURE

KEY_BYTES = 32

MINUTE = 60 * 100_000
"""Signing timestamps count 10 microseconds since 2015."""

TIMESTAMPS = 1 << 48

SAVED_EVERY_S = 30.0

MOST_STREAMS = 16

SECURE_PORT = 0

RADIO, RADIO_STATUS = 166, 109

ACCEPTED_UNSIGNED = {RADIO, RADIO_STATUS}


@dataclass(frozen=True, slots=True)
class StoredKey:
    """What survives a reboot: the key and the newest timestamp saved with it."""

    secret: bytes = bytes(KEY_BYTES)
    timestamp: int = 0

    @property
    def in_use(self) -> bool:
        """A key of zeros with timestamp 0 means: no signing."""
        return self.timestamp != 0 or any(self.secret)


class Signing:
    """The vehicle's key and the signatures seen so far; a link's own state is in its codec (``codec.signing``)."""

    def __init__(self) -> None:
        """No key."""
        self.stored = StoredKey()
        self._streams: dict[tuple[int, int, int], int] = {}
        self._saved_s = 0.0

    def restore(self, stored: StoredKey) -> None:
        """Take over the key from before a reboot."""
        self.stored = stored

    def prepare(self, codec: Any, link: int) -> None:
        """Make a link sign with the stored key, or stop signing.

        Its timestamps start one minute after the saved one: that is saved every half minute, so no old packet is
        accepted.
        """
        signing = codec.signing
        signing.link_id = link & 0xFF
        signing.timestamp = (self.stored.timestamp + MINUTE) % TIMESTAMPS
        signing.sign_outgoing = self.stored.in_use
        signing.secret_key = self.stored.secret if self.stored.in_use else None

    def follow(self, codec: Any, link: int) -> None:
        """Give a further component of the vehicle the present key."""
        if (codec.signing.secret_key or bytes(KEY_BYTES)) != self.stored.secret:
            self.prepare(codec, link)

    def accepts(self, codec: Any, packet: bytes, identity: tuple[int, int, int], signed: bool, secure: bool) -> bool:
        """Whether a link accepts a packet; ``identity``: its system, component and message id."""
        if codec.signing.secret_key is None:
            return True
        if signed and self._signed_rightly(codec.signing, packet, identity):
            return True
        return secure or identity[2] in ACCEPTED_UNSIGNED

    def _signed_rightly(self, link: Any, packet: bytes, identity: tuple[int, int, int]) -> bool:
        """Whether the signature is correct, and newer than any other of this sender."""
        wanted = hashlib.sha256(link.secret_key + packet[:-6]).digest()[:6]
        if wanted != packet[-6:]:
            return False
        stream = (packet[-SIGNATURE], *identity[:2])
        timestamp = int.from_bytes(packet[-12:-6], "little")
        newest = self._streams.get(stream)
        if newest is None:
            if len(self._streams) >= MOST_STREAMS or timestamp + MINUTE < link.timestamp:
                return False
        elif timestamp <= newest:
            return False
        self._streams[stream] = timestamp
        link.timestamp = max(link.timestamp, timestamp)
        return True

    def save(self, codecs: list[Any], time_s: float) -> None:
        """Every half minute, store the newest timestamp that a link has used or received."""
        if time_s - self._saved_s < SAVED_EVERY_S or not self.stored.in_use:
            return
        self._saved_s = time_s
        newest = max((codec.signing.timestamp for codec in codecs), default=0)
        if newest > self.stored.timestamp:
            self.stored = StoredKey(self.stored.secret, newest)
