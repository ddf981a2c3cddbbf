"""The companion's own MAVLink parameters: ground stations list, read and set them."""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.settings import Settings
from companion.settings.tunable_parameters import BY_NAME, TABLE, Parameter, RefusedError, changed
from companion.vehicle.commands import Command, ParameterValue
from companion.vehicle.events import ParameterAsked, ParameterChangeAsked, ParametersAsked

INFO, WARNING = 6, 4
ANSWER_S = 0.05
"""One PARAM_VALUE of some 37 bytes in so long, however many are asked for: under a kilobyte a second."""
CHANGE_S = 0.2
"""So often one change is taken in: of a flood for one parameter the newest, so that nobody is flooded with texts."""
MOST_OPEN = 64
"""Changes not taken in yet, those of unknown names among them."""


class ParameterServer:
    """Takes requests at any rate, answers at its own. ``settings`` are the ones in force.

    ``tell`` says a text with its severity; ``keep`` takes the new settings after every change, and must not wait.
    """

    def __init__(
        self, settings: Settings, tell: Callable[[str, int], None], keep: Callable[[Settings], None] | None = None
    ) -> None:
        self.settings = settings
        self._tell = tell
        self._keep = keep
        self._answers: dict[int, None] = {}
        self._changes: dict[str, ParameterChangeAsked] = {}
        self._answer_s = self._change_s = -math.inf

    def take(self, event: object) -> None:
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
        parameter = TABLE[index]
        return [
            ParameterValue(
                parameter.name, parameter.value(self.settings), index, len(TABLE), whole_number=parameter.whole
            )
        ]

    def _change(self, asked: ParameterChangeAsked) -> None:
        parameter = BY_NAME.get(asked.name)
        if parameter is None:
            self._tell(f"The companion has no parameter {asked.name:.16}", WARNING)
            return
        self._answers[TABLE.index(parameter)] = None
        before = parameter.value(self.settings)
        try:
            self.settings = changed(self.settings, parameter, asked.value)
        except RefusedError as reason:
            self._tell(f"{parameter.name} stays {before:g}: {reason}", WARNING)
            return
        if parameter.value(self.settings) != before:
            if self._keep is not None:
                self._keep(self.settings)
            self._tell(self._news(parameter, before), INFO)

    def _news(self, parameter: Parameter, before: float) -> str:
        now = parameter.value(self.settings)
        return f"{parameter.name} {before:g} -> {now:g}{', from the next leg on' if parameter.next_leg else ''}"
