"""Applies a fault plan to the vehicle: which faults are active now, and their effects.

Everything is a function of plan, seed and simulated time; each fault has its own random generator.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from sitl.autopilot.control.records import Record
from sitl.autopilot.ekf import NO_FIX, RTK_FIXED, STEP_S
from sitl.autopilot.modes import apply_sticks, report_ekf, set_mode
from sitl.autopilot.start_up import HOME_S, ORIGIN_S, POSITION_S
from sitl.autopilot.state import CommandTrouble, Mode, Sticks
from sitl.autopilot.vehicle import Vehicle
from sitl.faults.link_faults import Active, LinkQueue
from sitl.faults.plan import (
    BatteryLow,
    CommandFault,
    Fault,
    FaultPlan,
    FixName,
    GpsFixChange,
    GpsFixUntold,
    GpsGlitch,
    GpsLoss,
    GpsNoise,
    LidarFault,
    LinkFault,
    PilotTakesOver,
    Reboot,
    SensorFault,
    WheelSlip,
)
from sitl.sensors.range_sensors import Defect, RangeSensing
from sitl.sensors.serial_lidar import LineFaults, SerialLidar

DRIVING_M = 0.1
"""The rover counts as driving from this distance on."""
ALIGN_S = 10.0
"""Time for which the EKF must have seen a good GPS before it uses it."""
GPS_FAULTS = (GpsLoss, GpsGlitch, GpsNoise, GpsFixChange, GpsFixUntold)
FIX_TYPES = {
    FixName.NONE: NO_FIX, FixName.FIX_3D: 3, FixName.DGPS: 4, FixName.RTK_FLOAT: 5, FixName.RTK_FIXED: RTK_FIXED
}  # fmt: skip
OWN_STREAM = 0x4641554C
"""Separates the random draws of the faults from all others with the same seed."""


class FaultPlayer:
    """The active faults, and their effects on vehicle, sensors and wheels; links ask it for link faults."""

    def __init__(self, plan: FaultPlan, seed: int, lidars: Sequence[SerialLidar] = ()) -> None:
        """``seed``: the simulator's own; ``lidars``: those on serial lines of their own."""
        self._lidars = tuple(lidars)
        seeds = np.random.SeedSequence([OWN_STREAM, seed, plan.seed]).spawn(len(plan.faults) + 1)
        self._faults = [(fault, np.random.default_rng(one)) for fault, one in zip(plan.faults, seeds, strict=False)]
        self._ekf_rng = np.random.default_rng(seeds[-1])
        self._links: list[Active] = [(fault, rng) for fault, rng in self._faults if isinstance(fault, LinkFault)]
        self.touches_links = bool(self._links)
        """Whether any link fault is planned."""
        self._has_gps = any(isinstance(fault, GPS_FAULTS) for fault in plan.faults)
        self._awaits_driving = any(fault.since == "driving" for fault in plan.faults)
        self._driving_s = math.inf
        self._active: set[int] = set()
        self._changes_s = 0.0
        self._steps = 0
        self._noise_m = {i: (0.0, 0.0) for i, (fault, _) in enumerate(self._faults) if isinstance(fault, GpsNoise)}
        self._glitch_rad: dict[int, float] = {}
        self._mode_before: dict[int, Mode] = {}
        self._troubles: dict[int, CommandTrouble] = {}
        self._was_started = False
        self.due_s = 0.0
        """Time at which ``step`` must be called next."""
        self.reboot_until_s: float | None = None
        """Set when the autopilot loses power now: until when it is off. The simulator resets it."""

    # Time ------------------------------------------------------------------------------------------------------------

    def is_active(self, fault: Fault, now_s: float) -> bool:
        """Whether a fault is active."""
        return fault.at(self._elapsed_s(fault, now_s))[0]

    def pilot_acts(self, now_s: float) -> bool:
        """Whether a pilot has the rover."""
        return any(isinstance(one, PilotTakesOver) and self.is_active(one, now_s) for one, _ in self._faults)

    def _elapsed_s(self, fault: Fault, now_s: float) -> float:
        return now_s if fault.since == "boot" else now_s - self._driving_s

    def step(self, now_s: float, vehicle: Vehicle, rover: Record, sensing: RangeSensing) -> None:
        """Begin and end the faults that are due, and step GPS and EKF."""
        if math.isinf(self._driving_s) and float(rover[0]["driven_m"]) >= DRIVING_M:
            self._driving_s = self._changes_s = now_s
        if now_s >= self._changes_s - 1e-6:
            self._begin_and_end(now_s, vehicle)
            self._apply(vehicle, rover, sensing)
        while self._steps * STEP_S <= now_s + 1e-6:
            self._steps += 1
            if self._has_gps:
                self._move_gps(vehicle)
                self._step_ekf(vehicle)
        steps = self._has_gps or (self._awaits_driving and math.isinf(self._driving_s))
        self.due_s = min(self._changes_s, self._steps * STEP_S if steps else math.inf)

    def rebooted(self, vehicle: Vehicle, rover: Record, sensing: RangeSensing) -> None:
        """Apply the active faults to an autopilot that has just booted."""
        self._was_started = False
        self._mode_before.clear()
        for number, fault in self._active_faults():
            if isinstance(fault, PilotTakesOver):  # switch and sticks have not moved
                self._take_over(number, fault, vehicle)
        self._apply(vehicle, rover, sensing)

    def _begin_and_end(self, now_s: float, vehicle: Vehicle) -> None:
        self._changes_s = math.inf
        for number, (fault, rng) in enumerate(self._faults):
            elapsed_s = self._elapsed_s(fault, now_s)
            active, change_s = fault.at(elapsed_s)
            self._changes_s = min(self._changes_s, change_s + now_s - elapsed_s)
            if active and number not in self._active:
                self._active.add(number)
                self._begin(number, fault, rng, vehicle, change_s - elapsed_s + now_s)
            elif not active and number in self._active:
                self._active.remove(number)
                self._end(number, fault, vehicle)

    def _begin(self, number: int, fault: Fault, rng: np.random.Generator, vehicle: Vehicle, end_s: float) -> None:
        match fault:
            case Reboot():
                self.reboot_until_s = end_s
            case PilotTakesOver():
                self._take_over(number, fault, vehicle)
            case GpsGlitch() | GpsFixChange():
                drawn_rad = float(rng.uniform(0.0, 2.0 * math.pi))
                given = fault.bearing_deg
                self._glitch_rad[number] = drawn_rad if given is None else math.radians(given)
            case _:
                pass

    def _take_over(self, number: int, fault: PilotTakesOver, vehicle: Vehicle) -> None:
        self._mode_before[number] = vehicle.mode
        _hold_sticks(vehicle, Sticks(fault.steering, fault.throttle))
        set_mode(vehicle, Mode[fault.mode])

    def _end(self, number: int, fault: Fault, vehicle: Vehicle) -> None:
        if not isinstance(fault, PilotTakesOver):
            return
        before = self._mode_before.pop(number, None)
        others = [(other, one) for other, one in self._active_faults() if isinstance(one, PilotTakesOver)]
        if others:  # there is one switch: it stays where another fault has set it
            self._take_over(*others[-1], vehicle)
        else:
            _hold_sticks(vehicle, Sticks())
        if before is not None and others:
            self._mode_before[others[-1][0]] = before
        elif before is not None:
            set_mode(vehicle, before)

    # Effects ---------------------------------------------------------------------------------------------------------

    def _active_faults(self) -> Iterable[tuple[int, Fault]]:
        return ((number, self._faults[number][0]) for number in sorted(self._active))

    def _apply(self, vehicle: Vehicle, rover: Record, sensing: RangeSensing) -> None:
        """Set the effects that are either present or not."""
        grips = [1.0, 1.0]
        lidar: Defect | None = None
        beams: dict[int, Defect] = {}
        volts = math.inf
        self._trouble(vehicle)
        for _, fault in self._active_faults():
            match fault:
                case WheelSlip():
                    for side, name in enumerate(("left", "right")):
                        grips[side] *= 1.0 - fault.share if fault.side in ("both", name) else 1.0
                case SensorFault():
                    lidar = lidar if fault.beams else fault.defect
                    numbers = [number - 1 for number in fault.beams] or sensing.numbers()
                    beams |= dict.fromkeys(numbers, fault.defect)
                case BatteryLow():
                    volts = min(volts, fault.volts)
                case _:
                    pass
        if float(rover[0]["turning_radius_m"]) > 0.0:
            # Steered wheels are driven together: slip on one side affects both.
            grips = [1.0, 0.5 * (grips[0] + grips[1])]
        rover["grip_1"], rover["grip_3"] = grips
        sensing.lidar_fault, sensing.beam_faults = lidar, beams
        for number, one in enumerate(self._lidars, 1):
            one.faults = self._line_faults(number)
        vehicle.battery.fault_v = volts if math.isfinite(volts) else None

    def _trouble(self, vehicle: Vehicle) -> None:
        """What befalls commands now; each fault keeps its count over changes of others and over reboots."""
        vehicle.command_troubles = [
            self._troubles.setdefault(
                number,
                CommandTrouble(
                    frozenset(fault.commands),
                    lost=fault.effect == "lost",
                    unanswered=fault.effect == "unanswered",
                    result=fault.result if fault.effect == "refused" else None,
                    left=fault.times,
                ),
            )
            for number, fault in self._active_faults()
            if isinstance(fault, CommandFault)
        ]

    def _line_faults(self, number: int) -> LineFaults:
        """What is wrong with the lidar on serial line ``number``."""
        found = LineFaults()
        for _, fault in self._active_faults():
            match fault:
                case SensorFault() if not fault.beams:
                    found.defect = fault.defect
                case LidarFault() if not fault.lidars or number in fault.lidars:
                    found.lost = 1.0 - (1.0 - found.lost) * (1.0 - fault.lost)
                    found.damaged = 1.0 - (1.0 - found.damaged) * (1.0 - fault.damaged)
                    found.noise_m = math.hypot(found.noise_m, fault.noise_m)
                    found.stalled |= fault.stalled
                    found.unplugged |= fault.unplugged
                case _:
                    pass
        return found

    # GPS -------------------------------------------------------------------------------------------------------------

    def _move_gps(self, vehicle: Vehicle) -> None:
        """Set the GPS of this moment: the sum of all errors, the worst of all fixes."""
        north_m = east_m = 0.0
        talks = told = True
        fix_type = RTK_FIXED
        for number, fault in self._active_faults():
            match fault:
                case GpsLoss():
                    talks = False
                case GpsFixUntold():
                    told = False
                case GpsFixChange(fix=FixName.NONE):
                    talks, fix_type = False, NO_FIX
                case GpsGlitch() | GpsFixChange():
                    if isinstance(fault, GpsFixChange):
                        fix_type = min(fix_type, FIX_TYPES[fault.fix])
                    north_m += fault.metres * math.cos(self._glitch_rad[number])
                    east_m += fault.metres * math.sin(self._glitch_rad[number])
                case GpsNoise():
                    off_n, off_e = self._wander(number, fault)
                    north_m, east_m = north_m + off_n, east_m + off_e
                case _:
                    pass
        gps = vehicle.ekf.gps
        gps.talks, gps.fix_type, gps.told = talks, fix_type, told
        gps.error_m = (north_m, east_m)

    def _wander(self, number: int, fault: GpsNoise) -> tuple[float, float]:
        keep = math.exp(-STEP_S / fault.time_s)
        kick_n, kick_e = self._faults[number][1].normal(0.0, fault.metres * math.sqrt(1.0 - keep * keep), size=2)
        before_n, before_e = self._noise_m[number]
        self._noise_m[number] = keep * before_n + float(kick_n), keep * before_e + float(kick_e)
        return self._noise_m[number]

    def _step_ekf(self, vehicle: Vehicle) -> None:
        ekf = vehicle.ekf
        if not vehicle.is_started:
            self._delay_start(vehicle)
            return
        if not self._was_started:
            self._was_started = True
            ekf.begin(vehicle.time_s)
        before_m = vehicle.position_m()
        changes = ekf.step(vehicle.time_s, vehicle.armed, self._ekf_rng)
        shown_m = ekf.shown_m
        vehicle.stale_m = before_m if shown_m is None else None
        place_m = ekf.offset_m if shown_m is None else shown_m
        estimate = vehicle.estimate
        estimate["offset_n"], estimate["offset_e"] = place_m
        estimate["offset_vn"], estimate["offset_ve"] = ekf.drift_m_s
        report_ekf(vehicle, changes)

    def _delay_start(self, vehicle: Vehicle) -> None:
        """Delay the parts of the start-up that need GPS."""
        gps, late, now_s = vehicle.ekf.gps, vehicle.gps_late, vehicle.time_s
        if gps.talks:
            gps.heard_s = now_s
            return
        next_s = now_s + 2.0 * STEP_S
        if not vehicle.has_home:
            late.home_s = max(late.home_s, next_s - HOME_S)
        if not vehicle.has_origin:
            late.origin_s = max(late.origin_s, next_s - ORIGIN_S)
        late.position_s = max(late.position_s, next_s + ALIGN_S - POSITION_S)

    # Links -----------------------------------------------------------------------------------------------------------

    def link_faults(self, now_s: float) -> list[LinkFault]:
        """Those that are active."""
        return [fault for fault, _ in self._links if self.is_active(fault, now_s)]

    def pass_on(self, queue: LinkQueue, data: bytes, now_s: float) -> None:
        """Put bytes on their queue through a link with its faults."""
        queue.pass_on(data, now_s, lambda fault: self.is_active(fault, now_s), self._links)


def _hold_sticks(vehicle: Vehicle, sticks: Sticks) -> None:
    """Set the transmitter's sticks; a ground station's override has priority while it lasts."""
    vehicle.transmitter = sticks
    if vehicle.sticks.overridden_s is None:
        vehicle.sticks = sticks
    apply_sticks(vehicle)
