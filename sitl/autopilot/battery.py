"""The battery and its monitor: voltage, charge used, and the battery failsafe (behaviour of AP_BattMonitor).

Current and voltage as recorded: 50 A with both motors at full output, 0.014 ohm. With SIM_BATT_CAP_AH above 0 the
pack also discharges; by default, as in the firmware's own simulation, its voltage at rest stays SIM_BATT_VOLTAGE.

Nouns: AP_BattMonitor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

FULL_A = 50.0

RESISTANCE_OHM = 0.014

CHARGE: Sequence[float] = (0.0, 0.1, 0.5, 1.0)

SHARE_OF_VOLTS: Sequence[float] = (0.76, 0.86, 0.92, 1.0)
"""Voltage at rest by charge, as a share of a full pack's: roughly that of lithium polymer cells. Our assumption."""

OK, LOW, CRITICAL = 0, 1, 2

NAMES = ("", "low", "critical")


def rest_volts(parameters: Mapping[str, float], drawn_ah: float) -> float:
    """Voltage without current."""
    full_v, capacity_ah = parameters["SIM_BATT_VOLTAGE"], parameters["SIM_BATT_CAP_AH"]
    if capacity_ah <= 0.0:
        return full_v
    charge = min(max(1.0 - drawn_ah / capacity_ah, 0.0), 1.0)
    upper = next(i for i in range(1, len(CHARGE)) if charge <= CHARGE[i])
    lower = upper - 1
    along = (charge - CHARGE[lower]) / (CHARGE[upper] - CHARGE[lower])
    return full_v * (SHARE_OF_VOLTS[lower] + along * (SHARE_OF_VOLTS[upper] - SHARE_OF_VOLTS[lower]))


@dataclass
class Battery:
    """State of the monitor since boot. ``worst``: the most severe failsafe so far; it never goes back."""

    fault_v: float | None = None
    """Voltage at rest that a fault imposes."""
    worst: int = OK
    low_since_s: float | None = None
    critical_since_s: float | None = None

    def volts(self, parameters: Mapping[str, float], drawn_ah: float, amps: float) -> float:
        """Voltage under this current."""
        rest_v = rest_volts(parameters, drawn_ah)
        if self.fault_v is not None:
            rest_v = min(rest_v, self.fault_v)
        return max(rest_v - RESISTANCE_OHM * amps, 0.0)

    def check(self, parameters: Mapping[str, float], volts: float, used_mah: float, now_s: float) -> int:
        """LOW or CRITICAL when the failsafe has just reached that level, else OK."""
        low, critical = below(parameters, volts, used_mah, "LOW"), below(parameters, volts, used_mah, "CRT")
        self.low_since_s = _since(low[0], self.low_since_s, now_s)
        self.critical_since_s = _since(critical[0], self.critical_since_s, now_s)
        patience_s = parameters["BATT_LOW_TIMER"]
        state = OK
        if low[1] or _is_over(self.low_since_s, now_s, patience_s):
            state = LOW
        if critical[1] or _is_over(self.critical_since_s, now_s, patience_s):
            state = CRITICAL
        if state <= self.worst:
            return OK
        self.worst = state
        return state


def below(parameters: Mapping[str, float], volts: float, used_mah: float, level: str) -> tuple[bool, bool]:
    """Whether voltage and capacity are below BATT_LOW_... or BATT_CRT_...; a limit of 0 switches the check off."""
    limit_v, limit_mah = parameters[f"BATT_{level}_VOLT"], parameters[f"BATT_{level}_MAH"]
    left_mah = parameters["BATT_CAPACITY"] - used_mah
    return limit_v > 0.0 and 0.0 < volts < limit_v, limit_mah > 0.0 and left_mah < limit_mah


def _since(is_so: bool, since_s: float | None, now_s: float) -> float | None:
    return None if not is_so else now_s if since_s is None else since_s


def _is_over(since_s: float | None, now_s: float, patience_s: float) -> bool:
    return since_s is not None and patience_s > 0.0 and now_s - since_s > patience_s


def arming_complaint(parameters: Mapping[str, float], volts: float, used_mah: float) -> str:
    """What the arming checks report about the battery; empty if nothing."""
    if 0.0 < volts < parameters["BATT_ARM_VOLT"]:
        return "Battery 1 below minimum arming voltage"
    for level, word in (("LOW", "low"), ("CRT", "critical")):
        voltage, capacity = below(parameters, volts, used_mah, level)
        if voltage or capacity:
            return f"Battery 1 {word} {'voltage' if voltage else 'capacity'} failsafe"
    return ""
