"""The link to the autopilot: heartbeat, requests, commands and their confirmation, and incoming events.

Nouns: link.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.tick_marks import Mark
from companion.mavlink.byte_link import ByteLink
from companion.mavlink.codec import Codec, Packet
from companion.mavlink.confirmation import CommandTracker, TargetReadBack
from companion.mavlink.download import Downloads
from companion.mavlink.local_station import LocalStation
from companion.mavlink.rates import RateFault, RateRequester, wanted_rates
from companion.settings import LinkSettings
from companion.vehicle.commands import Command, Heartbeat, NamedValue, RequestMessage, TimeSync
from companion.vehicle.events import AckSeen, Event, GuardSeen, HeartbeatSeen, HomeSeen, TargetSeen
from companion.vehicle.link_latency import TimeAnswered

HEARTBEAT_S = 1.0
GUARDED_HEARTBEAT_S = 0.1
"""While a guard on the autopilot listens, which stops the rover soon after the last packet."""
PLACES_S = 2.0
"""Origin and home are requested this often until known,"""
PLACES_AGAIN_S = 30.0
"""and then this often: the autopilot reports a change only once."""
TIME_S = 0.5
"""The autopilot's time is requested this often: the time until the answer is the latency of the link."""
TWIN_S = 3.5
"""A message of another companion counts for this long."""
REMEMBERED = 64
"""Own packets that are remembered, because a network may send them back."""


class PacketLog(Protocol):
    """Receives every packet of both directions; ``time_s`` is by the companion's clock."""

    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """The packets received in one poll."""
        ...

    def said(self, time_s: float, raw: bytes) -> None:
        """One packet sent by the companion."""
        ...


class _NoLog:
    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """Nothing to log."""

    def said(self, time_s: float, raw: bytes) -> None:
        """Nothing to log."""


