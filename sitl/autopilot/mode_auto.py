"""AUTO: what each mission command does on a rover, and when it is done (behaviour of ModeAuto).

Nouns: ModeAuto.
"""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot import mission_items as items
from sitl.autopilot.channel import Channel
from sitl.autopilot.control.circle import begin_circle
from sitl.autopilot.control.records import HEADING
from sitl.autopilot.destination import arrived, begin_driving, change_speed, drive_to, stand
from sitl.autopilot.fence import distance_m, enable_fence
from sitl.autopilot.mission_items import NAMES, Item
from sitl.autopilot.mode_rtl import begin_return, run_return
from sitl.autopilot.modes import set_mode
from sitl.autopilot.payload import ACCEPTED, COMMANDS, note, run_payload
from sitl.autopilot.state import GuidedTask, Mode, Submode
from sitl.autopilot.telemetry import mission_current
from sitl.autopilot.vehicle import Vehicle
from sitl.world import geodesy
from sitl.world.geodesy import ALTITUDE_M

SMALLEST_CIRCLE_M = 0.5

STAY, LOITER, ACRO, MANUAL = 0, 1, 2, 3
"""MIS_DONE_BEHAVE."""

ELSEWHERE = {181, 182, 183, 184, 202, 203, 205, 206, 208, 211, 215, 216, 218}
"""Commands for servos, relays, cameras, grippers: no effect, done at once."""

DONE_AT_ONCE = {
    items.CHANGE_SPEED, items.SET_HOME, items.SET_REVERSE, items.FENCE_ENABLE, items.GUIDED_LIMITS, items.JUMP_TAG,
    195, 197, 201,
}  # fmt: skip


