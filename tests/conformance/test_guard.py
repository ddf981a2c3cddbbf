"""The guard: the Lua script itself, run by a Lua interpreter on real packets, and the simulator's own."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lupa import LuaRuntime
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.vehicle.guard import name_of, script
from sitl.autopilot.guard import LOOK_US, Guard, guard_of
from sitl.autopilot.state import Mode

AUTOPILOT_OF_THE_SCRIPT = b"""
accepts = true
now_ms, mode, armed, queue, wanted, told, names, texts, parameters = 0, 0, false, {}, {}, {}, {}, {}, {}
function millis() return { toint = function() return now_ms end } end
vehicle = { get_mode = function() return mode end }
function vehicle:set_mode(new) if accepts then mode = new end return accepts end
arming = { is_armed = function() return armed end }
param = { get = function(_, name) return parameters[name] end }
switch_us = 1500
rc = { get_pwm = function(_, channel) return channel == 8 and switch_us or nil end }
gcs = {
  send_text = function(_, severity, text) texts[#texts + 1] = text end,
  send_named_float = function(_, name, value) told[#told + 1] = value names[#names + 1] = name end,
}
mavlink = {
  init = function() end,
  register_rx_msgid = function(_, id) wanted[id] = true end,
  receive_chan = function() return table.remove(queue, 1) end,
}
"""
SETPOINT = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 8, 1511, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0)
LIFE = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 0, 3)
OTHER = mavlink.MAVLink_timesync_message(0, 1)
HOLD_LONG = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, 4, 0, 0, 0, 0, 0)
HOLD_AUX = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_AUX_FUNCTION, 0, 54, 2, 0, 0, 0, 0, 0)
HOLD_INT = mavlink.MAVLink_command_int_message(1, 1, 0, mavlink.MAV_CMD_DO_SET_MODE, 0, 0, 1, 4, 0, 0, 0, 0, 0)
HOLD_SET = mavlink.MAVLink_set_mode_message(1, 1, 4)
ARM = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)


def packed(message: Any, component: int = 191, system: int = 1) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    return bytes(message.pack(sender))


class Script:
    """The script on an autopilot that runs it every 20 ms."""

    def __init__(self, waits_ms: float = 300.0, component: int = 191) -> None:
        self.lua = LuaRuntime(encoding=None)
        self.lua.execute(AUTOPILOT_OF_THE_SCRIPT)
        self.values = self.lua.globals()
        self.values[b"parameters"][b"SCR_USER1"] = waits_ms
        self.values[b"parameters"][b"MAV_SYSID"] = 1
        self.values[b"parameters"][b"MODE_CH"] = 8.0
        self._update = self.lua.execute(script(component).encode())[0]

    def hear(self, raw: bytes) -> None:
        """A packet as the firmware hands it over: check sum, header, payload."""
        if self.values[b"wanted"][int.from_bytes(raw[7:10], "little")]:
            self.lua.globals()[b"queue"][len(self.values[b"queue"]) + 1] = raw[-2:] + raw[:-2]

    def look(self) -> None:
        self.values[b"now_ms"] += LOOK_US // 1000
        self._update, after_ms = self._update()
        assert after_ms == LOOK_US // 1000

    def put(self, mode: int, armed: bool) -> None:
        self.values[b"mode"], self.values[b"armed"] = mode, armed

    def accepts(self, accepts: bool) -> None:
        """Whether HOLD is put when it is asked for."""
        self.values[b"accepts"] = accepts

    @property
    def mode(self) -> int:
        return int(self.values[b"mode"])

    @property
    def told_ms(self) -> float | None:
        told = list(self.values[b"told"].values())
        return told[-1] if told else None

    @property
    def name(self) -> bytes:
        """Under which it spoke last."""
        name: bytes = list(self.values[b"names"].values())[-1]
        return name


@dataclass
class Simulated:
    """The simulator's guard on an autopilot that does nothing else."""

    waits_ms: float = 300.0
    vehicle: Any = field(init=False)
    told_ms: float | None = None
    name: bytes = b""
    accepted: bool = True

    def __post_init__(self) -> None:
        parameters = {"SCR_USER1": self.waits_ms}
        channel = SimpleNamespace(send=self._tell)
        self.vehicle = SimpleNamespace(
            system=1, armed=False, mode=0, time_us=0, parameters=parameters, channels={0: channel}, say=lambda *_: None
        )
        self.guard = Guard(self.vehicle, self._set_mode)
        self._parser = mavlink.MAVLink(None)

    def _tell(self, message: Any) -> None:
        self.told_ms, self.name = message.value, message.name.encode()

    def _set_mode(self, vehicle: Any, mode: int) -> bool:
        if self.accepted:
            vehicle.mode = int(mode)
        return self.accepted

    def accepts(self, accepts: bool) -> None:
        self.accepted = accepts

    def hear(self, raw: bytes) -> None:
        self.guard.hear(self._parser.parse_char(raw))

    def look(self) -> None:
        self.vehicle.time_us += LOOK_US
        self.guard.run()

    def put(self, mode: int, armed: bool) -> None:
        self.vehicle.mode, self.vehicle.armed = mode, armed
        self.guard.run()

    @property
    def mode(self) -> int:
        return int(self.vehicle.mode)


Guards = Script | Simulated


def looks(guard: Guards, seconds: float, every_s: float = 1e9, raw: bytes = packed(LIFE)) -> None:
    for look in range(round(seconds / 0.02)):
        if look % round(every_s / 0.02) == 0 and every_s < 1e9:
            guard.hear(raw)
        guard.look()


@pytest.fixture(params=[Script, Simulated])
def guard(request: pytest.FixtureRequest) -> Guards:
    made: Guards = request.param()
    made.put(Mode.GUIDED, True)
    return made


def test_a_companion_that_falls_silent_while_it_drives_is_followed_by_hold(guard: Guards) -> None:
    looks(guard, 2.0, 0.1, packed(SETPOINT))
    assert guard.mode == Mode.GUIDED
    looks(guard, 0.2)
    assert guard.mode == Mode.GUIDED
    looks(guard, 0.04)
    assert guard.mode == Mode.HOLD


def test_hold_that_is_refused_is_asked_for_again_and_is_not_called_the_guards_doing(guard: Guards) -> None:
    guard.accepts(False)
    looks(guard, 0.5, 0.1, packed(SETPOINT))
    looks(guard, 1.5)
    assert guard.mode == Mode.GUIDED and guard.told_ms == 300.0
    guard.accepts(True)
    looks(guard, 0.02)
    assert guard.mode == Mode.HOLD
    looks(guard, 0.6)
    assert guard.told_ms == -300.0


def test_while_hold_is_refused_the_simulators_guard_looks_every_20_ms_and_no_sooner() -> None:
    there = Simulated()
    there.put(Mode.GUIDED, True)
    there.accepts(False)
    looks(there, 0.5, 0.1, packed(SETPOINT))
    looks(there, 0.5)
    assert there.guard.due_us() == there.vehicle.time_us + LOOK_US


@pytest.mark.parametrize("message", [HOLD_LONG, HOLD_INT, HOLD_SET, HOLD_AUX])
def test_a_hold_that_a_person_asks_for_as_well_is_not_its_doing_any_more(guard: Guards, message: Any) -> None:
    """The mode does not change, but a companion that is resumed must not take the rover from him."""
    looks(guard, 0.5, 0.1, packed(SETPOINT))
    looks(guard, 1.5)
    guard.hear(packed(ARM, component=190, system=255))
    looks(guard, 0.6)
    assert guard.told_ms == -300.0
    guard.hear(packed(message, component=190, system=255))
    looks(guard, 0.6)
    assert guard.mode == Mode.HOLD and guard.told_ms == 300.0


@pytest.mark.parametrize("silent_s", [0.14, 1.5])
def test_nor_is_one_in_which_or_just_before_which_a_pilot_moved_the_mode_switch(silent_s: float) -> None:
    """The autopilot takes a switch that has stayed for 0.2 s: by then the guard may have put HOLD."""
    there = Script()
    there.put(Mode.GUIDED, True)
    looks(there, 0.5, 0.1, packed(SETPOINT))
    looks(there, silent_s)
    there.lua.execute(b"switch_us = 1520")  # noise
    looks(there, 1.5)
    assert there.mode == Mode.HOLD and there.told_ms == -300.0
    there.lua.execute(b"switch_us = 1500")
    there.put(Mode.GUIDED, True)
    looks(there, 0.5, 0.1, packed(SETPOINT))
    looks(there, silent_s)
    there.lua.execute(b"switch_us = 1900")
    looks(there, 1.5)
    assert there.mode == Mode.HOLD and there.told_ms == 300.0


def test_it_asks_for_a_queue_with_room_for_all_that_it_listens_to() -> None:
    """``mavlink:init`` takes the queue's length and how many message ids may be registered."""
    asked, there = list[tuple[int, int]](), Script()
    there.values[b"mavlink"][b"init"] = lambda _, queue, ids: asked.append((queue, ids))
    there.lua.execute(script().encode())
    ((queue, ids),) = asked
    assert queue >= 10 and ids == len(list(there.values[b"wanted"].keys()))


def test_an_older_autopilot_has_another_name_for_its_id() -> None:
    there = Script()
    there.values[b"parameters"][b"MAV_SYSID"] = None
    there.values[b"parameters"][b"SYSID_THISMAV"] = 1
    there._update = there.lua.execute(script().encode())[0]
    there.put(Mode.GUIDED, True)
    looks(there, 0.5, 0.1, packed(SETPOINT))
    looks(there, 0.4)
    assert there.mode == Mode.HOLD


def test_heartbeats_are_a_sign_of_life_and_packets_of_others_are_not(guard: Guards) -> None:
    guard.hear(packed(SETPOINT))
    looks(guard, 2.0, 0.1)
    assert guard.mode == Mode.GUIDED
    looks(guard, 1.0, 0.1, packed(LIFE, component=190))
    assert guard.mode == Mode.HOLD


@pytest.mark.parametrize(("system", "message"), [(2, SETPOINT), (1, OTHER)])
def test_it_does_not_watch_a_rover_that_this_companion_does_not_drive(guard: Guards, system: int, message: Any) -> None:
    looks(guard, 1.0, 0.1, packed(LIFE))
    guard.hear(packed(message, system=system))
    looks(guard, 3.0)
    assert guard.mode == Mode.GUIDED


@pytest.mark.parametrize(("mode", "armed"), [(Mode.MANUAL, True), (Mode.HOLD, True), (Mode.GUIDED, False), (10, True)])
def test_it_never_acts_in_another_mode_nor_while_disarmed_nor_after_it(guard: Guards, mode: int, armed: bool) -> None:
    looks(guard, 0.5, 0.1, packed(SETPOINT))
    guard.put(mode, armed)
    looks(guard, 2.0)
    assert guard.mode == mode
    guard.put(Mode.GUIDED, True)
    looks(guard, 2.0)
    assert guard.mode == Mode.GUIDED, "somebody else drives in GUIDED now"


def test_it_tells_twice_a_second_how_long_it_waits_and_whether_hold_is_its_doing(guard: Guards) -> None:
    looks(guard, 0.6, 0.1, packed(SETPOINT))
    assert guard.told_ms == 300.0 and guard.name == name_of(191).encode()
    looks(guard, 2.0)
    assert guard.told_ms == -300.0
    guard.put(Mode.MANUAL, True)
    looks(guard, 0.6)
    assert guard.told_ms == 300.0


def test_a_hold_in_which_a_person_disarmed_the_rover_is_not_its_doing_any_more(guard: Guards) -> None:
    """Else a companion that is resumed would take the rover from whoever armed it again."""
    looks(guard, 1.1, 0.1, packed(SETPOINT))
    looks(guard, 2.0)
    assert guard.mode == Mode.HOLD and guard.told_ms == -300.0
    guard.put(Mode.HOLD, False)
    looks(guard, 1.1)
    guard.put(Mode.HOLD, True)
    looks(guard, 1.1)
    assert guard.told_ms == 300.0


def test_the_script_waits_within_bounds_and_for_the_component_it_was_made_for() -> None:
    for wanted, waits_ms in ((0.0, 300.0), (20.0, 200.0), (9000.0, 3000.0), (500.0, 500.0)):
        one = Script(wanted)
        looks(one, 1.1)
        assert one.told_ms == waits_ms
    other = Script(component=195)
    other.put(Mode.GUIDED, True)
    other.hear(packed(SETPOINT))
    looks(other, 1.0)
    assert other.mode == Mode.GUIDED
    other.hear(packed(SETPOINT, component=195))
    looks(other, 1.0)
    assert other.mode == Mode.HOLD and other.name == name_of(195).encode()


def test_an_autopilot_whose_system_id_cannot_be_read_is_not_guarded_and_not_told_to_be() -> None:
    one = Script()
    one.values[b"parameters"][b"MAV_SYSID"] = None
    one._update = one.lua.execute(script().encode())[0]
    one.put(Mode.GUIDED, True)
    looks(one, 2.0, 0.1, packed(SETPOINT))
    looks(one, 2.0)
    assert one.told_ms is None and one.mode == Mode.GUIDED


def test_the_simulators_guard_watches_the_component_of_the_script_that_was_uploaded() -> None:
    storage = SimpleNamespace(files={"scripts/companion_guard.lua": script(195).encode()})
    vehicle: Any = SimpleNamespace(parameters={"SCR_USER1": 0.0, "SCR_ENABLE": 1.0}, storage=storage)
    made = guard_of(vehicle, lambda *_: True)
    assert made is not None and made._component_id == 195
    storage.files = {"scripts/companion_guard.lua.new": script(195).encode()}
    assert guard_of(vehicle, lambda *_: True) is None, "an upload that did not end is started by nobody"


STEPS = st.one_of(
    st.tuples(
        st.just("hear"),
        st.sampled_from([SETPOINT, LIFE, OTHER, HOLD_LONG, HOLD_SET]),
        st.sampled_from([191, 190]),
        st.integers(1, 2),
    ),
    st.tuples(st.just("accepts"), st.booleans()),
    st.tuples(st.just("put"), st.sampled_from([0, 4, 10, 15, 15, 15]), st.sampled_from([True, True, False])),
    st.tuples(st.just("wait"), st.integers(1, 25)),
)


@given(steps=st.lists(STEPS, max_size=30), waits_ms=st.sampled_from([100.0, 300.0]))
def test_script_and_simulator_do_the_same(steps: list[tuple[Any, ...]], waits_ms: float) -> None:
    guards: tuple[Script, Simulated] = (Script(waits_ms), Simulated(waits_ms))
    for one in guards:
        one.put(Mode.GUIDED, True)
    for step in steps:
        for one in guards:
            match step:
                case ("hear", message, component, system):
                    one.hear(packed(message, component, system))
                    one.look()
                case ("put", mode, armed):
                    one.put(mode, armed)
                    one.look()
                case ("accepts", accepts):
                    one.accepts(accepts)
                case ("wait", count):
                    looks(one, 0.02 * count)
        assert guards[0].mode == guards[1].mode
        assert guards[0].told_ms == guards[1].told_ms