class AutopilotLink:
    """Polls the link, sends commands and keeps the link up.

    It never waits and reads no clock: callers pass the time. ``station``: heard beside the link, and answered.
    """

    def __init__(
        self,
        link: ByteLink,
        codec: Codec,
        settings: LinkSettings,
        log: PacketLog | None = None,
        station: LocalStation | None = None,
    ) -> None:
        self._link = link
        self._codec = codec
        self._station = station
        self._component_id = settings.component_id
        self._log = log or _NoLog()
        self._rates = RateRequester(wanted_rates(settings))
        self._acks = CommandTracker()
        self._read_back = TargetReadBack()
        self.downloads = Downloads()
        """Downloads of the autopilot's stored lists: mission, fence, rally points."""
        self._heartbeat_s = -math.inf
        self._places_s = -math.inf
        self._home_known = False
        self._own: deque[bytes] = deque(maxlen=REMEMBERED)
        self._time_s = -math.inf
        self._asked_ns: deque[int] = deque(maxlen=64)
        self._twin_s = self._rival_s = -math.inf
        self._guarded = False
        """A guard was heard. It may still watch though its words are lost, so heartbeats stay frequent from then on."""

    @property
    def description(self) -> str:
        """The link in words."""
        return self._link.description

    @property
    def connected(self) -> bool:
        """Whether the link has another end, as far as it can know."""
        return self._link.connected

    @property
    def trouble(self) -> str:
        """For the message that no rover is heard: the link, and what was heard instead."""
        refused = self._codec.refused_type
        other = "" if refused is None else f" (heard a vehicle of type {refused}, which is no ArduPilot rover)"
        signing = self._codec.signing_trouble
        return f" on {self.description}{other}{f' ({signing})' if signing else ''}"

    @property
    def signing_trouble(self) -> str:
        """What is wrong with signatures, in words; empty for nothing."""
        return self._codec.signing_trouble

    @property
    def codec(self) -> Codec:
        """The codec, for its counters."""
        return self._codec

    @property
    def target_confirmed(self) -> bool | None:
        """Whether the autopilot follows the last position sent; None while unknown, False after 2 s without."""
        return self._read_back.confirmed

    @property
    def rate_faults(self) -> tuple[RateFault, ...]:
        """Messages whose rate is too low."""
        return self._rates.faults

    def twin_heard(self, now_s: float) -> bool:
        """Whether another companion uses this component id: two would steer one rover."""
        return now_s - max(self._twin_s, self._rival_s) < TWIN_S

    def rival_heard(self, now_s: float) -> bool:
        """Whether another companion is driving: only then it sends figures.

        The autopilot forwards those between links, but not the heartbeat of a component that it hears on both.
        """
        return now_s - self._rival_s < TWIN_S

    def intruder(self, now_s: float) -> str:
        """A warning about another sender with the companion's or the rover's ids; empty if there is none."""
        if self.twin_heard(now_s):
            return "Another companion speaks as this component: stop one of them"
        kind = self._codec.impostor_type
        who = f"A vehicle of type {kind} speaks as system {self._codec.system_id}, too"
        return "" if kind is None else f"{who}: give it another MAV_SYSID"

    def last_ack(self, command: Command) -> AckSeen | None:
        """The last answer to a command of this kind (result -1: never answered); None while there is none."""
        return self._acks.last(command)

    def poll(self, now_s: float) -> list[Event]:
        """The events since the last call."""
        events: list[Event] = []
        heard = self._codec.packets(self._link.read())
        if self._station is not None:
            heard += self._station.spoken(self._codec.system_id, self._component_id)
        packets = [packet for packet in heard if self._codec.accepts(packet)]
        self._log.heard(now_s, [packet.raw for packet in packets], self._codec.marks)
        for packet in packets:
            self._note_twin(packet, now_s)
            for event in self._codec.decode_packet(packet, now_s):
                if isinstance(event, TimeAnswered) and not self._is_ours(event):
                    continue
                self._note(event)
                events.append(event)
        return events

    def send(self, command: Command, now_s: float) -> None:
        """Send a command. Mode, arming and speed are repeated up to twice if no answer comes within a second.

        Raises EncodeError if the command cannot be encoded yet (a position in degrees without an origin).
        """
        self._write(command, now_s)
        if self._station is not None:
            self._station.hear(command)
        self._acks.sent(command, now_s)
        self._read_back.sent(command, now_s)

    def service(self, now_s: float) -> None:
        """Call every tick: sends heartbeat, requests and repetitions.

        The heartbeat is sent from the first tick on: the autopilot learns from packets where the companion is.
        """
        if now_s - self._heartbeat_s >= (GUARDED_HEARTBEAT_S if self._guarded else HEARTBEAT_S) - 1e-6:
            self._heartbeat_s = now_s
            self._write(Heartbeat(), now_s)
        self._read_back.check(now_s)
        if not self._codec.vehicle_known:
            return
        for request in (*self._rates.due(now_s, self._codec.message_counts), *self.downloads.due(now_s)):
            self._write(request, now_s)
        self._ask_places(now_s)
        self._ask_time(now_s)
        for command, repetition in self._acks.due(now_s):
            self._write(command, now_s, repetition)

    def ask_places(self) -> None:
        """Request origin and home again at the next ``service``."""
        self._places_s = -math.inf

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _ask_places(self, now_s: float) -> None:
        missing = self._codec.origin is None or not self._home_known
        if now_s - self._places_s < (PLACES_S if missing else PLACES_AGAIN_S):
            return
        self._places_s = now_s
        for message_id in (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, mavlink.MAVLINK_MSG_ID_HOME_POSITION):
            self._write(RequestMessage(message_id), now_s)

    def _ask_time(self, now_s: float) -> None:
        if now_s - self._time_s >= TIME_S - 1e-6:
            self._time_s = now_s
            self._asked_ns.append(round(now_s * 1e9))
            self._write(TimeSync(self._asked_ns[-1]), now_s)

    def _note_twin(self, packet: Packet, now_s: float) -> None:
        if not self._codec.is_own(packet) or packet.raw in self._own:  # some networks send packets back
            return
        if packet.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self._twin_s = now_s
        elif packet.message_id == mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT:
            self._rival_s = now_s

    def _is_ours(self, answer: TimeAnswered) -> bool:
        """Whether it answers a TIMESYNC of this companion, for the first time: answers are sent to all who ask."""
        if answer.asked_ns not in self._asked_ns:
            return False
        self._asked_ns.remove(answer.asked_ns)
        return True

    def _note(self, event: Event) -> None:
        match event:
            case HeartbeatSeen() | AckSeen():
                self._acks.heard(event)
            case TargetSeen():
                self._read_back.heard(event, self._codec.origin)
            case HomeSeen():
                self._home_known = True
            case GuardSeen():
                self._guarded = True
            case _:
                pass
        self.downloads.heard(event)

    def _write(self, command: Command, now_s: float, repetition: int = 0) -> None:
        for raw in self._codec.encode_packets(command, repetition):
            self._log.said(now_s, raw)
            self._link.write(raw)
            if isinstance(command, Heartbeat | NamedValue):
                self._own.append(raw)
