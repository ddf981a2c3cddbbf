"""The operator server: parameters are answered, and figures are sent once the mission has begun."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.operator.operator_server import OperatorServer
from companion.vehicle.commands import NamedValue, ParameterValue
from companion.vehicle.events import ParameterAsked
from tests.support.desk import Desk


def test_a_parameter_is_answered_and_figures_follow_the_begin(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    link: Any = desk.autopilot
    server = OperatorServer(desk.run, link, desk.settings, desk.notices, None)
    server.take(ParameterAsked(10.0, "CMP_STALE", -1), desk.run.vehicle)
    server.answer(10.0)
    assert [type(command) for command in desk.autopilot.taken()] == [ParameterValue]
    desk.begin()
    server.answer(11.0)
    sent = desk.autopilot.taken()
    assert sent and all(isinstance(command, NamedValue) for command in sent)
