"""The conversation with the autopilot: who we are, what we need, what we said and what came of it."""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.round_marks import Mark
from companion.mavlink.acks import AckKeeper
from companion.mavlink.byte_link import ByteLink
from companion.mavlink.codec import Codec, Packet
from companion.mavlink.download import Downloads
from companion.mavlink.rates import RateFault, RateKeeper, wanted_rates
from companion.mavlink.readback import ReadBack
from companion.settings import LinkSettings
from companion.vehicle.commands import AskTime, Command, Heartbeat, RequestMessage, TellFigure
from companion.vehicle.events.event import Event
from companion.vehicle.events.vehicle import AckSeen, HeartbeatSeen, HomeSeen, TargetSeen
from companion.vehicle.link_latency import TimeAnswered

HEARTBEAT_S = 1.0
PLACES_S = 2.0
"""Origin and home are asked for this often until known,"""
PLACES_AGAIN_S = 30.0
"""and then this often, for the autopilot says only once when it has moved them."""
TIME_S = 0.5
"""The autopilot's time is asked for this often: how long the answer takes is how late the link is."""
TWIN_S = 3.5
"""What another companion has said counts for so long."""
REMEMBERED = 64
"""Packets of our own that a network may send back to us."""


class PacketLog(Protocol):
    """Takes every packet of both directions; ``time_s`` is the companion's clock."""

    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """The companion has listened; what came, packet by packet."""
        ...

    def said(self, time_s: float, raw: bytes) -> None:
        """One whole packet of the companion."""
        ...


class _NoLog:
    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """Nobody listens."""

    def said(self, time_s: float, raw: bytes) -> None:
        """Nobody listens."""


class AutopilotLink:
    """Polls, speaks and looks after the link. It never waits and reads no clock: the time is handed in."""

    def __init__(self, link: ByteLink, codec: Codec, settings: LinkSettings, log: PacketLog | None = None) -> None:
        self._link = link
        self._codec = codec
        self._log = log or _NoLog()
        self._rates = RateKeeper(wanted_rates(settings))
        self._acks = AckKeeper()
        self._read_back = ReadBack()
        self.downloads = Downloads()
        """The lists that the autopilot has stored: mission, fence, rally points."""
        self._heartbeat_s = -math.inf
        self._places_s = -math.inf
        self._home_known = False
        self._own: deque[bytes] = deque(maxlen=REMEMBERED)
        self._time_s = -math.inf
        self._asked_ns: deque[int] = deque(maxlen=64)
        self._twin_s = self._rival_s = -math.inf

    @property
    def description(self) -> str:
        """The link in words."""
        return self._link.description

    @property
    def trouble(self) -> str:
        """While no rover has been heard: where was listened, and who spoke instead."""
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
        """For its counters."""
        return self._codec

    @property
    def target_confirmed(self) -> bool | None:
        """Whether the autopilot follows the position sent last: None while nothing can be said, False 2 s after it should have."""
        return self._read_back.confirmed

    @property
    def rate_faults(self) -> tuple[RateFault, ...]:
        """Messages that come at less than half the rate asked for."""
        return self._rates.faults

    def twin_heard(self, now_s: float) -> bool:
        """Whether somebody else has just spoken as this very component: two companions would steer one rover."""
        return now_s - max(self._twin_s, self._rival_s) < TWIN_S

    def rival_heard(self, now_s: float) -> bool:
        """Whether that other companion is driving, for only then it tells its figures. The autopilot passes those on between links,
        but no heartbeat of a component that it hears on both of them."""
        return now_s - self._rival_s < TWIN_S

    def intruder(self, now_s: float) -> str:
        """Who speaks under ids that are not his, in words; empty when nobody does."""
        if self.twin_heard(now_s):
            return "Another companion speaks as this component: stop one of them"
        kind = self._codec.impostor_type
        who = f"A vehicle of type {kind} speaks as system {self._codec.system_id}, too"
        return "" if kind is None else f"{who}: give it another MAV_SYSID"

    def last_ack(self, command: Command) -> AckSeen | None:
        """The last answer to a command of this kind (result -1: never answered); None while there is none."""
        return self._acks.last(command)

    def poll(self, now_s: float) -> list[Event]:
        """What has come in since the last call."""
        events: list[Event] = []
        packets = [packet for packet in self._codec.packets(self._link.read()) if self._codec.accepts(packet)]
        self._log.heard(now_s, [packet.raw for packet in packets], self._codec.marks)
        for packet in packets:
            self._look_for_twin(packet, now_s)
            for event in self._codec.decode_packet(packet, now_s):
                if isinstance(event, TimeAnswered) and not self._is_ours(event):
                    continue
                self._note(event)
                events.append(event)
        return events

    def send(self, command: Command, now_s: float) -> None:
        """Say something; commands that are answered are repeated up to twice if no answer comes within a second.

        Raises EncodeError when the command cannot be said yet (a position in degrees without an origin).
        """
        self._write(command, now_s)
        self._acks.sent(command, now_s)
        self._read_back.sent(command, now_s)

    def service(self, now_s: float) -> None:
        """To be called every tick: heartbeat, requests, repetitions.

        The heartbeat goes out from the first tick on: the autopilot learns the way to us from our own packets.
        """
        if now_s - self._heartbeat_s >= HEARTBEAT_S - 1e-6:
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
        """Have origin and home told again at the next ``service``."""
        self._places_s = -math.inf

    def close(self) -> None:
        """Let go of the line."""
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
            self._write(AskTime(self._asked_ns[-1]), now_s)

    def _look_for_twin(self, packet: Packet, now_s: float) -> None:
        if not self._codec.is_own(packet) or packet.raw in self._own:  # some networks send all back
            return
        if packet.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self._twin_s = now_s
        elif packet.message_id == mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT:
            self._rival_s = now_s

    def _is_ours(self, answer: TimeAnswered) -> bool:
        """Whether it answers our own question, for the first time: others ask as well, and answers are sent to everybody."""
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
            case _:
                pass
        self.downloads.heard(event)

    def _write(self, command: Command, now_s: float, repetition: int = 0) -> None:
        for raw in self._codec.encode_packets(command, repetition):
            self._log.said(now_s, raw)
            self._link.write(raw)
            if isinstance(command, Heartbeat | TellFigure):
                self._own.append(raw)
