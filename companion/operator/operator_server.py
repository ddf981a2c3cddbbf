"""The operator server: answers ground stations (the companion's parameters), and sends them figures to plot.

Nouns: operator server.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.core.severity import TextSink
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.figures import Telemetry
from companion.operator.parameter_server import ParameterServer
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import Event
from companion.vehicle.state import VehicleState


class OperatorServer:
    """``keep_settings`` takes settings that a ground station has changed."""

    def __init__(
        self,
        run: MissionRun,
        autopilot: AutopilotLink,
        settings: LiveSettings,
        notifier: TextSink,
        keep_settings: Callable[[Settings], None] | None,
    ) -> None:
        self._run = run
        self._autopilot = autopilot
        self._parameters = ParameterServer(settings, notifier, keep_settings)
        self._telemetry = Telemetry(settings.current.link.figures_hz)

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event; anything but a request is ignored."""
        self._parameters.take(event, vehicle)

    def answer(self, now_s: float) -> None:
        """Send what has been asked for, and the figures that are due."""
        for command in (*self._parameters.due(now_s), *self._telemetry.due(self._run.executor, now_s)):
            self._autopilot.send(command, now_s)
