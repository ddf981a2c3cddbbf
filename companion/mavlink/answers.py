"""How the companion answers what others ask of it: COMMAND_ACK or MISSION_ACK to the asker, and to nobody else."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.vehicle.commands import AnswerTarget
from companion.vehicle.events.targets import TargetAnswer, TargetForm

COMMAND_RESULTS: Mapping[TargetAnswer, int] = MappingProxyType(
    {
        TargetAnswer.ACCEPTED: mavlink.MAV_RESULT_ACCEPTED,
        TargetAnswer.DENIED: mavlink.MAV_RESULT_DENIED,
        TargetAnswer.NOT_NOW: mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
        TargetAnswer.BAD_FRAME: mavlink.MAV_RESULT_DENIED,
        TargetAnswer.BAD_VALUE: mavlink.MAV_RESULT_DENIED,
        TargetAnswer.UNSUPPORTED: mavlink.MAV_RESULT_UNSUPPORTED,
    }
)
"""ArduRover too denies local frames and places of zeros."""
ITEM_RESULTS: Mapping[TargetAnswer, int] = MappingProxyType(
    {
        TargetAnswer.ACCEPTED: mavlink.MAV_MISSION_ACCEPTED,
        TargetAnswer.DENIED: mavlink.MAV_MISSION_DENIED,
        TargetAnswer.NOT_NOW: mavlink.MAV_MISSION_ERROR,
        TargetAnswer.BAD_FRAME: mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
        TargetAnswer.BAD_VALUE: mavlink.MAV_MISSION_INVALID_PARAM5_X,
        TargetAnswer.UNSUPPORTED: mavlink.MAV_MISSION_UNSUPPORTED,
    }
)


def answer_message(command: AnswerTarget) -> Any:
    """The message that answers a guided target."""
    to = (command.asker.system_id, command.asker.component_id)
    if command.form is TargetForm.COMMAND:
        result = COMMAND_RESULTS[command.answer]
        return mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_REPOSITION, result, 0, 0, *to)
    return mavlink.MAVLink_mission_ack_message(*to, ITEM_RESULTS[command.answer], mavlink.MAV_MISSION_TYPE_MISSION)
