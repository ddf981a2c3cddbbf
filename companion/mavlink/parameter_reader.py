"""Reads parameters of the autopilot by name, and sends nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from companion.mavlink.byte_link import ByteLink
from companion.mavlink.codec import Codec
from companion.mavlink.signing import Signer
from companion.mavlink.surveyor import ASK_S, OTHER_COMPONENT, PARAMETER_S, TRIES
from companion.settings import LinkSettings
from companion.vehicle.commands import Command, ReadParameter, RequestMessage
from companion.vehicle.events import ParameterSeen

AUTOPILOT_VERSION = 148
"""Asked for until a rover is heard: a server sends nothing before it has received a packet."""


class ParameterReader:
    """Call ``step`` some twenty times a second until ``done``. ``names``: the parameters to read."""

    def __init__(
        self, link: ByteLink, settings: LinkSettings, names: Sequence[str], signer: Signer | None = None
    ) -> None:
        self._link = link
        other = OTHER_COMPONENT + (settings.component_id == OTHER_COMPONENT)
        self._codec = Codec(settings.model_copy(update={"component_id": other}), signer=signer)
        self._names = tuple(names)
        self._open = [name for _ in range(TRIES) for name in names]
        self._values: dict[str, float] = {}
        self._asked_s = -math.inf

    @property
    def rover_heard(self) -> bool:
        """Whether a rover was heard whose packets are accepted."""
        return self._codec.vehicle_known

    @property
    def signing_trouble(self) -> str:
        """What is wrong with signatures, in words; empty for nothing."""
        return self._codec.signing_trouble

    @property
    def values(self) -> Mapping[str, float]:
        """What was answered."""
        return dict(self._values)

    def done(self, now_s: float) -> bool:
        """Whether every parameter was answered, or asked for often enough."""
        return len(self._values) == len(self._names) or (not self._open and now_s - self._asked_s > ASK_S)

    def step(self, now_s: float) -> None:
        """Listen, and send the question that is due."""
        for event in self._codec.decode(self._link.read(), now_s):
            if isinstance(event, ParameterSeen) and event.name in self._names:
                self._values[event.name] = event.value
        question = self._question(now_s)
        for raw in [] if question is None else self._codec.encode_packets(question):
            self._link.write(raw)

    def _question(self, now_s: float) -> Command | None:
        if not self._codec.vehicle_known:
            if now_s - self._asked_s < ASK_S:
                return None
            self._asked_s = now_s
            return RequestMessage(AUTOPILOT_VERSION)
        while self._open and self._open[0] in self._values:
            self._open.pop(0)
        if not self._open or now_s - self._asked_s < PARAMETER_S - 1e-6:
            return None
        self._asked_s = now_s
        return ReadParameter(self._open.pop(0))