class AutoRunner:
    """Begins mission commands on one vehicle and checks whether they are done (a ``mission.Runner``)."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Created whenever needed; all state is in the vehicle."""
        self.vehicle = vehicle
        self.auto = vehicle.auto

    def completed(self) -> None:
        """End of the mission: stop, or do what MIS_DONE_BEHAVE says."""
        self.vehicle.say(Severity.NOTICE, "Mission Complete")
        behaviour = int(self.vehicle.parameters["MIS_DONE_BEHAVE"])
        self._stop()
        if behaviour == ACRO:
            set_mode(self.vehicle, Mode.ACRO)
        elif behaviour == MANUAL:
            set_mode(self.vehicle, Mode.MANUAL)

    def jumped(self, index: int, times: int, of: int) -> None:
        """Report a jump."""
        self.vehicle.say(Severity.INFO, f"Mission: {index} Jump {times}/{of}")

    def _stop(self) -> None:
        self.auto.submode = Submode.STOP
        stand(self.vehicle)

    # Beginning ------------------------------------------------------------------------------------------------------

    def start(self, index: int, item: Item) -> bool:
        """Begin a command."""
        self.vehicle.say(Severity.INFO, f"Mission: {index} {NAMES.get(item.command, '?')}")
        command, first = item.command, item.params[0]
        if command in (items.WAYPOINT, items.LOITER_UNLIMITED, items.LOITER_TIME):
            self._go(index, item)
        elif command == items.RETURN:
            self.auto.submode = Submode.RETURN
            begin_return(self.vehicle)
        elif command == items.LOITER_TURNS:
            self._circle(item)
        elif command == items.GUIDED_ENABLE:
            self._hand_over(item)
        elif command == items.SET_YAW_SPEED:
            self._turn(item)
        elif command == items.DELAY:
            self._wait(item)
        elif command in (items.CONDITION_DELAY, items.CONDITION_DISTANCE):
            self.auto.condition_since_s, self.auto.condition = self.vehicle.time_s, first
        else:
            return self._do(item)
        return True

    def _do(self, item: Item) -> bool:
        """Begin a command that is done at once; False if a rover does not know it."""
        command, first = item.command, item.params[0]
        if command == items.CHANGE_SPEED:
            if change_speed(self.vehicle, item.params[1]):
                self.vehicle.say(Severity.INFO, f"speed: {item.params[1]:.1f} m/s")
        elif command == items.SET_HOME:
            place = self.vehicle.place() if first == 1.0 else item.place
            if place != (0, 0):
                self.vehicle.move_home(place)
        elif command == items.SET_REVERSE:
            self.vehicle.control["reversed"] = 1 if first == 1.0 else 0
        elif command == items.GUIDED_LIMITS:
            self.auto.guided.limit_s, self.auto.guided.limit_m = first, item.params[3]
        elif command == items.FENCE_ENABLE:
            return enable_fence(self.vehicle, int(first), spoken=True)
        elif command in COMMANDS:
            return self._payload(item)
        else:
            return command in ELSEWHERE or command in DONE_AT_ONCE
        return True

    def _payload(self, item: Item) -> bool:
        """A servo, a relay and so on; an item that is refused is passed over without a word."""
        place = (item.x, item.y) if item.command in items.RAW_PLACES else (item.x / 1e7, item.y / 1e7)
        params = (*item.params, *(float(value) for value in place), item.z)
        result = run_payload(self.vehicle, item.command, params)
        note(self.vehicle, item.command, params, result, in_auto=True)
        return result == ACCEPTED

    def _go(self, index: int, item: Item) -> None:
        """Drive to a place; on to the next without stopping if it is known and there is no time to wait here."""
        hold_s = item.params[0] if item.command != items.LOITER_UNLIMITED else 0.0
        self.auto.loiter_s = 0.0 if hold_s >= 32768.0 else hold_s
        self.auto.reached = False
        following = None
        if item.command == items.WAYPOINT and self.auto.loiter_s == 0.0:
            after = self.vehicle.mission.next_nav(index + 1)
            if after is not None:
                following = self.vehicle.mission.items[after].place
        self.auto.submode = Submode.WAYPOINT
        drive_to(self.vehicle, self._sane(item.place), following if following != (0, 0) else None)

    def _sane(self, place: tuple[int, int]) -> tuple[int, int]:
        """The place, or the rover's own where the item has zeros."""
        return self.vehicle.place() if place == (0, 0) else place

    def _circle(self, item: Item) -> None:
        begin_driving(self.vehicle)
        self.vehicle.destination = centre = self._sane(item.place)
        centre_m = geodesy.offset_m(self.vehicle.origin, centre)
        radius_m = math.copysign(max(abs(item.params[2]), SMALLEST_CIRCLE_M), item.params[2])
        begin_circle(self.vehicle.control[0], self.vehicle.estimate[0], *centre_m, radius_m)
        self.auto.submode = Submode.CIRCLE

    def _hand_over(self, item: Item) -> None:
        """NAV_GUIDED_ENABLE: guided within AUTO; with 0 nothing begins."""
        if not item.params[0] > 0.0:
            return
        old = self.auto.guided
        self.auto.submode = Submode.GUIDED
        begin_driving(self.vehicle)
        stand(self.vehicle)
        place = item.place if item.place != (0, 0) else None
        height_m = item.z if item.frame != items.ABSOLUTE else item.z - ALTITUDE_M
        self.auto.guided = GuidedTask(
            place, height_m, self.vehicle.time_s, self.vehicle.place(), None, old.limit_s, old.limit_m
        )

    def _turn(self, item: Item) -> None:
        heading_deg, speed_m_s, relative, _ = item.params
        heading_rad = math.radians(heading_deg) + (self.vehicle.heading_rad() if relative > 0.0 else 0.0)
        limit_m_s = self.vehicle.parameters["WP_SPEED"]
        self.auto.submode, self.auto.turned, self.auto.heading_rad = Submode.HEADING, False, heading_rad
        control = self.vehicle.control
        control["task"], control["target_heading"] = HEADING, heading_rad
        control["target_speed"] = min(max(speed_m_s, -limit_m_s), limit_m_s)
        control["target_turn_rate"] = 0.0
        control["have_target"] = 1
        control["target_tick"] = control["tick"]

    def _wait(self, item: Item) -> None:
        """NAV_DELAY; without a clock, a time of day means no delay."""
        self._stop()
        self.auto.delay_since_s = self.vehicle.time_s
        self.auto.delay_s = max(item.params[0], 0.0)
        self.vehicle.say(Severity.INFO, f"Delaying {int(self.auto.delay_s)} sec")

    # Checking -------------------------------------------------------------------------------------------------------

    def verify(self, index: int, item: Item) -> bool:
        """Whether a command is done; each end is reported with MISSION_ITEM_REACHED."""
        if item.command in ELSEWHERE:
            return True
        done = self._done(index, item)
        if done:
            for channel in self.vehicle.channels.values():
                channel.send(mavlink.MAVLink_mission_item_reached_message(index))
        return done

    def _done(self, index: int, item: Item) -> bool:
        now_s, auto, command = self.vehicle.time_s, self.auto, item.command
        if command in (items.WAYPOINT, items.LOITER_UNLIMITED):
            return self._there(index) and command == items.WAYPOINT
        if command == items.LOITER_TIME:
            done = self._there(index)
            if done:
                self.vehicle.say(Severity.WARNING, "Finished active loiter")
            return done
        if command == items.RETURN:
            return arrived(self.vehicle)
        if command == items.LOITER_TURNS:
            return float(self.vehicle.control[0]["circle_turned"]) / (2.0 * math.pi) >= item.params[0]
        if command == items.GUIDED_ENABLE:
            return item.params[0] == 0.0 or self._handed_back()
        if command == items.SET_YAW_SPEED:
            return auto.submode != Submode.HEADING or auto.turned
        if command == items.DELAY:
            return now_s - auto.delay_since_s > auto.delay_s
        if command == items.CONDITION_DELAY:
            return now_s - auto.condition_since_s > auto.condition
        if command == items.CONDITION_DISTANCE:
            return self._left_m() < auto.condition
        if command not in DONE_AT_ONCE:
            self.vehicle.say(Severity.WARNING, f"Skipping invalid cmd #{command}")
        return True

    def _there(self, index: int) -> bool:
        """Whether a waypoint was reached and its loiter time has passed."""
        if not arrived(self.vehicle):
            return False
        auto = self.auto
        if not auto.reached:
            auto.reached, auto.loitering_since_s = True, self.vehicle.time_s
            stay = f". Loiter for {int(auto.loiter_s)} seconds" if auto.loiter_s > 0.0 else ""
            self.vehicle.say(Severity.INFO, f"Reached waypoint #{index}{stay}")
        return self.vehicle.time_s - auto.loitering_since_s >= auto.loiter_s

    def _handed_back(self) -> bool:
        """Whether guided within AUTO ends: near its place, or beyond a limit of time or distance."""
        task, here = self.auto.guided, self.vehicle.place()
        if self.auto.submode != Submode.GUIDED:
            return True
        if task.place is not None and distance_m(here, task.place) <= self.vehicle.parameters["WP_RADIUS"]:
            return True
        if 0.0 < task.limit_s <= self.vehicle.time_s - task.began_s:
            return True
        return 0.0 < task.limit_m < distance_m(here, task.began_at)

    def _left_m(self) -> float:
        """Metres to the destination; 0 without one."""
        if self.auto.submode in (Submode.STOP, Submode.HEADING):
            return 0.0
        return distance_m(self.vehicle.place(), self.vehicle.destination)


