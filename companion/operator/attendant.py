"""Looks after people at ground stations: their parameters, and figures for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from companion.executive.mission_executor import MissionExecutor
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.figures import Telemetry
from companion.operator.parameters import ParameterServer
from companion.settings import Settings


class Tunable(Protocol):
    """Keeps settings."""

    def retune(self, settings: Settings) -> None:
        """Other settings from now on."""
        ...


class Attendant:
    """``tuned``: who is told of other settings besides the executor; ``keep`` takes them for the next run."""

    def __init__(
        self,
        settings: Settings,
        autopilot: AutopilotLink,
        tell: Callable[[str, int], None],
        keep: Callable[[Settings], None] | None,
        tuned: tuple[Tunable, ...],
    ) -> None:
        self._parameters = ParameterServer(settings, tell, keep)
        self._telemetry = Telemetry(settings.link.figures_hz)
        self._settings = settings
        self._autopilot = autopilot
        self._tuned = tuned

    def take(self, event: object) -> None:
        """Note what is asked."""
        self._parameters.take(event)

    def attend(self, executor: MissionExecutor | None, now_s: float) -> Settings:
        """Answer, and take over what has been set; the settings from now on."""
        for command in (*self._parameters.due(now_s), *self._telemetry.due(executor, now_s)):
            self._autopilot.send(command, now_s)
        if self._settings is not self._parameters.settings:
            self._settings = self._parameters.settings
            for one in self._tuned if executor is None else (*self._tuned, executor):
                one.retune(self._settings)
        return self._settings
