"""The parameter server: ground stations list, read and set the companion's own MAVLink parameters.

Nouns: parameter server.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.core.severity import Severity, TextSink
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.settings.tunable_parameters import BY_NAME, TABLE, RefusedError, changed
from companion.vehicle.commands import Command, ParameterValue
from companion.vehicle.events import (
    Event,
    ParameterAsked,
    ParameterChangeAsked,
    ParametersAsked,
)
from companion.vehicle.state import VehicleState

ANSWER_S = 0.05
"""Time for one PARAM_VALUE of some 37 bytes, however many are asked for: under a kilobyte a second."""
CHANGE_S = 0.2
"""One change is taken in this often; of a flood for one parameter the newest, so that no flood of texts follows."""
MOST_OPEN = 64
"""Changes not taken in yet, those of unknown names among them."""


class ParameterServer:
    """Takes requests at any rate, answers at its own, and replaces the settings in force.

    ``keep`` takes the new settings after every change, and must not wait.
    """

    def __init__(
        self, settings: LiveSettings, notifier: TextSink, keep: Callable[[Settings], None] | None = None
    ) -> None:
        self._settings = settings
        self._notifier = notifier
        self._keep = keep
        self._answers: dict[int, None] = {}
        self._changes: dict[str, ParameterChangeAsked] = {}
        self._answer_s = self._change_s = -math.inf

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """Note what is asked; anything else is ignored."""
        match event:
            case ParametersAsked():
                self._answers |= dict.fromkeys(range(len(TABLE)))
            case ParameterAsked(name=name, index=index):
                if 0 <= index < len(TABLE):
                    self._answers[index] = None
                elif index < 0 and name in BY_NAME:
                    self._answers[TABLE.index(BY_NAME[name])] = None
            case ParameterChangeAsked(name=name, to_us=to_us):
                if (name in BY_NAME or to_us) and (name in self._changes or len(self._changes) < MOST_OPEN):
                    self._changes[name] = event
            case _:
                pass

    def due(self, now_s: float) -> list[Command]:
        """The answers to send now; changes are taken in on the way."""
        if self._changes and now_s - self._change_s >= CHANGE_S - 1e-6:
            self._change_s = now_s
            self._change(self._changes.pop(next(iter(self._changes))))
        if not self._answers or now_s - self._answer_s < ANSWER_S - 1e-6:
            return []
        self._answer_s = now_s
        index = next(iter(self._answers))
        del self._answers[index]
        parameter, settings = TABLE[index], self._settings.current
        return [
            ParameterValue(parameter.name, parameter.value(settings), index, len(TABLE), whole_number=parameter.whole)
        ]

    def _change(self, asked: ParameterChangeAsked) -> None:
        parameter = BY_NAME.get(asked.name)
        if parameter is None:
            self._notifier.tell(f"The companion has no parameter {asked.name:.16}", Severity.WARNING)
            return
        self._answers[TABLE.index(parameter)] = None
        before = parameter.value(self._settings.current)
        try:
            settings = changed(self._settings.current, parameter, asked.value)
        except RefusedError as reason:
            self._notifier.tell(f"{parameter.name} stays {before:g}: {reason}", Severity.WARNING)
            return
        self._settings.replace(settings)
        now = parameter.value(settings)
        if now == before:
            return
        if self._keep is not None:
            self._keep(settings)
        when = ", from the next leg on" if parameter.next_leg else ""
        self._notifier.tell(f"{parameter.name} {before:g} -> {now:g}{when}", Severity.INFO)