HANDED_OVER_EVERY_S = 1.0

RELATIVE_INT, PLACE_ONLY = 6, 3576
"""Frame and type mask of the target that is sent."""

TURNED_RAD = math.radians(5.0)


def run_auto(vehicle: Vehicle) -> None:
    """Run AUTO for one moment: begin, check and change mission commands."""
    auto, mission, runner = vehicle.auto, vehicle.mission, AutoRunner(vehicle)
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
                Severity.CRITICAL,
                "Auto mission changed, restarted command"
                if done
                else "Auto mission changed but failed to restart command",
            )
        mission.update(runner)
    if auto.submode == Submode.RETURN:
        run_return(vehicle)
    elif auto.submode == Submode.GUIDED:
        _send_target(vehicle)
    elif auto.submode == Submode.HEADING:
        _run_heading(vehicle)


def _changed(vehicle: Vehicle) -> bool:
    """Whether the present command or one of the next two was replaced."""
    auto, mission = vehicle.auto, vehicle.mission
    same_index = auto.seen_index == mission.nav_index
    if same_index and auto.seen_changes == mission.changes:
        return False
    before = auto.seen_items
    auto.seen_index, auto.seen_changes, auto.seen_items = mission.nav_index, mission.changes, mission.ahead()
    return same_index and mission.nav_running and before != auto.seen_items


def _run_heading(vehicle: Vehicle) -> None:
    """NAV_SET_YAW_SPEED: its target does not time out; the rover stops when it has turned."""
    auto, control = vehicle.auto, vehicle.control
    control["target_tick"] = control["tick"]
    error = (auto.heading_rad - vehicle.heading_rad() + math.pi) % (2.0 * math.pi) - math.pi
    if not auto.turned and abs(error) < TURNED_RAD:
        auto.turned = True
        stand(vehicle)


def _send_target(vehicle: Vehicle) -> None:
    """Guided within AUTO: once a second, send the place to the first onboard controller that was heard."""
    task = vehicle.auto.guided
    if task.place is None or (task.sent_s is not None and vehicle.time_s - task.sent_s <= HANDED_OVER_EVERY_S):
        return
    task.sent_s = vehicle.time_s
    if vehicle.onboard_controller is None:
        return
    system, component, number = vehicle.onboard_controller
    if number in vehicle.channels:
        vehicle.channels[number].send(
            mavlink.MAVLink_set_position_target_global_int_message(
                vehicle.time_us // 1000, system, component, RELATIVE_INT, PLACE_ONLY, *task.place,
                task.height_m * 100.0,
                *[0.0] * 8,
            )
        )  # fmt: skip


def set_mission_current(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_SET_CURRENT: answered with MISSION_CURRENT of this number, or not at all."""
    if vehicle.mission.set_current(message.seq, AutoRunner(vehicle)):
        channel.send(mission_current(vehicle, message.seq))
