"""What faults of GPS, battery, pilot, power, sensors and wheels do to the vehicle, by its messages and by the truth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.parameters import steered_wheels
from sitl.faults.plan import (
    BatteryLow,
    Fault,
    FaultPlan,
    FixName,
    GpsFixChange,
    GpsFixUntold,
    GpsGlitch,
    GpsLoss,
    GpsNoise,
    PilotTakesOver,
    Reboot,
    SensorFault,
    WheelSlip,
)
from sitl.sensors.range_sensors import Defect
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.shared_data import SHARED, needs_shared
from tests.support.sitl_client import HOME, Client, open_ground, ready
from tests.support.tlog import messages, raw_packets

RECORDINGS = SHARED / "data" / "ardurover-4.7-transcripts"
HOLD, GUIDED, MANUAL, RTL = 4, 15, 0, 11
ARMED = 128
GLITCH = 32768
Seen = list[tuple[float, Any]]


def faulty(*faults: Fault, **options: Any) -> Simulator:
    return open_ground(faults=FaultPlan(faults), **options)


def watched(client: Client, until_s: float) -> Seen:
    """Everything heard, and when, to a tenth of a second."""
    for number in (24, 32, 33, 193):
        client.command(511, number, 100_000)
    seen: Seen = []
    while client.simulator.time_s < until_s - 1e-6:
        seen += [(client.simulator.time_s, m) for m in client.run_for(0.1)]
    return seen


def said(seen: Seen) -> dict[str, float]:
    """When each text was first heard."""
    times: dict[str, float] = {}
    for time_s, m in seen:
        if m.get_type() == "STATUSTEXT":
            times.setdefault(m.text, time_s)
    return times


def of(seen: Seen, kind: str, since_s: float = 0.0, until_s: float = math.inf) -> Seen:
    return [(t, m) for t, m in seen if m.get_type() == kind and since_s < t <= until_s]


def driven(*faults: Fault, until_s: float, **options: Any) -> tuple[Client, Seen]:
    """A rover on its way north since 43 s."""
    client = ready(faulty(*faults, **options))
    client.drive_to(500.0, 0.0)
    return client, watched(client, until_s)


# GPS -----------------------------------------------------------------------------------------------------------------


def test_gps_lost_leads_to_hold_after_8_seconds_and_stays_there() -> None:
    client, seen = driven(GpsLoss(50.0, 75.0), until_s=80.0)
    times = said(seen)
    assert times["EKF failsafe"] == pytest.approx(58.0, abs=0.2)
    assert times["EKF variance"] == pytest.approx(58.0, abs=0.2)
    assert times["AHRS: DCM active"] == pytest.approx(57.0, abs=0.2)
    assert times["EKF3 IMU0 stopped aiding"] == pytest.approx(65.0, abs=0.2)
    assert times["EKF3 IMU0 is using GPS"] == pytest.approx(75.0, abs=0.2)
    assert times["EKF failsafe cleared"] == pytest.approx(76.0, abs=0.3)
    severities = {m.text: m.severity for _, m in of(seen, "STATUSTEXT")}
    assert severities["EKF failsafe"] == severities["EKF variance"] == 2
    modes = [(m.custom_mode, bool(m.base_mode & ARMED)) for _, m in of(seen, "HEARTBEAT")]
    assert modes[0] == (GUIDED, True)
    assert modes[-1] == (HOLD, True)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)


def test_what_is_reported_without_gps() -> None:
    _, seen = driven(GpsLoss(50.0, 75.0), until_s=80.0)
    flags = [(t, m.flags) for t, m in of(seen, "EKF_STATUS_REPORT")]
    assert {flag for t, flag in flags if t <= 57.0} == {831}
    assert {flag for t, flag in flags if 57.2 < t <= 65.0} == {37}
    assert {flag for t, flag in flags if 65.2 < t <= 75.0} == {167}
    assert {flag for t, flag in flags if t > 75.2} == {831}
    assert of(seen, "GPS_RAW_INT", 50.2, 53.9) == []
    assert {m.fix_type for _, m in of(seen, "GPS_RAW_INT", 54.2, 75.0)} == {0}
    assert {m.fix_type for _, m in of(seen, "GPS_RAW_INT", 75.2)} == {6}
    assert of(seen, "LOCAL_POSITION_NED", 57.2, 75.0) == []
    assert len(of(seen, "LOCAL_POSITION_NED", 75.2)) > 40
    stale = [m for _, m in of(seen, "GLOBAL_POSITION_INT", 57.2, 75.0)]
    assert len(stale) > 170
    assert len({(m.lat, m.lon) for m in stale}) == 1
    assert {(m.vx, m.vy) for m in stale} == {(0, 0)}


def test_without_gps_guided_is_refused() -> None:
    client, _ = driven(GpsLoss(50.0), until_s=60.0)
    assert client.set_mode(GUIDED) == 4
    assert "Flight mode change failed" in client.texts()
    client.command(400, 0)
    client.run_for(0.2)
    assert client.set_mode(MANUAL) == 0
    assert client.arm() == 0


def test_a_short_loss_is_bridged() -> None:
    client, seen = driven(GpsLoss(50.0, 56.0), until_s=60.0)
    assert "EKF failsafe" not in said(seen)
    assert {m.flags for _, m in of(seen, "EKF_STATUS_REPORT")} == {831}
    assert client.simulator.truth.speed_m_s > 2.5


def test_dead_reckoning_drifts_and_gps_puts_it_right() -> None:
    drifts = []
    for seed in range(12):
        client = ready(faulty(GpsLoss(45.0, 51.0), seed=seed))
        client.run_to(51.0)
        position = client.simulator._vehicle.position_m()
        drifts.append(math.hypot(position[0], position[1]))
        client.run_to(60.0)
        assert math.hypot(*client.simulator._vehicle.position_m()) < 0.01
    # 0.03 m/s^2 on both axes for 6 s: a Rayleigh distribution of 0.54 m; the mean of 12 lies within 4 standard errors.
    assert 0.25 < float(np.mean(drifts)) < 1.1


def test_a_glitch_is_refused_then_believed() -> None:
    _, seen = driven(GpsGlitch(50.0, 75.0, metres=8.0, bearing_deg=90.0), until_s=95.0)
    times = said(seen)
    east_m = {round(t, 1): m.y for t, m in of(seen, "LOCAL_POSITION_NED")}
    assert abs(east_m[53.8]) < 0.1
    assert east_m[54.2] == pytest.approx(8.0, abs=0.3)
    assert times["AHRS: DCM active"] == pytest.approx(54.0, abs=0.2)
    assert times["EKF failsafe"] == pytest.approx(55.0, abs=0.2)
    assert times["AHRS: EKF3 active"] == pytest.approx(60.0, abs=0.3)
    assert times["EKF failsafe cleared"] == pytest.approx(61.0, abs=0.4)
    flags = [(t, bool(m.flags & GLITCH)) for t, m in of(seen, "EKF_STATUS_REPORT")]
    assert not any(flag for t, flag in flags if t <= 51.0)
    assert all(flag for t, flag in flags if 51.3 < t <= 69.7 or t > 76.3)
    assert not any(flag for t, flag in flags if 70.3 < t <= 76.0)
    first_s, raw = of(seen, "GPS_RAW_INT", 50.0)[0]
    assert first_s == pytest.approx(50.1, abs=0.11)
    assert abs(raw.lon - of(seen, "GPS_RAW_INT", 49.0, 50.0)[-1][1].lon) * 1e-7 * 90_800 == pytest.approx(8.0, abs=0.3)


def test_a_short_glitch_leaves_a_flag_for_ten_seconds() -> None:
    client, seen = driven(GpsGlitch(50.0, 53.0, metres=8.0), until_s=70.0)
    assert "EKF failsafe" not in said(seen)
    flagged = [t for t, m in of(seen, "EKF_STATUS_REPORT") if m.flags & GLITCH]
    assert flagged[0] == pytest.approx(51.1, abs=0.2)
    assert flagged[-1] == pytest.approx(63.0, abs=0.2)
    assert client.simulator.truth.speed_m_s > 2.5


def test_a_small_error_is_followed() -> None:
    client = ready(faulty(GpsGlitch(45.0, metres=2.0, bearing_deg=0.0)))
    client.run_to(46.0)
    assert client.simulator._vehicle.position_m()[0] == pytest.approx(2.0 * (1.0 - math.exp(-1.0)), abs=0.25)
    client.run_to(52.0)
    assert client.simulator._vehicle.position_m()[0] == pytest.approx(2.0, abs=0.02)
    assert not [text for text in client.texts() if "failsafe" in text]


def test_a_glitch_goes_any_way_unless_told() -> None:
    bearings = []
    for seed in range(40):
        simulator = faulty(GpsGlitch(44.0, metres=2.0), seed=seed)
        simulator.advance_to_s(50.0)
        north_m, east_m = simulator._vehicle.position_m()
        bearings.append(math.atan2(east_m, north_m))
    # The mean direction of 40 even draws is longer than 0.45 in one run of 3000.
    assert math.hypot(float(np.mean(np.cos(bearings))), float(np.mean(np.sin(bearings)))) < 0.45


def test_gps_noise_has_the_size_it_says() -> None:
    simulator = faulty(GpsNoise(42.5, metres=0.5, time_s=5.0))
    errors = []
    for step in range(2000):
        simulator.advance_to_s(60.0 + step)
        errors.append(simulator._vehicle.ekf.gps.error_m)
    # 2000 s hold about 200 independent values on each axis: the standard deviation is known to 5 %.
    assert np.std(np.array(errors), axis=0) == pytest.approx([0.5, 0.5], abs=0.1)
    assert np.mean(np.array(errors), axis=0) == pytest.approx([0.0, 0.0], abs=0.2)


def test_gps_missing_at_the_start_holds_up_what_needs_it() -> None:
    client = Client(faulty(GpsLoss(0.0, 60.0)))
    seen: Seen = []
    while client.simulator.time_s < 75.0:
        seen += [(client.simulator.time_s, m) for m in client.run_for(0.1)]
    times = said(seen)
    assert {m.fix_type for _, m in of(seen, "GPS_RAW_INT", 0.0, 60.0)} == {0}
    assert of(seen, "HOME_POSITION")[0][0] == pytest.approx(60.2, abs=0.3)
    assert times["EKF3 IMU0 origin set"] == pytest.approx(60.2, abs=0.3)
    assert times["EKF3 IMU0 is using GPS"] == pytest.approx(70.2, abs=0.3)
    flags = [(t, m.flags) for t, m in of(seen, "EKF_STATUS_REPORT")]
    assert {flag for t, flag in flags if 10.0 < t < 70.0} == {167}
    assert flags[-1][1] == 831


# Battery -------------------------------------------------------------------------------------------------------------


def parameters(**values: float) -> dict[str, float]:
    return values


def test_the_battery_follows_the_motors() -> None:
    client = ready(open_ground())
    client.run_for(2.0)
    idle = client.of("SYS_STATUS")[-1]
    assert (idle.voltage_battery, idle.current_battery, idle.battery_remaining) == (12600, 0, 100)
    client.drive_to(200.0, 0.0)
    client.run_for(8.0)
    driving, battery = client.of("SYS_STATUS")[-1], client.of("BATTERY_STATUS")[-1]
    servo = client.of("SERVO_OUTPUT_RAW")[-1]
    amps = 50.0 * 0.5 * (abs(servo.servo1_raw - 1500) + abs(servo.servo3_raw - 1500)) / 500.0
    assert amps > 30.0
    assert driving.current_battery / 100.0 == pytest.approx(amps, abs=0.2)
    assert driving.voltage_battery == pytest.approx(12600 - 14.0 * amps, abs=5)
    assert battery.voltages[0] == driving.voltage_battery
    assert 50 < battery.current_consumed < 90
    assert battery.energy_consumed == pytest.approx(battery.current_consumed * 12.15 * 0.036, abs=1.5)
    assert battery.battery_remaining == math.floor(100 * (1 - battery.current_consumed / 3300))


@needs_shared
def test_current_and_voltage_are_those_of_the_recordings() -> None:
    """Every recorded voltage is what our battery has under the recorded current; what is left follows what was used."""
    recorded = [m for name in ("guided-drive", "rangefinders", "commands-and-acks")
                for m in messages(b"".join(raw_packets(RECORDINGS / f"{name}.tlog")))]  # fmt: skip
    battery = open_ground()._vehicle.battery
    table = open_ground()._vehicle.parameters
    statuses = [m for m in recorded if m.get_type() == "SYS_STATUS" and m.current_battery > 0]
    assert len(statuses) > 50
    for m in statuses:
        assert battery.volts(table, 0.0, m.current_battery / 100.0) * 1000.0 == pytest.approx(m.voltage_battery, abs=2)
    for m in [m for m in recorded if m.get_type() == "BATTERY_STATUS" and m.current_consumed > 0]:
        used = (m.current_consumed, m.current_consumed + 1)
        assert m.battery_remaining in [int(100 - 100 * mah / 3300) for mah in used]


def test_a_low_battery_is_told_once() -> None:
    client, seen = driven(BatteryLow(50.0, volts=10.6), until_s=75.0)
    texts = [m.text for _, m in of(seen, "STATUSTEXT") if "Battery" in m.text]
    assert len(texts) == 1
    assert texts[0].startswith("Battery 1 is low 10.")
    assert said(seen)[texts[0]] == pytest.approx(61.5, abs=1.1)
    assert [m.severity for _, m in of(seen, "STATUSTEXT") if "Battery" in m.text] == [4]
    assert client.of("HEARTBEAT")[-1].custom_mode == GUIDED
    assert client.of("BATTERY_STATUS")[-1].charge_state == 2
    assert not client.of("SYS_STATUS")[-1].onboard_control_sensors_health & (1 << 25)


@pytest.mark.parametrize(
    ("action", "mode", "armed"), [(0, GUIDED, True), (1, RTL, True), (2, HOLD, True), (3, 12, True), (5, GUIDED, False)]
)
def test_what_a_low_battery_leads_to(action: int, mode: int, armed: bool) -> None:
    options = parameters(BATT_FS_LOW_ACT=action)
    client, _ = driven(BatteryLow(45.0, volts=10.0), until_s=60.0, parameters=options)
    last = client.of("HEARTBEAT")[-1]
    assert (last.custom_mode, bool(last.base_mode & ARMED)) == (mode, armed)


def test_critical_comes_after_low() -> None:
    options = parameters(BATT_CRT_VOLT=9.5, BATT_FS_CRT_ACT=2, BATT_LOW_TIMER=3)
    faults = (BatteryLow(45.0, volts=10.4), BatteryLow(55.0, volts=9.0))
    client, seen = driven(*faults, until_s=65.0, parameters=options)
    times = {text.split()[3]: t for text, t in said(seen).items() if text.startswith("Battery 1 is ")}
    assert times["low"] < 50.5
    assert 58.0 < times["critical"] < 60.5
    assert client.of("HEARTBEAT")[-1].custom_mode == HOLD
    assert client.of("BATTERY_STATUS")[-1].charge_state == 3


def test_a_low_battery_cannot_be_armed() -> None:
    client = Client(faulty(BatteryLow(10.0, volts=10.0)))
    client.run_to(44.0)
    assert client.arm() == 4
    assert "Arm: Battery 1 low voltage failsafe" in client.texts()


def test_the_capacity_that_is_left_counts_as_well() -> None:
    options = parameters(BATT_CAPACITY=100, BATT_LOW_MAH=50, BATT_FS_LOW_ACT=2)
    client, seen = driven(until_s=60.0, parameters=options)
    assert [text for text in said(seen) if text.startswith("Battery 1 is low 12.")]
    assert client.of("HEARTBEAT")[-1].custom_mode == HOLD


def test_a_pack_with_a_capacity_runs_down() -> None:
    client, _ = driven(until_s=75.0, parameters=parameters(SIM_BATT_CAP_AH=0.5))
    client.set_mode(HOLD)
    client.run_for(5.0)
    assert 9.5 < client.of("SYS_STATUS")[-1].voltage_battery / 1000.0 < 12.0


# Pilot ---------------------------------------------------------------------------------------------------------------


def test_the_switch_is_where_it_was_after_a_power_failure() -> None:
    """The autopilot reads it when it boots; its pilot lets go of it long after that."""
    simulator = faulty(Reboot(50.0, 53.0), PilotTakesOver(48.0, 70.0, mode="HOLD"))
    ready(simulator).run_to(54.0)
    client = Client(simulator)
    client.run_to(69.0)
    assert heartbeat_mode(client) == HOLD
    client.run_to(72.0)
    assert heartbeat_mode(client) == MANUAL


@pytest.mark.parametrize("later_first", [False, True])
def test_of_two_spans_of_the_pilot_that_overlap_the_one_that_is_left_holds_the_switch(later_first: bool) -> None:
    faults = [PilotTakesOver(50.0, 55.0, mode="MANUAL", throttle=0.5), PilotTakesOver(52.0, 60.0, mode="HOLD")]
    client = ready(faulty(*(reversed(faults) if later_first else faults)))
    for time_s, mode in ((51.5, MANUAL), (54.0, HOLD), (59.0, HOLD), (62.0, GUIDED)):
        client.run_to(time_s)
        assert heartbeat_mode(client) == mode, time_s
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)


def heartbeat_mode(client: Client) -> int:
    beats = [m for m in client.received if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1]
    return int(beats[-1].custom_mode)


def test_the_pilot_takes_over_and_gives_back() -> None:
    client, seen = driven(PilotTakesOver(50.0, 55.0, mode="HOLD"), until_s=60.0)
    modes = [(round(t), m.custom_mode) for t, m in of(seen, "HEARTBEAT")]
    assert [mode for t, mode in modes if t < 50] == [GUIDED] * len([1 for t, _ in modes if t < 50])
    assert {mode for t, mode in modes if 51 <= t < 55} == {HOLD}
    assert {mode for t, mode in modes if t > 55} == {GUIDED}
    assert of(seen, "COMMAND_ACK", 50.0) == []
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01), "HOLD forgets the target"


def test_the_sticks_drive_in_manual() -> None:
    fault = PilotTakesOver(50.0, 54.0, mode="MANUAL", throttle=0.5, steering=0.2)
    client = ready(faulty(fault))
    client.run_to(53.5)
    truth = client.simulator.truth
    assert truth.speed_m_s == pytest.approx(2.0, abs=0.1)
    assert truth.yaw_rate_rad_s == pytest.approx(2.0 * 0.2 * math.radians(140.0), abs=0.05)
    channels = client.of("RC_CHANNELS")[-1]
    assert (channels.chan1_raw, channels.chan3_raw) == (1600, 1750)
    client.run_to(60.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)
    assert client.of("RC_CHANNELS")[-1].chan3_raw == 1500
    assert client.of("HEARTBEAT")[-1].custom_mode == GUIDED


def override(client: Client, steering_us: int, throttle_us: int) -> None:
    values = (steering_us, 65535, throttle_us, *([65535] * 5))
    client.send(mavlink.MAVLink_rc_channels_override_message(1, 1, *values))


def test_a_ground_station_drives_with_overrides() -> None:
    client = ready(open_ground(), system=255, component=190)
    client.set_mode(MANUAL)
    override(client, 1500, 1750)
    client.run_for(2.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(2.0, abs=0.1)
    override(client, 65535, 0)
    client.run_for(3.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)


def test_an_override_that_is_not_repeated_is_forgotten() -> None:
    client = ready(open_ground(), system=255, component=190)
    client.set_mode(MANUAL)
    override(client, 1500, 1750)
    client.run_for(2.5)
    assert client.simulator.truth.speed_m_s > 1.9
    client.run_for(4.0)
    assert client.simulator.truth.speed_m_s < 0.1


def test_when_the_override_ends_the_transmitter_counts_again() -> None:
    client = ready(faulty(PilotTakesOver(50.0, 62.0, mode="MANUAL", throttle=0.5)), system=255, component=190)
    client.run_to(52.0)
    override(client, 1500, 1500)
    client.run_to(54.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.05), "the override goes before"
    client.run_to(60.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(2.0, abs=0.1)


def test_only_the_ground_station_may_override_and_only_in_manual() -> None:
    companion = ready(open_ground())
    override(companion, 1500, 1750)
    companion.set_mode(MANUAL)
    companion.run_for(2.0)
    assert companion.simulator.truth.speed_m_s == 0.0
    station = ready(open_ground(), system=255, component=190)
    override(station, 1500, 1750)
    station.run_for(2.0)
    assert station.simulator.truth.speed_m_s == 0.0


# Power ---------------------------------------------------------------------------------------------------------------


def test_a_power_failure_stops_drops_and_boots() -> None:
    simulator = faulty(Reboot(50.0, 54.0))
    client = ready(simulator)
    client.command(400, 1)
    client.drive_to(500.0, 0.0)
    client.run_to(50.5)
    assert client.link.dropped
    again = Client(simulator)
    again.run_to(53.9)
    assert again.received == []
    assert simulator.truth.speed_m_s < 0.01
    here_m = simulator.truth.north_m
    again = Client(simulator)
    again.run_to(54.5)
    while not again.of("HEARTBEAT") and simulator.time_s < 56.0:
        again = Client(simulator) if again.link.dropped else again
        again.run_for(0.5)
    assert again.of("HEARTBEAT")[0].custom_mode == MANUAL
    again.run_to(54.0 + 44.0)
    assert again.of("SYSTEM_TIME")[-1].time_boot_ms == pytest.approx(44_000, abs=1_000)
    assert not again.of("HEARTBEAT")[-1].base_mode & ARMED
    assert again.of("LOCAL_POSITION_NED")[-1].x == pytest.approx(0.0, abs=0.1)
    assert simulator.truth.north_m == pytest.approx(here_m, abs=0.01)


# Sensors -------------------------------------------------------------------------------------------------------------


def towards_a_wall(suite: str, *faults: Fault, north_m: int = 6) -> Client:
    obstacles = np.zeros((60, 21), dtype=bool)
    obstacles[north_m, :] = True
    world, start = World(obstacles), SimStart(2.5, 10.5, 0.0, HOME)
    client = ready(Simulator(world, start, suite, faults=FaultPlan(faults)))
    client.drive_at(0.5)
    return client


def test_a_silent_lidar_keeps_its_heartbeat() -> None:
    client = towards_a_wall("lidar-90", SensorFault(46.0, 50.0, defect=Defect.SILENT))
    scans = []
    while client.simulator.time_s < 54.0:
        scans += [client.simulator.time_s for m in client.run_for(0.1) if m.get_type() == "OBSTACLE_DISTANCE"]
    assert not [t for t in scans if 46.15 < t < 49.95]
    assert len([t for t in scans if t > 50.1]) >= 38
    beats = [m for m in client.of("HEARTBEAT") if m.get_srcComponent() == 196]
    assert len(beats) >= 10


def test_a_stuck_lidar_repeats_itself() -> None:
    client = towards_a_wall("lidar-90", SensorFault(46.0, 50.0, defect=Defect.STUCK))
    client.run_to(46.2)
    client.received.clear()
    client.run_to(49.9)
    stuck = {tuple(m.distances) for m in client.of("OBSTACLE_DISTANCE")}
    assert len(stuck) == 1
    client.received.clear()
    client.run_to(53.0)
    assert len({tuple(m.distances) for m in client.of("OBSTACLE_DISTANCE")}) > 20


@pytest.mark.parametrize("defect", [Defect.STUCK, Defect.STUCK_IN_VIEW])
def test_a_lidar_that_is_stuck_in_view_shows_something_for_ever(defect: Defect) -> None:
    client = towards_a_wall("lidar-90", SensorFault(46.0, defect=defect), north_m=9)
    client.received.clear()
    for _ in range(6):
        client.drive_at(0.5)
        client.run_for(2.0)
    scans = [tuple(m.distances) for m in client.of("OBSTACLE_DISTANCE")]
    nothing, *shown = [scan for number, scan in enumerate(scans) if not number or scan != scans[number - 1]]
    assert min(nothing) == 451
    assert [min(scan) <= 450 for scan in shown] == ([True] if defect is Defect.STUCK_IN_VIEW else [])
    assert len(scans) > 80


def test_single_beams_fail_on_their_own() -> None:
    faults = (SensorFault(45.0, defect=Defect.SILENT, beams=(1,)), SensorFault(45.0, defect=Defect.STUCK, beams=(3,)))
    client = towards_a_wall("beams", *faults)
    client.command(511, 132, 100_000)
    client.run_to(45.3)
    client.received.clear()
    client.run_to(53.0)
    readings: dict[int, set[int]] = {}
    for m in client.of("DISTANCE_SENSOR"):
        readings.setdefault(m.id, set()).add(m.current_distance)
    assert set(readings) == {1, 2}
    assert len(readings[2]) == 1
    assert client.of("RANGEFINDER")


# Wheels --------------------------------------------------------------------------------------------------------------


def rolled(*faults: Fault, **options: Any) -> Any:
    """The truth after some seconds with half throttle in MANUAL."""
    simulator = faulty(PilotTakesOver(44.0, mode="MANUAL", throttle=0.5), *faults, **options)
    client = ready(simulator)
    client.run_to(48.0)
    return simulator.truth


def test_wheels_that_slip_drive_slower() -> None:
    assert rolled().speed_m_s == pytest.approx(2.0, abs=0.01)
    assert rolled(WheelSlip(44.0, share=0.5)).speed_m_s == pytest.approx(1.0, abs=0.01)
    assert rolled(WheelSlip(44.0, share=1.0)).speed_m_s == pytest.approx(0.0, abs=0.01)
    assert rolled(WheelSlip(44.0, 45.0, share=1.0)).speed_m_s == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize(("side", "sign"), [("left", -1.0), ("right", 1.0)])
def test_wheels_that_slip_on_one_side_pull_to_it(side: Any, sign: float) -> None:
    truth = rolled(WheelSlip(44.0, share=0.4, side=side))
    assert truth.speed_m_s == pytest.approx(1.6, abs=0.01)
    assert truth.yaw_rate_rad_s == pytest.approx(sign * 0.2 * math.radians(140.0), abs=0.01)


def test_steered_wheels_only_get_slower() -> None:
    options = {"turning_radius_m": 2.0, "parameters": steered_wheels(2.0)}
    truth = rolled(WheelSlip(44.0, share=0.4, side="left"), **options)
    assert truth.speed_m_s == pytest.approx(1.6, abs=0.01)
    assert truth.yaw_rate_rad_s == 0.0


# Time ----------------------------------------------------------------------------------------------------------------


def test_driving_begins_when_the_rover_has_moved() -> None:
    client = ready(faulty(PilotTakesOver(3.0, since="driving", mode="HOLD")))
    client.run_to(60.0)
    assert client.of("HEARTBEAT")[-1].custom_mode == GUIDED
    client.drive_to(100.0, 0.0)
    while client.simulator.truth.north_m < 0.1:
        client.run_for(0.02)
    moved_s = client.simulator.time_s
    client.run_to(moved_s + 2.8)
    assert client.simulator._vehicle.mode == GUIDED
    client.run_to(moved_s + 3.15)
    assert client.simulator._vehicle.mode == HOLD


@pytest.mark.parametrize(("fix", "number"), [(FixName.FIX_3D, 3), (FixName.DGPS, 4), (FixName.RTK_FLOAT, 5)])
def test_another_fix_is_told_and_its_error_is_followed_by_the_ekf(fix: FixName, number: int) -> None:
    fault = GpsFixChange(50.0, 60.0, fix=fix, metres=0.8, bearing_deg=90.0)
    client, seen = driven(fault, until_s=70.0)
    assert {m.fix_type for _, m in of(seen, "GPS_RAW_INT", 50.2, 60.0)} == {number}
    assert {m.fix_type for _, m in of(seen, "GPS_RAW_INT", 60.2)} == {6}
    assert {m.flags for _, m in of(seen, "EKF_STATUS_REPORT", 45.0)} == {831}
    assert driven(fault, until_s=59.0)[0].simulator.vehicle.ekf.offset_m == pytest.approx((0.0, 0.8), abs=0.01)
    assert client.simulator.vehicle.ekf.offset_m == pytest.approx((0.0, 0.0), abs=0.01)


def test_without_a_fix_the_receiver_says_so_and_the_ekf_goes_on_alone() -> None:
    _, seen = driven(GpsFixChange(50.0, 60.0, fix=FixName.NONE), until_s=70.0)
    assert {(m.fix_type, m.lat) for _, m in of(seen, "GPS_RAW_INT", 50.2, 60.0)} == {(1, 0)}
    assert {flag for t, m in of(seen, "EKF_STATUS_REPORT") if 57.2 < t <= 60.0 for flag in (m.flags,)} == {37}


def test_a_fix_that_is_not_told_is_one_all_the_same() -> None:
    _, seen = driven(GpsFixUntold(50.0, 60.0), until_s=70.0)
    assert of(seen, "GPS_RAW_INT", 50.2, 60.0) == [] and of(seen, "GPS_RAW_INT", 60.2)
    assert {m.flags for _, m in of(seen, "EKF_STATUS_REPORT", 45.0)} == {831}
