"""Stands in for the link to the autopilot: keeps what is sent, and answers as it is told to."""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.mavlink.download import Downloaded
from companion.mavlink.rates import RateFault
from companion.vehicle.commands import Command
from companion.vehicle.events import (
    AckSeen,
    Event,
    PlanKind,
)


@dataclass
class Shelf:
    """Lists of the autopilot, as if they had been downloaded."""

    lists: dict[PlanKind, Downloaded] = field(default_factory=dict)
    asked: list[PlanKind] = field(default_factory=list)

    def ask(self, kind: PlanKind) -> None:
        self.asked.append(kind)

    def busy(self, kind: PlanKind) -> bool:
        return False

    def last(self, kind: PlanKind) -> Downloaded | None:
        return self.lists.get(kind)


@dataclass
class FakeAutopilot:
    """Only what executive and supervision use of ``AutopilotLink``."""

    sent: list[Command] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    downloads: Shelf = field(default_factory=Shelf)
    ack: AckSeen | None = None
    twin: bool = False
    rival: bool = False
    places_asked: int = 0
    served: int = 0
    connected: bool = True
    description: str = "a test"
    trouble: str = " on a test"
    target_confirmed: bool | None = None
    signing_trouble: str = ""
    rate_faults: tuple[RateFault, ...] = ()

    def send(self, command: Command, now_s: float) -> None:
        self.sent.append(command)

    def poll(self, now_s: float) -> list[Event]:
        events, self.events = self.events, []
        return events

    def service(self, now_s: float) -> None:
        self.served += 1

    def ask_places(self) -> None:
        self.places_asked += 1

    def last_ack(self, command: Command) -> AckSeen | None:
        return self.ack

    def twin_heard(self, now_s: float) -> bool:
        return self.twin

    def rival_heard(self, now_s: float) -> bool:
        return self.rival

    def intruder(self, now_s: float) -> str:
        return "another companion" if self.twin else ""

    def taken(self) -> list[Command]:
        """What has been sent since the last call."""
        sent, self.sent = self.sent, []
        return sent
