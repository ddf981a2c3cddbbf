"""What missions, ways back and fences do at each moment, and when they have to be looked at next (behaviour of ModeAuto)."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.auto import AutoRunner
from sitl.autopilot.fence import run_fence
from sitl.autopilot.link import Channel
from sitl.autopilot.modes import disarm, set_mode
from sitl.autopilot.plan import Submode
from sitl.autopilot.telemetry import mission_current
from sitl.autopilot.transfer import run_uploads
from sitl.autopilot.vehicle import CRITICAL, Mode, Vehicle
from sitl.autopilot.ways import SAVE_EVERY_US, remember_path, run_return, run_way_back, stand

TICK_US = 100_000
"""How often the mission is looked at; arriving somewhere is noticed at once."""
HANDED_OVER_EVERY_S = 1.0
RELATIVE_INT, PLACE_ONLY = 6, 3576
"""Frame and type mask of the place that is handed over."""
TURNED_RAD = math.radians(5.0)
BUSY_MODES = {Mode.AUTO, Mode.RTL, Mode.SMART_RTL}


def run_plan(vehicle: Vehicle) -> None:
    """What missions, ways back and fences have to do at this moment."""
    plan, now_us = vehicle.plan, vehicle.time_us
    if plan.uploads:
        run_uploads(vehicle)
    if plan.fence.enabled or vehicle.parameters["FENCE_ENABLE"] != plan.fence.seen_setting:
        run_fence(vehicle, set_mode, disarm)
    if now_us >= plan.way_back_due_us:
        plan.way_back_due_us = (now_us // SAVE_EVERY_US + 1) * SAVE_EVERY_US
        remember_path(vehicle)
    if vehicle.mode == Mode.AUTO:
        _run_auto(vehicle)
    elif vehicle.mode == Mode.RTL:
        run_return(vehicle)
    elif vehicle.mode == Mode.SMART_RTL:
        run_way_back(vehicle)


def _run_auto(vehicle: Vehicle) -> None:
    auto, mission, runner = vehicle.plan.auto, vehicle.plan.mission, AutoRunner(vehicle)
    if not vehicle.armed and not mission.present:
        auto.submode = Submode.STOP
        stand(vehicle)
    if auto.waiting:
        if vehicle.has_origin:
            auto.waiting = False
            if vehicle.parameters["MIS_RESTART"] == 1.0:
                mission.start(runner)
            else:
                mission.resume(runner)
            _changed(vehicle)
    else:
        if _changed(vehicle) and auto.submode == Submode.WAYPOINT:
            done = mission.restart_current(runner)
            vehicle.say(
                CRITICAL,
                "Auto mission changed, restarted command"
                if done
                else "Auto mission changed but failed to restart command",
            )
        mission.update(runner)
    if auto.submode == Submode.RETURN:
        run_return(vehicle)
    elif auto.submode == Submode.GUIDED:
        _tell_target(vehicle)
    elif auto.submode == Submode.HEADING:
        _run_heading(vehicle)


def _changed(vehicle: Vehicle) -> bool:
    """Whether the command under way, or one of the next two, was written anew."""
    auto, mission = vehicle.plan.auto, vehicle.plan.mission
    same_index = auto.seen_index == mission.nav_index
    if same_index and auto.seen_changes == mission.changes:
        return False
    before = auto.seen_items
    auto.seen_index, auto.seen_changes, auto.seen_items = mission.nav_index, mission.changes, mission.ahead()
    return same_index and mission.nav_running and before != auto.seen_items


def _run_heading(vehicle: Vehicle) -> None:
    """NAV_SET_YAW_SPEED: its target does not grow old; it stops when it has turned."""
    auto, control = vehicle.plan.auto, vehicle.control
    control["target_tick"] = control["tick"]
    error = (auto.heading_rad - vehicle.heading_rad() + math.pi) % (2.0 * math.pi) - math.pi
    if not auto.turned and abs(error) < TURNED_RAD:
        auto.turned = True
        stand(vehicle)


def _tell_target(vehicle: Vehicle) -> None:
    """Guided within AUTO: once a second the place goes to the first onboard controller that was heard."""
    task = vehicle.plan.auto.guided
    if task.place is None or (task.sent_s is not None and vehicle.time_s - task.sent_s <= HANDED_OVER_EVERY_S):
        return
    task.sent_s = vehicle.time_s
    if vehicle.plan.helper is None:
        return
    system, component, number = vehicle.plan.helper
    if number in vehicle.channels:
        vehicle.channels[number].send(
            mavlink.MAVLink_set_position_target_global_int_message(
                vehicle.time_us // 1000, system, component, RELATIVE_INT, PLACE_ONLY, *task.place, task.height_m * 100.0,
                *[0.0] * 8,
            )
        )  # fmt: skip


def plan_due_us(vehicle: Vehicle) -> float:
    """When ``run_plan`` is to be called next."""
    plan = vehicle.plan
    if plan.uploads or plan.fence.enabled or vehicle.mode in BUSY_MODES:
        # On the beat of the streams, so that both are done at once.
        return min(plan.way_back_due_us, (vehicle.time_us // TICK_US + 1) * TICK_US)
    return plan.way_back_due_us


def set_mission_current(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_SET_CURRENT: answered with MISSION_CURRENT of just this number, or not at all."""
    if vehicle.plan.mission.set_current(message.seq, AutoRunner(vehicle)):
        channel.send(mission_current(vehicle, message.seq))
